"""What the frames of a plan become under the device's spread: every chain in its place judged once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from chainsim import Closure, Device

from ..closed_forms.links import drive_for, links_for
from ..margins import noise_error
from ..operating_point import OperatingPoint
from ..outlook import FrameSpread, TradePoint
from ..targets import AmplitudeTarget, ChainTarget
from .batch_march import BatchParts, march
from .spread import (
    THRESHOLD,
    TOLERANCE,
    FrameTarget,
    SpreadReport,
    centre_of,
    draw,
    drawn_in,
    frame_target,
    judge,
    known_spread,
    motion_of,
)
from .tone_march import march_tones

__all__ = ["Expectation", "expected_of"]

Floats = NDArray[np.float64]

DRAWS, SEED = 1000, 0
# The yield that is asked for, and the parts of the spread that are tried when it is not reached.
WANTED = 0.9
FACTORS = 2.0 ** -np.arange(0.5, 8.0, 0.5)
# Chains judged that are kept, and draws that settings of a whole device are compared by.
MOST_KEPT, FEW = 1024, 256
# Frequencies of the trade.
TRADED = 8


def expected_of(device: Device, amplitude: Floats, epsilon: Floats, lam: Floats, omega: float) -> float:
    """Expected error of settings under the device's spread, the mean over P of them, in units of full scale.

    Parameters
    ----------
    amplitude : float64, shape (P, n), wished, dimensionless.
    epsilon : (P,).
    lam : (P, n-1).
    """
    parts = draw(device.chain_length, count=FEW, seed=SEED).parts(device.chain, known_spread(device))
    wishes = [
        FrameTarget((one[None] / device.full_scale).astype(np.complex128), device.full_scale) for one in amplitude
    ]
    held = zip(wishes, epsilon.tolist(), lam, strict=True)
    return float(np.mean([_report(wish, parts, drive, links, omega).expected for wish, drive, links in held]))


def _report(wish: FrameTarget, parts: BatchParts, epsilon: float, lam: Floats, omega: float) -> SpreadReport:
    """Settings of one chain under drawn parts."""
    force = np.zeros((len(lam) + 1, 1, 1), dtype=np.complex128)
    force[0] = epsilon
    motion = march(parts, force, np.append(0.0, lam)[:, None, None], omega)
    return judge(wish, motion, tolerance=TOLERANCE, threshold=THRESHOLD)


@dataclass(frozen=True)
class _Drawn:
    """Over the draws: the worst error, and whether all dots are right."""

    error: Floats
    right: NDArray[np.bool_]

    @property
    def yield_(self) -> float:
        return float(np.mean(self.right & (self.error <= TOLERANCE)))


class Expectation:
    """Frames under spread. Draw k is one device: the same actuators in every frame.

    Where a drive is all that may be chosen the planned one stays: an actuator's error grows one way with every one of
    its numbers, so that the setting whose median draw is exact, the nominal one, has the least expected error. That
    holds for deflections; waves are told their error, and the accuracy that they need.
    """

    def __init__(self, device: Device) -> None:
        self._device, self._spread = device, known_spread(device)
        self._kept: dict[tuple[int, ChainTarget, float], _Drawn] = {}
        self._traded: dict[tuple[int, bytes], tuple[TradePoint, ...]] = {}
        self._frames: dict[tuple[ChainTarget, ...], FrameSpread | None] = {}

    def of(self, targets: Sequence[ChainTarget], states: Sequence[OperatingPoint]) -> FrameSpread | None:
        """A frame that is made as planned, chain by chain; None where nothing moves."""
        key = tuple(targets)
        if key not in self._frames:
            if len(self._frames) >= MOST_KEPT:
                self._frames.clear()
            self._frames[key] = self._made(targets, states)
        return self._frames[key]

    def _made(self, targets: Sequence[ChainTarget], states: Sequence[OperatingPoint]) -> FrameSpread | None:
        busy = [i for i, state in enumerate(states) if state.moving or np.any(state.bias) or np.any(state.target)]
        if not busy:
            return None
        drawn, worst = self._all(busy, targets, states, 1.0), self._worst(busy, targets, states)
        spread, error = self._spread, drawn.error
        return FrameSpread(
            spread=(spread.f0, spread.delta, spread.beta, spread.lam),
            expected=float(error.mean()),
            median=float(np.median(error)),
            quantile_90=float(np.quantile(error, 0.9)),
            yield_=drawn.yield_,
            dots_right=float(drawn.right.mean()),
            tolerance=TOLERANCE,
            wanted=WANTED,
            draws=DRAWS,
            needed=self._needed(busy, targets, states, drawn.yield_),
            aim=max(float(np.abs(_wanted(targets[i], states[i]) - states[i].target).max()) for i in busy),
            worst=None if worst is None else self._planned(worst, targets[worst], states[worst]),
            trade=() if worst is None else self._trade(worst, _wanted(targets[worst], states[worst])),
        )

    def _needed(
        self, busy: list[int], targets: Sequence[ChainTarget], states: Sequence[OperatingPoint], now: float
    ) -> float:
        """The part of the spread at which the wanted yield is reached, between those tried.

        A plan for so much less spread need not aim beside the wish: it is taken to hold that exactly.
        """
        if now >= WANTED:
            return 1.0
        factors, yields = [1.0, *FACTORS.tolist()], {0: now}
        states = [self._exact(i, targets[i], state) for i, state in enumerate(states)]

        def reached(k: int) -> bool:
            yields[k] = self._all(busy, targets, states, factors[k]).yield_
            return yields[k] >= WANTED

        bad, good = 0, len(factors) - 1
        if not reached(good):
            return 0.0
        while good - bad > 1:
            middle = (bad + good) // 2
            bad, good = (bad, middle) if reached(middle) else (middle, good)
        share = (WANTED - yields[bad]) / (yields[good] - yields[bad])
        return float(factors[bad] * (factors[good] / factors[bad]) ** share)

    def _exact(self, i: int, target: ChainTarget, state: OperatingPoint) -> OperatingPoint:
        """A state that aims beside its wish, as it would be if it did not."""
        wish, device = _wanted(target, state), self._device
        if np.array_equal(wish, state.target):
            return state
        place = self._place(i)
        chain, amplitude = device.chain_at(*place), wish * device.full_scale
        epsilon = float(drive_for(chain, amplitude[:1], state.omega)[0]) / self._drive_gain(i)
        lam = links_for(chain, amplitude, state.omega) / device.lam_gain(*place)
        return replace(state, epsilon=complex(epsilon), lam=lam, target=wish)

    def _all(
        self, busy: list[int], targets: Sequence[ChainTarget], states: Sequence[OperatingPoint], factor: float
    ) -> _Drawn:
        """All chains of a frame; those with phases together, because a phase they share makes no difference."""
        phased = [i for i in busy if states[i].phase is not None]
        found = [self._judged(phased, targets, states, factor)] if phased else []
        for i in busy:
            if i not in phased:
                key = (i, targets[i], factor)
                if key not in self._kept:
                    if len(self._kept) >= MOST_KEPT * len(FACTORS):
                        self._kept.clear()
                    self._kept[key] = self._judged([i], targets, states, factor)
                found.append(self._kept[key])
        return _Drawn(np.max([one.error for one in found], axis=0), np.all([one.right for one in found], axis=0))

    def _judged(
        self, places: list[int], targets: Sequence[ChainTarget], states: Sequence[OperatingPoint], factor: float
    ) -> _Drawn:
        device = self._device
        there = [replace(states[i], target=_wanted(targets[i], states[i])) for i in places]
        set_to = [_as_driven(state, self._drive_gain(i)) for i, state in zip(places, there, strict=True)]
        parts = drawn_in(device, self._spread.scaled(factor), places, count=DRAWS, seed=SEED)
        if there[0].tones:
            return _toned(device, set_to[0], parts)
        ring = None if device.coupling.closure is Closure.OPEN else centre_of(device, places)
        report = judge(
            frame_target(device, there), motion_of(set_to, parts, ring), tolerance=TOLERANCE, threshold=THRESHOLD
        )
        noise = max(noise_error(device, one) for one in there)
        return _Drawn((report.error + noise / device.full_scale).astype(np.float32), report.right)

    def _place(self, i: int) -> tuple[int, int]:
        row, index = divmod(i, self._device.chains_per_row)
        return row, index

    def _drive_gain(self, i: int) -> float:
        return self._device.drive_per_volt(*self._place(i)) / self._device.epsilon_per_volt

    def _worst(self, busy: list[int], targets: Sequence[ChainTarget], states: Sequence[OperatingPoint]) -> int | None:
        """Of the chains whose settings have a closed form, that with the largest expected error."""
        device = self._device
        if device.coupling.scope != "link" and device.chain_length > 1:
            return None
        plain = [i for i in busy if states[i].epsilon and states[i].phase is None and not states[i].tones]
        return max(plain, key=lambda i: float(self._kept[(i, targets[i], 1.0)].error.mean()), default=None)

    def _planned(self, i: int, target: ChainTarget, state: OperatingPoint) -> TradePoint:
        drawn = self._kept[(i, target, 1.0)]
        volts = abs(state.epsilon) / self._device.epsilon_max
        expected, median = float(drawn.error.mean()), float(np.median(drawn.error))
        return TradePoint(state.omega, volts, expected, median, drawn.yield_)

    def _trade(self, i: int, target: Floats) -> tuple[TradePoint, ...]:
        """A chain's closed forms over the device's band."""
        key = (i, target.tobytes())
        if key not in self._traded:
            if len(self._traded) >= MOST_KEPT:
                self._traded.clear()
            self._traded[key] = self._over_the_band(i, target)
        return self._traded[key]

    def _over_the_band(self, i: int, target: Floats) -> tuple[TradePoint, ...]:
        device, place = self._device, self._place(i)
        chain, parts = device.chain_at(*place), drawn_in(device, self._spread, [i], count=DRAWS, seed=SEED)
        amplitude, wish = target * device.full_scale, FrameTarget(target[None].astype(np.complex128), device.full_scale)
        most = device.amplifier.volts * device.drive_per_volt(*place)
        points = []
        for omega in np.linspace(device.omega.min, device.omega.max, TRADED).tolist():
            lam, drive = links_for(chain, amplitude, omega), float(drive_for(chain, amplitude[:1], omega)[0])
            if np.isfinite(lam).all() and drive <= most:
                report = _report(wish, parts, drive, lam / device.lam_gain(*place), omega)
                points.append(TradePoint(omega, drive / most, report.expected, report.median, report.yield_))
        return tuple(points)


def _toned(device: Device, state: OperatingPoint, parts: BatchParts) -> _Drawn:
    """One chain of several tones, each of which is to make its part of the amplitude."""
    flat = BatchParts(*(getattr(parts, field.name)[:, 0] for field in fields(BatchParts)))
    motion = march_tones(state, flat)
    levels = np.abs(motion.phasor[motion.wanted]) / device.full_scale
    target = state.target[:, None]
    error = np.abs(len(levels) * levels - target).max(axis=(0, 1))
    felt = levels.sum(axis=0)
    near = np.abs(felt - target) <= TOLERANCE
    right = np.all(((felt >= THRESHOLD) == (target >= THRESHOLD)) | near, axis=0) & ~motion.lost
    return _Drawn(error.astype(np.float32), right)


def _wanted(target: ChainTarget, state: OperatingPoint) -> Floats:
    """The amplitudes wanted: those of the target, where a plan may aim beside them, else the state's."""
    return target.levels if isinstance(target, AmplitudeTarget) else state.target


def _as_driven(state: OperatingPoint, gain: float) -> OperatingPoint:
    """A state whose drive is what its actuator makes of it."""
    if gain == 1.0:
        return state
    tones = tuple(replace(tone, epsilon=tone.epsilon * gain) for tone in state.tones)
    return replace(state, epsilon=state.epsilon * gain, tones=tones)
