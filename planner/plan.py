"""What the planner decided: for every frame, what each chain holds and how it gets there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome
from encoders import Frame

__all__ = ["ChainState", "FramePlan", "Margins", "Plan", "Ramp"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True)
class Margins:
    """How far a state stays from what it must not reach, and what it is sensitive to.

    Attributes
    ----------
    volts : peak voltage over the amplifier's; 1 is at the limit.
    well : largest deflection over the limit of the softening well (static fold for a bias, hilltop for a
        vibration); 1 is at the limit, 0 unless beta < 0.
    noise_gain : how many times more a disturbance on the drive, at the worst frequency and lasting for
        ever, is magnified than the drive itself is, at the worst actuator; 1 where nothing vibrates.
    """

    volts: float
    well: float
    noise_gain: float = 1.0


@dataclass(frozen=True)
class ChainState:
    """What one chain of n actuators holds while a frame stands.

    Attributes
    ----------
    target : float64, shape (n,), the amplitude that is to be felt, in units of full scale (floor included).
    epsilon : complex drive phasor (modulus = drive amplitude, argument = psi).
    lam : float64, shape (n-1,), links. omega : drive frequency over f0 (1.0 where nothing vibrates).
    bias : float64, shape (n,), DC force on each actuator.
    phasor : complex128, shape (n,), predicted first harmonic, dimensionless. mean : float64, shape (n,).
    error : predicted worst deviation from `target`, in units of full scale.
    """

    target: Floats
    epsilon: complex
    lam: Floats
    bias: Floats
    omega: float
    phasor: Complexes
    mean: Floats
    error: float
    margins: Margins
    outcome: Outcome


@dataclass(frozen=True)
class Ramp:
    """How one chain goes from one state to the next.

    Drive and bias are cubic Hermite curves between their nodes; links are linear between theirs.

    Attributes
    ----------
    t_s : float64, shape (K,), seconds from the start of the frame; first 0, last the ramp's length.
    epsilon : complex128, shape (K,), drive envelope: force = Re(epsilon e^{i omega tau}), tau from the
        start of the whole plan; `epsilon_slope` per second. None when the drive stays zero.
    bias : float64, shape (K, n); `bias_slope` per second. None when no bias changes.
    lam_t_s : float64, shape (L,); lam : float64, shape (L, n-1), the links. None when they jump to the new
        state's values at the start of the frame.
    lacking : one clause on what the device lacks for this way, empty when it can go it.
    """

    t_s: Floats
    epsilon: Complexes | None = None
    epsilon_slope: Complexes | None = None
    bias: Floats | None = None
    bias_slope: Floats | None = None
    lam_t_s: Floats | None = None
    lam: Floats | None = None
    lacking: str = ""

    @property
    def duration_s(self) -> float:
        """Length of the ramp in seconds."""
        return float(self.t_s[-1])


@dataclass(frozen=True)
class FramePlan:
    """One frame on the time line.

    `states` and `ramps` go row by row, chain by chain (rows * chains_per_row of them); a ramp of None
    means the chain already stands. `frame` is None for the way out after the last frame.
    `note` is one sentence when the outcome is not ok.
    """

    frame: Frame | None
    start_s: float
    settled_s: float
    end_s: float
    states: tuple[ChainState, ...]
    ramps: tuple[Ramp | None, ...]
    outcome: Outcome = Outcome.OK
    note: str = ""


@dataclass(frozen=True)
class Plan:
    """A device and its frames, made lazily: iterating `frames` again plans again (rows come from the cache).

    `encoding` is handed through from the scene.
    """

    device: Device
    frames: Iterable[FramePlan]
    encoding: Mapping[str, Any]
