"""The paper's beam in SI units: what its layers imply of its length, and of its deflection at 100 V."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["Beam", "beam_of"]

MIL = 25.4e-6
# Layers of section 2.1: Kapton with copper 1.5 mil at the top, the middle and the bottom, PZT-5A 8 mil between.
KAPTON, PIEZO = 1.5 * MIL, 8 * MIL
# Assumed, from data sheets: PZT-5A's modulus, density and d31; Kapton's modulus and density (copper left out).
PIEZO_PA, PIEZO_KG, D31 = 61e9, 7750.0, 171e-12
KAPTON_PA, KAPTON_KG = 2.5e9, 1420.0
# Of a uniform cantilever's first mode: its wave number times length, and its share of a static tip deflection.
FIRST, SHARE = 1.8751, 0.891


@dataclass(frozen=True)
class Beam:
    """A uniform cantilever of these layers.

    Attributes
    ----------
    length_m : with which its first mode has the frequency given.
    tip_m : static deflection of its tip, of the first mode, at the voltage given.
    """

    length_m: float
    tip_m: float


def beam_of(f0_hz: float, volts: float) -> Beam:
    """The beam whose first mode is at `f0_hz`; `volts` from top to bottom, half across each layer."""
    inner, outer = KAPTON / 2, KAPTON / 2 + PIEZO
    edge = outer + KAPTON
    stiffness = 2 / 3 * (PIEZO_PA * (outer**3 - inner**3) + KAPTON_PA * (inner**3 + edge**3 - outer**3))
    mass = 2 * PIEZO_KG * PIEZO + 3 * KAPTON_KG * KAPTON
    length = math.sqrt(FIRST**2 / (2 * math.pi * f0_hz) * math.sqrt(stiffness / mass))
    moment = PIEZO_PA * D31 * volts / (2 * PIEZO) * (outer**2 - inner**2)
    return Beam(length, SHARE * moment / stiffness * length**2 / 2)
