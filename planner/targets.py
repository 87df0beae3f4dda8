"""What is wanted of one chain: targets that are equal where what is wanted is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from chainsim import Device
from encoders import TargetPattern, WalkingBars

from .wish import threshold_for

__all__ = [
    "AS_WISHED",
    "AmplitudeTarget",
    "ChainTarget",
    "DotGoal",
    "UnlockedTarget",
    "WalkingTarget",
    "WaveTarget",
    "targets_of",
]

Floats = NDArray[np.float64]

# Phases are told apart to so many decimals, so that rows of a plane wave are the same but for a turn.
PHASE_DECIMALS = 9
AMPLITUDE_DECIMALS = 12
# Rows of amplitudes that are kept, the latest.
MOST_AMPLITUDES = 4096


AS_WISHED = 1.0


@dataclass(frozen=True)
class DotGoal:
    """What raised and flat dots are to keep on devices whose actuators differ.

    Attributes
    ----------
    contrast_db : least decibels between the weakest raised and the strongest flat dot.
    loudest : how strong a raised dot may be aimed at, in units of full scale; `AS_WISHED`: dots are not aimed beside.
    steepest : largest step up from one actuator to the next, a factor: of steeper ones no way in is quick enough.
    """

    contrast_db: float
    loudest: float
    steepest: float

    @property
    def threshold(self) -> float:
        """From which amplitude on a dot is raised, in units of full scale."""
        return threshold_for(self.contrast_db)


@dataclass(frozen=True)
class ChainTarget:
    """What is wanted of one chain of n; a key of dictionaries.

    Attributes
    ----------
    amplitude : n numbers, in units of full scale.
    turn : radians by which the whole motion is turned.
    """

    amplitude: tuple[float, ...]
    turn: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        # Once: a target is looked up several times in every frame. What else it has is left to ==.
        object.__setattr__(self, "_hash", hash((self.amplitude, self.turn)))

    def __hash__(self) -> int:
        number: int = self.__dict__["_hash"]
        return number

    @cached_property
    def levels(self) -> Floats:
        """The amplitudes as float64, shape (n,), read-only."""
        return _array(self.amplitude)

    @cached_property
    def resting(self) -> bool:
        """Whether nothing is to move."""
        return not any(self.amplitude)

    @property
    def unturned(self) -> Self:
        """The same but for its turn: rows of a plane wave share it."""
        return replace(self, turn=0.0) if self.turn else self

    def turned(self, turn: float) -> Self:
        """The same with another turn; rest has none."""
        return self if self.resting or turn == self.turn else replace(self, turn=turn)

    def under(self, lam: float) -> Self:
        """The same, with a lam that other chains give; amplitudes at will are made with any."""
        return self

    @cached_property
    def key(self) -> bytes:
        """The target in bytes, for a cache on disk."""
        return repr(self).encode()


@dataclass(frozen=True)
class AmplitudeTarget(ChainTarget):
    """Amplitudes, or deflections; any phases will do. All zero is rest.

    Attributes
    ----------
    dots : they are raised and flat dots, which is all that they are to keep under spread; None: they are levels.
    """

    dots: DotGoal | None = field(default=None, kw_only=True, repr=False)

    __hash__ = ChainTarget.__hash__

    @classmethod
    def of(cls, levels: Floats, turn: float = 0.0, dots: DotGoal | None = None) -> AmplitudeTarget:
        """Of amplitudes in an array of shape (n,); rest is rest, whatever it is for."""
        return _amplitude(levels.tobytes(), turn, dots)

    @cached_property
    def key(self) -> bytes:
        """The target in bytes, for a cache on disk."""
        return repr(self).encode() + (b"" if self.dots is None else repr(self.dots).encode())


@dataclass(frozen=True)
class WaveTarget(ChainTarget):
    """Amplitudes with phases, or amplitudes on a device that cannot make them at will.

    Attributes
    ----------
    phase : n numbers, radians, None where any will do; the first that is given is 0.
    weight : n numbers, 0 = don't care.
    lam : of every link, given by other chains; None where it is free.
    """

    phase: tuple[float | None, ...]
    weight: tuple[float, ...]
    lam: float | None = None

    __hash__ = ChainTarget.__hash__

    @classmethod
    def of(cls, levels: Floats, phases: Floats, weights: Floats, turn: float = 0.0) -> WaveTarget:
        """Of arrays of shape (n,); a phase of NaN is one that does not matter."""
        phase = (None if np.isnan(one) else one for one in phases.tolist())
        return cls(tuple(levels.tolist()), tuple(phase), tuple(weights.tolist()), turn=turn)

    @cached_property
    def phases(self) -> Floats:
        """The phases as float64, shape (n,), NaN where any will do; read-only."""
        return _array(tuple(np.nan if one is None else one for one in self.phase))

    @cached_property
    def weights(self) -> Floats:
        """The weights as float64, shape (n,), read-only."""
        return _array(self.weight)

    def under(self, lam: float) -> WaveTarget:
        """The same wave over links of a given lam."""
        return replace(self, lam=lam)


@dataclass(frozen=True)
class WalkingTarget(ChainTarget):
    """Bars that walk along a chain.

    Attributes
    ----------
    weight : n numbers, 0 = don't care.
    width : of a bar in actuators; None where it follows from the rate.
    rate_hz : bars that pass in a second; None where that follows from the width.
    place : the column of the chain's first actuator.
    lam : of every link, given by other chains; None where it is free.

    Raises
    ------
    ValueError
        When neither a width nor a rate is given.
    """

    weight: tuple[float, ...]
    width: float | None = None
    rate_hz: float | None = None
    place: int = 0
    lam: float | None = None

    __hash__ = ChainTarget.__hash__

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.width is None and self.rate_hz is None:
            raise ValueError("walking bars: expected a width, a rate or both")

    @cached_property
    def weights(self) -> Floats:
        """The weights as float64, shape (n,), read-only."""
        return _array(self.weight)

    def under(self, lam: float) -> WalkingTarget:
        """The same bars over links of a given lam."""
        return replace(self, lam=lam)


@dataclass(frozen=True)
class UnlockedTarget(ChainTarget):
    """A motion that never settles.

    Attributes
    ----------
    depth : of its beats, 0 to 1.
    period_s : of its beats.
    """

    depth: float
    period_s: float

    __hash__ = ChainTarget.__hash__


def _array(numbers: tuple[float, ...]) -> Floats:
    array: Floats = np.array(numbers, dtype=np.float64)
    array.flags.writeable = False
    return array


def targets_of(pattern: TargetPattern, device: Device, dots: DotGoal | None = None) -> Sequence[ChainTarget]:
    """What a pattern wants of every chain of `device`, row by row; `dots` where its amplitudes are dots."""
    n, size = device.chain_length, np.abs(pattern.amplitude)
    weight = None if pattern.weight is None else np.asarray(pattern.weight, dtype=np.float64)
    if pattern.unlocked is not None:
        return [
            UnlockedTarget(tuple(levels.tolist()), pattern.unlocked.depth, pattern.unlocked.period_s)
            if np.any(levels) else AmplitudeTarget.of(levels)
            for levels in size.reshape(-1, n)
        ]  # fmt: skip
    matters = _phases_that_matter(pattern, size, weight)
    if pattern.walking is None and matters is None:
        return _amplitudes(size if weight is None or np.all(weight > 0) else size * (weight > 0), n, dots)
    phase = np.full(size.shape, np.nan) if matters is None else np.where(matters, np.angle(pattern.amplitude), np.nan)
    sizes, phases = size.reshape(-1, n), phase.reshape(-1, n)
    weights = (np.ones(size.shape) if weight is None else weight).reshape(-1, n)
    return [
        _standing(levels, phase, heed)
        if pattern.walking is None or not np.any(levels)
        else _walking(pattern.walking, levels, heed, number % device.chains_per_row * n)
        for number, (levels, phase, heed) in enumerate(zip(sizes, phases, weights, strict=True))
    ]


def _walking(bars: WalkingBars, levels: Floats, weights: Floats, place: int) -> WalkingTarget:
    width, rate_hz = (None if np.isnan(one) else float(one) for one in (bars.width, bars.rate_hz))
    return WalkingTarget(tuple(levels.tolist()), tuple(weights.tolist()), width, rate_hz, place)


def _phases_that_matter(pattern: TargetPattern, size: Floats, weight: Floats | None) -> NDArray[np.bool_] | None:
    """Where phases are part of the wish; None where they are nowhere."""
    if not pattern.phase_matters:
        return None
    matters = size > 0
    if weight is not None:
        matters &= weight > 0
    if pattern.any_phase is not None:
        matters &= ~pattern.any_phase
    return matters if matters.any() else None


def _amplitudes(size: Floats, n: int, dots: DotGoal | None) -> list[AmplitudeTarget]:
    raw, step = size.tobytes(), n * size.itemsize
    return [_amplitude(raw[at : at + step], 0.0, dots) for at in range(0, len(raw), step)]


@lru_cache(maxsize=MOST_AMPLITUDES)
def _amplitude(levels: bytes, turn: float, dots: DotGoal | None) -> AmplitudeTarget:
    """One object for equal rows: a dictionary finds what is the same object without comparing it."""
    array = np.frombuffer(levels)
    return AmplitudeTarget(tuple(array.tolist()), turn=turn, dots=dots if np.any(array) else None)


def _standing(levels: Floats, phases: Floats, weights: Floats) -> ChainTarget:
    """What does not walk: a wave where several phases matter, else amplitudes."""
    phased = np.flatnonzero(~np.isnan(phases))
    turn = float(phases[phased[0]]) if len(phased) else 0.0
    if len(levels) == 1 or not len(phased):
        return AmplitudeTarget.of(levels if np.all(weights > 0) else levels * (weights > 0), turn)
    straight = np.round(np.remainder(phases - turn + np.pi, 2 * np.pi) - np.pi, PHASE_DECIMALS)
    # Half a turn one way is half a turn the other way.
    straight = np.where(straight <= -np.round(np.pi, PHASE_DECIMALS), -straight, straight)
    return WaveTarget.of(np.round(levels, AMPLITUDE_DECIMALS), straight + 0.0, weights, turn)
