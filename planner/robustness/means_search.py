"""With which means a scene of dots is planned on a device whose actuators differ: those that most devices keep."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from chainsim import Device, Span
from encoders import Frame

from ..families import row_of
from ..means import Means
from ..outlook import MeansTried
from ..targets import AmplitudeTarget, DotGoal
from ..unequal import memory_of
from ..wish import CONTRAST_LIMIT_DB, FrameWish
from .expected import Expectation

__all__ = ["means_for"]

# Means are chosen by the first pages of a scene, and of frames that are on one page by no more than so many.
PAGES, LOOKED = 6, 36
# How strong raised dots may be aimed at, in units of full scale, and how many decibels steeper a step up from one
# actuator to the next may be than the contrast that is planned with: the ways in take more volts then.
AIMS = ((2.0, 0.0), (2.0, 2.0), (2.0, 4.0), (4.0, 2.0))
# Frequencies that are tried over the whole range of the device.
FREQUENCIES = 5
# Shares of devices nearer to each other than this are the same: of such means the first, which are cheaper, are taken.
SAME = 0.005


@dataclass(frozen=True)
class _Looked:
    """What came of means on the first frames.

    `omega` : the frequency. `share` : of devices that keep all of them. `each` : of devices that keep one, the mean.
    """

    means: Means
    omega: float
    share: float
    each: float

    @property
    def told(self) -> MeansTried:
        dots = self.means.dots
        if dots is None:
            return MeansTried(self.omega, 1.0, None, self.share)
        return MeansTried(self.omega, dots.loudest, round(20 * math.log10(dots.steepest), 6), self.share)


def means_for(
    frames: Iterable[Frame], expected: Expectation, planned_db: float, asked_db: float | None
) -> Means | None:
    """The means under which the largest share of devices keeps the first frames of a scene.

    The plain plan is tried first; the search ends with the first means that reach the share wanted. Means that cannot
    make a frame are out, so that no scene is worse off than without a spread.

    Parameters
    ----------
    frames : of the scene, in order.
    expected : knows the device, and the share of devices that is wanted.
    planned_db : contrast that unraised dots are planned with.
    asked_db : contrast that was asked for, None where nothing was.

    Returns
    -------
    Means, or None where there is nothing to choose: other frames than dots, or another way of holding them.
    """
    first, device, wanted = _first(frames), expected.device, expected.wanted
    wishes = [FrameWish.of(frame, asked_db) for frame in first]
    if row_of(AmplitudeTarget, device).name != "amplitude" or not all(map(_of_dots, first, wishes)):
        return None
    look = _Look(first, wishes, expected)
    plain = look.at(Means(memory_of(device.model_copy(update={"spread": None}), planned_db)))
    tried = [plain]
    if plain.share < wanted:
        needed_db = CONTRAST_LIMIT_DB if asked_db is None else asked_db
        for omega, loudest, steeper_db in _candidates(device, plain.omega):
            at = device.model_copy(update={"omega": Span(min=omega, max=omega)})
            dots = DotGoal(needed_db, loudest, 10 ** ((planned_db + steeper_db) / 20))
            tried.append(look.at(Means(memory_of(at, planned_db), dots)))
            if tried[-1].share >= wanted:
                break
    # Where hardly a device keeps all of the frames, those count that keep one.
    shares = [one.share for one in tried]
    if max(shares) <= SAME:
        shares = [one.each for one in tried]
    best = next(one for one, share in zip(tried, shares, strict=True) if share > max(shares) - SAME)
    return Means(best.means.memory, best.means.dots, tuple(one.told for one in tried), best.share)


def _first(frames: Iterable[Frame]) -> list[Frame]:
    found: dict[bytes, Frame] = {}
    for frame in frames:
        if frame.page >= PAGES or len(found) == LOOKED:
            break
        found.setdefault(frame.pattern.amplitude.tobytes(), frame)
    return list(found.values())


def _of_dots(frame: Frame, wish: FrameWish) -> bool:
    return wish.dots and frame.pattern.walking is None and not frame.pattern.phase_matters


def _candidates(device: Device, omega: float) -> Iterator[tuple[float, float, float]]:
    """Frequencies, and for each what raised dots are aimed by, cheap ones first."""
    yield from ((omega, *aims) for aims in AIMS)
    for other in np.linspace(device.omega.max, device.omega.min, FREQUENCIES).tolist():
        if abs(other - omega) > 1e-9:
            yield other, *AIMS[0]


@dataclass(frozen=True)
class _Look:
    """The first frames of a scene, and what is asked of them."""

    frames: Sequence[Frame]
    wishes: Sequence[FrameWish]
    expected: Expectation

    def at(self, means: Means) -> _Looked:
        """Plan the frames one after another, and judge them."""
        memory, omega = means.memory, means.memory.device.omega.max
        targets, kept = memory.at_rest, []
        for frame, wish in zip(self.frames, self.wishes, strict=True):
            change = means.change(targets, frame)
            if not change.made:
                return _Looked(means, omega, 0.0, 0.0)
            omega = next((state.omega for state in change.states if state.moving), omega)
            targets = change.targets
            kept.append(self.expected.kept(targets, change.states, wish))
        all_kept = np.all(kept, axis=0) if kept else np.ones(1)
        return _Looked(means, omega, float(np.mean(all_kept)), float(np.mean(kept)) if kept else 1.0)
