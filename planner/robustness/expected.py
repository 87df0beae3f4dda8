"""What the frames of a plan become under the device's spread: every chain in its place judged once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chainsim import Closure, Device

from ..closed_forms.links import drive_for, links_for
from ..margins import noise_error
from ..operating_point import OperatingPoint
from ..outlook import FACTORS, FrameSpread, TradePoint, needed_for
from ..targets import AmplitudeTarget, ChainTarget
from ..wish import FrameVerdict, FrameWish
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
Mask = NDArray[np.bool_]

DRAWS, SEED = 1000, 0
# The yield that is wanted when none is asked for, and the parts of the spread that are tried where it is not reached.
WANTED = 0.9
# Chains judged that are kept, and draws that settings of a whole device are compared by.
MOST_KEPT, MOST_BYTES, FEW = 1024, 1 << 26, 256
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
    """Over the draws: the worst error, whether all dots are right, and what is felt.

    `level` : float32, shape (n, chains, count), in units of full scale, NaN where an actuator has left its well.
    `noise` : what the steps of a converter add to or take from it.
    """

    error: Floats
    right: Mask
    level: NDArray[np.float32]
    noise: float = 0.0

    @property
    def made(self) -> Mask:
        return np.asarray(self.right & (self.error <= TOLERANCE))

    @property
    def yield_(self) -> float:
        return float(np.mean(self.made))


@dataclass(frozen=True)
class _Shown:
    """A frame as it is planned: what chains hold, the places of those that do anything, and what was asked."""

    targets: Sequence[ChainTarget]
    states: Sequence[OperatingPoint]
    wish: FrameWish

    @cached_property
    def busy(self) -> list[int]:
        return [i for i, one in enumerate(self.states) if one.moving or np.any(one.bias) or np.any(one.target)]

    @cached_property
    def dots(self) -> bool:
        """Whether it is judged as dots: by which are right, and their contrast."""
        amplitudes = all(isinstance(one, AmplitudeTarget) for one in self.targets)
        return amplitudes and self.wish.dots and not any(one.tones or one.phase is not None for one in self.states)

    def key(self, i: int, factor: float) -> _Key:
        state = self.states[i]
        return i, self.targets[i], state.omega, state.epsilon, state.lam.tobytes(), factor


_Key = tuple[int, ChainTarget, float, complex, bytes, float]


class Expectation:
    """Frames under spread. Draw k is one device: the same actuators in every frame.

    Where a drive is all that may be chosen the planned one stays: an actuator's error grows one way with every one of
    its numbers, so that the setting whose median draw is exact, the nominal one, has the least expected error. That
    holds for deflections; waves are told their error, and the accuracy that they need.

    Attributes
    ----------
    device : with a spread.
    wanted : the share of devices that is to keep a frame.
    """

    def __init__(self, device: Device, wanted: float = WANTED) -> None:
        self.device, self._spread, self.wanted = device, known_spread(device), wanted
        self._kept: dict[_Key, _Drawn] = {}
        self._traded: dict[tuple[int, bytes], tuple[TradePoint, ...]] = {}
        self._frames: dict[tuple[tuple[ChainTarget, ...], bytes], FrameSpread | None] = {}
        self._most = min(MOST_KEPT * len(FACTORS), MOST_BYTES // (4 * DRAWS * device.chain_length))

    def of(
        self, targets: Sequence[ChainTarget], states: Sequence[OperatingPoint], wish: FrameWish
    ) -> FrameSpread | None:
        """A frame that is made as planned, chain by chain; None where nothing moves."""
        key = tuple(targets), wish.level.tobytes()
        if key not in self._frames:
            if len(self._frames) >= MOST_KEPT:
                self._frames.clear()
            self._frames[key] = self._made(_Shown(targets, states, wish))
        return self._frames[key]

    def kept(self, targets: Sequence[ChainTarget], states: Sequence[OperatingPoint], wish: FrameWish) -> Mask:
        """On which draws a frame is felt as it was wished; bool, shape (draws,)."""
        return self._devices(_Shown(targets, states, wish), 1.0)

    def _made(self, shown: _Shown) -> FrameSpread | None:
        busy, targets, states = shown.busy, shown.targets, shown.states
        if not busy:
            return None
        drawn, worst = self._all(shown, 1.0), self._worst(shown)
        spread, error = self._spread, drawn.error
        devices = self._under_less(shown)
        return FrameSpread(
            spread=(spread.f0, spread.delta, spread.beta, spread.lam),
            expected=float(error.mean()),
            median=float(np.median(error)),
            quantile_90=float(np.quantile(error, 0.9)),
            yield_=float(devices[0].mean()),
            dots_right=float((self._verdict(shown, 1.0).right if shown.dots else drawn.right).mean()),
            tolerance=TOLERANCE,
            wanted=self.wanted,
            draws=DRAWS,
            needed=needed_for(devices, self.wanted),
            devices=devices,
            least_db=shown.wish.least_db if shown.dots else None,
            held=_held(self.device, shown) if shown.dots else "",
            aim=max(float(np.abs(_wanted(targets[i], states[i]) - states[i].target).max()) for i in busy),
            worst=None if worst is None else self._planned(shown, worst),
            trade=() if worst is None else self._trade(worst, _wanted(targets[worst], states[worst])),
        )

    def _under_less(self, shown: _Shown) -> Mask:
        """On which draws the wish is felt under ever less spread; bool, shape (parts, draws).

        A plan for so much less spread may aim less far beside the wish: it is taken to hold that exactly, where that
        is better.
        """
        exact = [self._exact(i, shown.targets[i], state) for i, state in enumerate(shown.states)]
        devices = np.ones((len(FACTORS), DRAWS), dtype=np.bool_)
        for k, factor in enumerate(FACTORS.tolist()):
            devices[k] = self._devices(shown, factor)
            if k and any(one is not planned for one, planned in zip(exact, shown.states, strict=True)):
                devices[k] = max(devices[k], self._devices(replace(shown, states=exact), factor), key=np.mean)
            if devices[k].all():
                break
        devices.flags.writeable = False
        return devices

    def _devices(self, shown: _Shown, factor: float) -> Mask:
        """On which draws a frame is felt as it was wished."""
        if shown.dots:
            return self._verdict(shown, factor).ok
        return self._all(shown, factor).made if shown.busy else np.ones(DRAWS, dtype=np.bool_)

    def _verdict(self, shown: _Shown, factor: float) -> FrameVerdict:
        device = self.device
        felt = np.zeros((DRAWS, device.chains, device.chain_length))
        worse = np.where(shown.wish.raised, -1.0, 1.0).reshape(felt.shape[1:])
        for i in shown.busy:
            one = self._one(shown, i, factor)
            felt[:, i] = one.level[:, 0].T + worse[i] * one.noise
        return shown.wish.verdict(felt.reshape(DRAWS, device.rows, device.cols))

    def _exact(self, i: int, target: ChainTarget, state: OperatingPoint) -> OperatingPoint:
        """A state that aims beside its wish, as it would be if it did not."""
        wish, device = _wanted(target, state), self.device
        if np.array_equal(wish, state.target):
            return state
        place = self._place(i)
        chain, amplitude = device.chain_at(*place), wish * device.full_scale
        epsilon = float(drive_for(chain, amplitude[:1], state.omega)[0]) / self._drive_gain(i)
        lam = links_for(chain, amplitude, state.omega) / device.lam_gain(*place)
        return replace(state, epsilon=complex(epsilon), lam=lam, target=wish)

    def _all(self, shown: _Shown, factor: float) -> _Drawn:
        """All chains of a frame; those with phases together, because a phase they share makes no difference."""
        phased = [i for i in shown.busy if shown.states[i].phase is not None]
        found = [self._judged(phased, shown, factor)] if phased else []
        found += [self._one(shown, i, factor) for i in shown.busy if i not in phased]
        error, right = np.max([one.error for one in found], axis=0), np.all([one.right for one in found], axis=0)
        return _Drawn(error, right, np.empty((0, 0, 0), np.float32))

    def _one(self, shown: _Shown, i: int, factor: float) -> _Drawn:
        key = shown.key(i, factor)
        if key not in self._kept:
            if len(self._kept) >= self._most:
                self._kept.clear()
            self._kept[key] = self._judged([i], shown, factor)
        return self._kept[key]

    def _judged(self, places: list[int], shown: _Shown, factor: float) -> _Drawn:
        device = self.device
        there = [replace(shown.states[i], target=_wanted(shown.targets[i], shown.states[i])) for i in places]
        set_to = [_as_driven(state, self._drive_gain(i)) for i, state in zip(places, there, strict=True)]
        parts = drawn_in(device, self._spread.scaled(factor), places, count=DRAWS, seed=SEED)
        if there[0].tones:
            return _toned(device, set_to[0], parts)
        ring = None if device.coupling.closure is Closure.OPEN else centre_of(device, places)
        motion = motion_of(set_to, parts, ring)
        report = judge(frame_target(device, there), motion, tolerance=TOLERANCE, threshold=THRESHOLD)
        noise = max(noise_error(device, one) for one in there) / device.full_scale
        level = np.where(motion.escaped, np.nan, np.abs(motion.phasor) / device.full_scale).astype(np.float32)
        return _Drawn((report.error + noise).astype(np.float32), report.right, level, noise)

    def _place(self, i: int) -> tuple[int, int]:
        row, index = divmod(i, self.device.chains_per_row)
        return row, index

    def _drive_gain(self, i: int) -> float:
        return self.device.drive_per_volt(*self._place(i)) / self.device.epsilon_per_volt

    def _worst(self, shown: _Shown) -> int | None:
        """Of the chains whose settings have a closed form, that with the largest expected error."""
        device, states = self.device, shown.states
        if device.coupling.scope != "link" and device.chain_length > 1:
            return None
        plain = [i for i in shown.busy if states[i].epsilon and states[i].phase is None and not states[i].tones]
        return max(plain, key=lambda i: float(self._one(shown, i, 1.0).error.mean()), default=None)

    def _planned(self, shown: _Shown, i: int) -> TradePoint:
        drawn, state = self._one(shown, i, 1.0), shown.states[i]
        volts = abs(state.epsilon) / self.device.epsilon_max
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
        device, place = self.device, self._place(i)
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


def _held(device: Device, shown: _Shown) -> str:
    """What a frame of dots is made with, in words."""
    states = [shown.states[i] for i in shown.busy]
    aim = np.array([state.target for state in shown.states]).reshape(device.rows, device.cols)
    drive = f"{100 * max(state.margins.volts for state in states):.0f} % of the volts"
    words = [f"omega {next((one.omega for one in states if one.moving), 0.0):.3f}", drive]
    for name, chosen in (("raised", shown.wish.raised), ("flat", shown.wish.flat)):
        if chosen.any() and any(state.moving for state in states):
            low, high = aim[chosen].min(), aim[chosen].max()
            words.append(f"{name} dots aimed at {low:.2g} to {high:.2g} of full scale")
    return ", ".join(words if any(state.moving for state in states) else [drive])


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
    level = np.where(motion.lost, np.nan, felt)[:, None].astype(np.float32)
    return _Drawn(error.astype(np.float32), right, level)


def _wanted(target: ChainTarget, state: OperatingPoint) -> Floats:
    """The amplitudes wanted: those of the target, where a plan may aim beside them, else the state's."""
    return target.levels if isinstance(target, AmplitudeTarget) else state.target


def _as_driven(state: OperatingPoint, gain: float) -> OperatingPoint:
    """A state whose drive is what its actuator makes of it."""
    if gain == 1.0:
        return state
    tones = tuple(replace(tone, epsilon=tone.epsilon * gain) for tone in state.tones)
    return replace(state, epsilon=state.epsilon * gain, tones=tones)
