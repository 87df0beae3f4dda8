"""The settings nearest to a wave: closed forms, refined, each link for itself where that helps, rounded to steps."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome

from ..closed_forms.nearest import nearest_geometric
from ..closed_forms.wave_fit import FittedPoint, Freedom, MotionTarget, fit
from ..operating_point import OperatingPoint
from ..targets import WaveTarget
from .search import search
from .wave_forms import lag_and_ratio, wave_for, wave_on

__all__ = ["GOOD", "WaveFit"]

# What is asked of the settled motion, relative to its largest amplitude; the way in may take as much again.
GOOD = 5e-4
# A wave whose lag is nearer to 0 or 180 degrees than this has no settings in practice.
LEAST_LAG = math.radians(1.0)
# Where any phases will do, the lags tried: at the first the branches of a chain lie farthest apart.
FREE_LAGS = tuple(math.radians(degrees) for degrees in (120.0, 90.0, 150.0))
# Amplitudes below this part of the largest, and ratios below it, count as 0 in a first guess.
LEAST_PART = 1e-3
# Farther than this from a shape that can be made, relative to the largest amplitude, no refinement makes it.
FAR = 0.2
# Halvings in the search for the largest share of the target that stands.
HALVINGS = 5


@dataclass(frozen=True)
class _Guess:
    """Settings to begin with, and the phasors they are meant for."""

    point: OperatingPoint
    wanted: MotionTarget


@dataclass(frozen=True)
class WaveFit:
    """The task for one target on one device."""

    device: Device
    target: WaveTarget

    @cached_property
    def scale(self) -> float:
        """The largest amplitude wanted, dimensionless."""
        return float(self.target.levels.max()) * self.device.full_scale

    @cached_property
    def phased(self) -> NDArray[np.bool_]:
        """Where a phase is wanted."""
        return np.asarray(~np.isnan(self.target.phases))

    @cached_property
    def backwards(self) -> bool:
        """Whether the wanted wave runs towards the drive, or stands."""
        several = int(np.count_nonzero(self.phased)) > 1
        return several and not 0 < lag_and_ratio(self.wanted(1.0).phasor * self.phased)[0] < math.pi

    @cached_property
    def jagged(self) -> bool:
        """Whether amplitudes alone are wanted that are far from any one lam can make."""
        if np.count_nonzero(self.phased) > 1 or self.device.coupling.scope == "link":
            return False
        wanted = np.abs(self.wanted(1.0).phasor)
        first, ratio = nearest_geometric(self.device, wanted, self.scale)
        away = np.abs(first * ratio ** np.arange(len(wanted)) - wanted) * self.target.weights
        return bool(away.max() > FAR * self.scale)

    @cached_property
    def freedom(self) -> Freedom:
        """One lam for the chain, or a given one."""
        coupling, omega = self.device.coupling, self.device.omega
        given = self.target.lam is not None or coupling.lam.min == coupling.lam.max
        return Freedom(0 if given else 1, coupling.lam.min, coupling.lam.max, omega.min, omega.max)

    def wanted(self, share: float) -> MotionTarget:
        """`share` of the target."""
        phasor = share * self.target.levels * self.device.full_scale * np.exp(1j * np.nan_to_num(self.target.phases))
        return MotionTarget(phasor, self.phased, self.target.weights)

    def stands(self, found: FittedPoint) -> bool:
        """Whether settings hold what they are meant for, and it is stable."""
        return found.outcome is Outcome.OK and found.error <= GOOD * self.scale

    def best(self, share: float) -> FittedPoint:
        """The nearest found for `share` of the target."""
        wanted, freedom, chain = self.wanted(share), self.freedom, self.device.chain
        guesses = self._guesses(wanted)
        if self.backwards or self.jagged:
            still = replace(freedom, lam=0, omega=False)
            return self._least([fit(chain, guess.wanted, guess.point, still) for guess in guesses], wanted)
        tries: list[FittedPoint] = []
        for guess in guesses:
            tries.append(self._rounded(fit(chain, guess.wanted, guess.point, freedom), guess.wanted, freedom))
            if self.stands(self._least(tries, wanted)):
                break
        found = self._least(tries, wanted)
        if not self.stands(found) and guesses[0].wanted is not wanted and np.isfinite(found.error):
            freer = fit(chain, wanted, found.point, freedom)
            found = self._least([found, self._rounded(freer, wanted, freedom)], wanted)
        if not self.stands(found) and self.device.coupling.scope == "link" and self.target.lam is None:
            found = self._least([found, *self._link_by_link(found, wanted)], wanted)
        return found

    def lower(self) -> tuple[float, FittedPoint] | None:
        """The largest share of the target found to stand, and its settings; None where none does."""
        good, bad, kept = 0.0, 1.0, None
        for _ in range(HALVINGS):
            middle = (good + bad) / 2
            found = self.best(middle)
            if found.outcome is Outcome.OK and found.error <= GOOD * middle * self.scale:
                good, kept = middle, found
            else:
                bad = middle
        return None if kept is None else (good, kept)

    def _least(self, found: list[FittedPoint], wanted: MotionTarget) -> FittedPoint:
        """The first that stands, else that with the least error."""
        real = [replace(one, error=wanted.error(one.phasor)) if np.isfinite(one.error) else one for one in found]
        return next((one for one in real if self.stands(one)), min(real, key=lambda one: one.error))

    def _link_by_link(self, found: FittedPoint, wanted: MotionTarget) -> list[FittedPoint]:
        """Every link for itself: from what was found for them all, and from a search."""
        each, chain = replace(self.freedom, lam=self.device.chain_length - 1), self.device.chain
        # Behind the last actuator that is to move, nothing is passed on.
        passing = np.arange(chain.n - 1) < int(np.flatnonzero(wanted.phasor)[-1])
        starts = [replace(found.point, lam=np.where(passing, found.point.lam, each.lam_min))]
        starts = starts if np.isfinite(found.error) else []
        tries = [fit(chain, wanted, start, each) for start in starts]
        if not any(self.stands(one) for one in tries) and chain.feed_forward:
            tries += [fit(chain, wanted, start, each) for start in search(chain, wanted, each)]
        return [self._rounded(one, wanted, each) for one in tries]

    def _rounded(self, found: FittedPoint, wanted: MotionTarget, freedom: Freedom) -> FittedPoint:
        """With every lam one that can be set, drive and frequency refitted."""
        coupling = self.device.coupling
        if not coupling.lam_step or not freedom.lam or not np.isfinite(found.error):
            return found
        steps = np.rint((found.point.lam - coupling.lam.min) / coupling.lam_step)
        point = replace(found.point, lam=coupling.lam.min + coupling.lam_step * steps)
        return fit(self.device.chain, wanted, point, replace(freedom, lam=0))

    def _guesses(self, wanted: MotionTarget) -> list[_Guess]:
        """From the closed forms; where phases are free they are given, because a valley is slow to walk along."""
        chain, most = self.device.chain, self.freedom.lam_max
        if np.count_nonzero(self.phased) > 1:
            sounding = (wanted.phasor * self.phased)[: int(np.flatnonzero(self.phased)[-1]) + 1]
            lag, ratio = lag_and_ratio(sounding)
            least = max(LEAST_LAG, math.asin(min(1.0, 1.02 * chain.delta / most)) if most else math.pi / 2)
            # Towards the drive nothing travels: the wave nearest to that stands nearly still.
            lag = float(np.clip(lag, least, math.pi - least))
            waves = self._waves(abs(wanted.phasor[0]), ratio, (lag,))
            if not self.backwards:
                return [_Guess(wave, wanted) for wave in waves]
        else:
            first, ratio = nearest_geometric(self.device, np.abs(wanted.phasor), wanted.scale)
            waves = self._waves(first, ratio, FREE_LAGS)
        return [self._own(wave, ratio, wanted) for wave in waves]

    def _own(self, wave: OperatingPoint, ratio: float, wanted: MotionTarget) -> _Guess:
        """A wave as it is wanted: its own phases, and its own amplitudes."""
        chain, lam = self.device.chain, float(wave.lam[0])
        stage = lam / complex(1 - wave.omega**2 + 0.75 * chain.beta * wanted.scale**2 + lam, chain.delta * wave.omega)
        first = wanted.phasor[np.argmax(np.abs(wanted.phasor))]
        lags = np.exp(1j * np.angle(stage) * np.arange(chain.n)) if stage else np.ones(chain.n)
        size = np.abs(wanted.phasor)
        if self.jagged:
            geometric = nearest_geometric(self.device, size, wanted.scale)
            size = geometric.first * geometric.ratio ** np.arange(chain.n)
        shape = size * lags * np.exp(1j * np.angle(first))
        return _Guess(wave, MotionTarget(shape, np.ones(chain.n, dtype=np.bool_), wanted.weight))

    def _waves(self, first: float, ratio: float, lags: tuple[float, ...]) -> list[OperatingPoint]:
        chain, amplitude = self.device.chain, max(first, LEAST_PART * self.scale)
        if self.freedom.lam:
            ratio = ratio if ratio > LEAST_PART else 0.0
            return [wave_for(chain, amplitude=amplitude, lag=lag, ratio=ratio) for lag in lags]
        given = self.device.coupling.lam.min if self.target.lam is None else self.target.lam
        found = [wave_on(chain, amplitude=amplitude, lam=given, long=long) for long in (True, False)]
        return [wave for wave in found if wave is not None] or [
            replace(wave_for(chain, amplitude=amplitude, lag=math.pi / 2), lam=np.full(chain.n - 1, given))
        ]
