"""What every family of patterns supplies on a device."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome

from .operating_point import OperatingPoint
from .plan import Ramp
from .targets import AmplitudeTarget, ChainTarget

__all__ = ["AmplitudeFamily", "PatternFamily", "RisingFamily"]

Floats = NDArray[np.float64]


class PatternFamily(ABC):
    """How patterns of one family are held, reached, left and judged on one device. The guide to writing another.

    A newcomer supplies `points`, what chains are driven at for its targets, each judged (error, margins, outcome, and
    one clause on what the device lacks), and `ramps`, how chains get from one point to another; both for many chains at
    once, pure functions of their arguments, so that their results can be kept. `held` says which target a chain really
    holds for what is wanted of it. One line of `families.FAMILIES` then says which targets of which devices it makes.

    Attributes
    ----------
    changes : whether `ramps` lead from any of its points to any other; else one of the two is always rest.
    """

    changes: ClassVar[bool] = False

    def __init__(self, device: Device) -> None:
        self.device = device

    @classmethod
    def of(
        cls, device: Device, contrast_db: float, kinds: Sequence[Device] = (), whole: PatternFamily | None = None
    ) -> Self:
        """The family on a device; see `families.family_of` for what else it may heed."""
        return cls(device)

    def held(self, target: ChainTarget, started: bool) -> ChainTarget:
        """The target a chain really holds for a wanted one; `started`: amplitudes are held, and it is not at rest."""
        return target

    @abstractmethod
    def points(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        """What chains are driven at for targets that are not turned."""

    @abstractmethod
    def ramps(
        self,
        before: Sequence[OperatingPoint],
        after: Sequence[OperatingPoint],
        moves: bool = True,
        length_s: float | None = None,
    ) -> list[Ramp | None]:
        """How chains get from point to point; None where nothing has to change, or what is wanted cannot be held.

        `moves` : whether lam may differ on the way from both ends.
        `length_s` : seconds that every way lasts, on which levels go as `encoders.crossing` says; None: as quick as is
        safe. Only asked where `changes`.
        """

    def note(self) -> str:
        """One sentence on what the device lacks where an unreachable point does not say it."""
        return ""


class AmplitudeFamily(PatternFamily):
    """Amplitudes or deflections at will: any pattern of them changes into any other."""

    changes = True

    @property
    @abstractmethod
    def ramp_s(self) -> float:
        """Longest ramp in seconds."""

    @property
    def shortest_s(self) -> float:
        """Shortest way in seconds from one pattern to the next where patterns travel."""
        return self.ramp_s

    @abstractmethod
    def states(self, targets: Floats) -> list[OperatingPoint]:
        """The points for amplitudes `targets`, float64, shape (P, n), in units of full scale."""

    def levels(self, target: Floats, started: bool) -> Floats:
        """The amplitudes a chain really holds for wanted ones of shape (n,), as `held`."""
        return target

    def held(self, target: ChainTarget, started: bool) -> ChainTarget:
        """The amplitudes that `levels` gives."""
        dots = target.dots if isinstance(target, AmplitudeTarget) else None
        return AmplitudeTarget.of(self.levels(target.levels, started), dots=dots)

    def points(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        """All of them in one array."""
        return self.states(np.array([target.amplitude for target in targets]))


class RisingFamily(PatternFamily):
    """Patterns that rise from rest and fall to rest; between two of them a chain rests."""

    @abstractmethod
    def enter(self, point: OperatingPoint, moves: bool) -> Ramp:
        """From rest to a point."""

    @abstractmethod
    def leave(self, point: OperatingPoint, moves: bool) -> Ramp:
        """From a point to rest, the drive among the ramp's tones."""

    def ramps(
        self,
        before: Sequence[OperatingPoint],
        after: Sequence[OperatingPoint],
        moves: bool = True,
        length_s: float | None = None,
    ) -> list[Ramp | None]:
        """One by one."""
        return [self._ramp(one, other, moves) for one, other in zip(before, after, strict=True)]

    def _ramp(self, before: OperatingPoint, after: OperatingPoint, moves: bool) -> Ramp | None:
        point = before if after.resting else after
        # What cannot be held is not played.
        if point.outcome is not Outcome.OK or not point.epsilon:
            return None
        return self.leave(point, moves) if after.resting else self.enter(point, moves)
