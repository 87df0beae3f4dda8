"""Drives and links of a plan, corrected to actuators as they are known: the same pattern on another chain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Device, Outcome, Setting, balance_near

from ..closed_forms.links import drive_for, links_for
from ..operating_point import OperatingPoint
from ..plan import Ramp

__all__ = ["Factors", "factors_for", "led"]

Floats = NDArray[np.float64]

# A correction changes a drive or a link by no more than this factor from one page to the next, and in all.
STEP, MOST = 1.6, 4.0
# Nodes of a way between two corrections of a pattern that stays.
NODES = 17


class Factors(NamedTuple):
    """What the drive of a chain and its links, float64, shape (n-1,), are multiplied by."""

    drive: float
    links: Floats

    @classmethod
    def none(cls, n: int) -> Self:
        """Of a chain that is as planned."""
        return cls(1.0, np.ones(n - 1))

    def same(self, other: Factors) -> bool:
        """Whether both change alike."""
        return self.drive == other.drive and np.array_equal(self.links, other.links)


@dataclass(frozen=True)
class _Real:
    """A chain by its numbers, float64, shape (n, 4), as `ChainEstimate.mean` has them."""

    numbers: Floats

    @property
    def chain(self) -> Chain:
        """Without what drive and links make of what they are set to."""
        stiffness, delta, beta, _ = self.numbers.T
        return Chain.of(len(stiffness), delta=delta, beta=beta, stiffness=stiffness)

    def settings(self, amplitude: Floats, omega: float) -> tuple[float, Floats]:
        """Drive and links, as they are set, that hold amplitudes in one harmonic; NaN where nothing does."""
        chain, gain = self.chain, self.numbers[:, 3]
        links = links_for(chain, amplitude, omega) if chain.n > 1 else np.empty(0)
        return float(drive_for(chain, amplitude[:1], omega)[0] / gain[0]), links / gain[1:]

    def moves(self, state: OperatingPoint) -> NDArray[np.complex128] | None:
        """How it moves at a state, complex128, shape (n,); None where that is not found."""
        chain, gain = self.chain, self.numbers[:, 3]
        setting = Setting.of(
            chain, epsilon=abs(state.epsilon) * gain[0], phase=np.angle(state.epsilon),
            lam=(state.lam * gain[1:])[None] if chain.n > 1 else 0.0, omega=state.omega,
        )  # fmt: skip
        found = balance_near(chain, setting, state.phasor[None], tol=1e-6)
        return np.asarray(found.phasor[0]) if Outcome(found.outcome[0]) is Outcome.OK else None


def factors_for(device: Device, planned: Floats, known: Floats, state: OperatingPoint, old: Factors) -> Factors:
    """What makes of a state that was planned for one chain the same motion on another.

    Where every link has its own lam the amplitudes are kept; else the drive alone is led, to the nearest motion.

    Parameters
    ----------
    planned, known : the numbers that it was planned with, and those that are known; float64, shape (n, 4).
    old : of the page before; what is found lies within `STEP` of them, within `MOST`, and within the device.
    """
    amplitude = np.abs(state.phasor)
    if np.any(amplitude == 0):
        return old
    if device.coupling.scope == "link" or device.chain_length == 1:
        (drive, links), (drive_0, links_0) = (_Real(one).settings(amplitude, state.omega) for one in (known, planned))
        found = Factors(drive / drive_0, links / links_0)
    else:
        real = _Real(known).moves(state)
        share = 1.0 if real is None else float(abs(np.vdot(real, state.phasor)) / np.vdot(real, real).real)
        found = Factors(share, np.ones(device.chain_length - 1))
    return _within(device, state, found, old)


def _within(device: Device, state: OperatingPoint, found: Factors, old: Factors) -> Factors:
    if not (np.isfinite(found.drive) and np.isfinite(found.links).all()):
        return old
    drive = float(np.clip(found.drive, max(old.drive / STEP, 1 / MOST), min(old.drive * STEP, MOST)))
    links = np.clip(found.links, np.maximum(old.links / STEP, 1 / MOST), np.minimum(old.links * STEP, MOST))
    span = device.coupling.lam
    with np.errstate(divide="ignore", invalid="ignore"):
        links = np.where(state.lam > 0, np.clip(links * state.lam, span.min, span.max) / state.lam, 1.0)
    return Factors(min(drive, device.epsilon_max / abs(state.epsilon)), links)


def led(
    device: Device, state: OperatingPoint, ramp: Ramp | None, way_s: float, before: Factors, after: Factors
) -> tuple[OperatingPoint, Ramp | None]:
    """A state and the way to it, with the factors going smoothly from one to the other on it.

    Parameters
    ----------
    way_s : how long a way takes where the plan has none.
    """
    span = device.coupling.lam
    set_to = np.clip(state.lam * after.links, span.min, span.max)
    done = replace(state, epsilon=state.epsilon * after.drive, lam=set_to)
    if ramp is None and before.same(after):
        return done, None
    if ramp is None or (ramp.epsilon is None and ramp.lam is None):
        nodes = np.linspace(0.0, way_s, NODES)
        drive = np.full(NODES, state.epsilon)
        ramp = Ramp(nodes, drive, np.zeros_like(drive), lam_t_s=nodes, lam=np.tile(state.lam, (NODES, 1)))
    share, slope = _step(ramp.t_s / ramp.duration_s)
    factor = before.drive + (after.drive - before.drive) * share
    factor_slope = (after.drive - before.drive) * slope / ramp.duration_s
    way = replace(ramp, residue=None)
    if ramp.epsilon is not None:
        epsilon = ramp.epsilon * factor
        # The gate asks for the amplifier's volts, whatever else is wanted.
        held = np.minimum(1.0, device.epsilon_max / np.maximum(np.abs(epsilon), np.finfo(float).tiny))
        rate = None
        if ramp.epsilon_slope is not None:
            rate = (ramp.epsilon_slope * factor + ramp.epsilon * factor_slope) * held
        way = replace(way, epsilon=epsilon * held, epsilon_slope=rate)
    if ramp.lam is not None and ramp.lam_t_s is not None:
        part, _ = _step(ramp.lam_t_s / ramp.duration_s)
        lam = ramp.lam * (before.links + part[:, None] * (after.links - before.links))
        way = replace(way, lam=np.clip(lam, span.min, span.max))
    return done, way


def _step(x: Floats) -> tuple[Floats, Floats]:
    """A step from 0 to 1 whose first three derivatives vanish at both ends, and its slope."""
    x = np.clip(x, 0.0, 1.0)
    return x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3), 140 * x**3 * (1 - x) ** 3
