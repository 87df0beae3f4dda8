"""Which steady state the slow flow reaches, or at what beat it goes on."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..equations.chain import Chain, Setting
from ..model.response import Outcome, Stats
from ..rung import Start
from .envelope import EnvelopeError, slow_refusal
from .fixed import NEWTON_STEPS, fixed_point, rates_at
from .run import FINE, LOOK, Run

__all__ = ["Arrival", "reached"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Lanes = NDArray[np.int64]

NEAR = 1e-3  # Distance from a fixed point, relative to each setting, at which its linearised flow decides.
QUIET = 0.05  # Change between two looks, relative, above which looking for a fixed point is idle.
SAME = 1e-6  # Two fixed points found one after the other are one.
CLOSE = 1e-4  # Distance within which it need not shrink any more: the slaving's own error is below it.
SHRINKS = 0.98  # A decaying distance falls by more between two looks.
MOVES = 1e-5  # Change between two looks, relative, that is motion and not the tail of a decay.
LOOKS = 320  # Looks after which a setting is out of budget.
BEATS = 16  # Looks over which a beat is measured,
WINDOWS = 5  # at most so often,
STEADY = 3e-3  # until its frequency (relative) and its depth change less than this.
STRONGEST = 2.0  # beta a^2 beyond which the slow flow is not true of a hardening chain.
BOUND = 1e150  # An amplitude beyond which a motion without a hilltop has run away.
QUIETEST = 1e-4  # Depth below which a beat is none.
EDGE = 0.86  # Of the hilltop: whether a motion that passed nearer comes back is more than the slow flow knows.


@dataclass(frozen=True)
class Arrival:
    """Where the slow flow of N settings went.

    Attributes
    ----------
    outcome : object array of `Outcome`, shape (N,): ok, not_locked, escaped or out_of_budget.
    phasor : complex128, shape (N, n), the fixed point reached; NaN where none was.
    rates : complex128, shape (N, 2n), eigenvalues of the flow about it per unit of tau; NaN where none was.
    beat : float64, shape (N,), radians per tau, frequency of the strongest line of a motion that does not lock, less
        omega; 0 where it locks, NaN where unknown.
    spread : float64, shape (N,), (largest - smallest) / largest amplitude of the oscillator that beats most; 0 where it
        locks.
    stats : work of the whole batch.
    """

    outcome: NDArray[np.object_]
    phasor: Complexes
    rates: Complexes
    beat: Floats
    spread: Floats
    stats: Stats


def reached(chain: Chain, setting: Setting, *, start: Start | ArrayLike) -> Arrival:
    """Follow the slow flow until it rests at a stable fixed point or is seen to go on for ever.

    Parameters
    ----------
    start : ``rest`` (sudden forces), ``ramp`` (drive raised linearly within 100/delta, constant forces already there),
        or amplitudes, complex128, shape (n,) or (N, n).

    Raises
    ------
    EnvelopeError
        When the slow flow is not true of the system, nothing is damped, or `start` has another shape.
    """
    began = time.perf_counter()
    refusal = slow_refusal(chain, setting) or (
        "" if chain.deltas.min() > 0 else "without damping nothing settles; use follow"
    )
    if refusal:
        raise EnvelopeError(refusal)
    with np.errstate(all="ignore"):
        run = _Settling(chain, setting)
        run.way.begin(start)
        run.settle()
        return run.arrival(time.perf_counter() - began)


class _Settling:
    """One call of `reached`; arrays have the leading axis N."""

    def __init__(self, chain: Chain, setting: Setting) -> None:
        size, n = len(setting), setting.n
        self.way = Run(chain, setting, FINE)
        # A hardening chain leaves no well: what its slow flow runs off to is no motion of it.
        self.bound = bool(chain.betas.min() >= 0 and chain.betas.max() > 0)
        self.outcome = np.empty(size, dtype=object)
        self.outcome.fill(Outcome.OUT_OF_BUDGET)
        if self.way.flow.lean is not None:
            self.outcome[~np.isfinite(self.way.flow.lean.place).all(axis=1)] = Outcome.ESCAPED
        self.phasor = np.full((size, n), np.nan, dtype=np.complex128)
        self.beat, self.spread = np.full(size, np.nan), np.full(size, np.nan)
        self.patience = int(np.ceil((20 + 4 * n) * 2 / LOOK))

    def settle(self) -> None:
        """Look again and again until every setting has its outcome."""
        way, lanes, size = self.way, self.way.payable, len(self.outcome)
        last, gap = np.full_like(self.phasor, np.nan), np.full(size, np.inf)
        changes: list[Floats] = []
        for look in range(LOOKS):
            if not len(lanes):
                return
            before = way.amplitude(lanes)
            way.advance(lanes)
            here = way.amplitude(lanes)
            way.hold(lanes, here, np.abs(here - before) <= QUIET * np.abs(here))
            seen = np.full(size, np.inf)
            seen[lanes] = _apart(before, here)
            changes.append(seen)
            gone = ~(way.peak[lanes] <= np.minimum(way.top[lanes], BOUND)).all(axis=1)
            if not self.bound:
                self.outcome[lanes[gone]] = Outcome.ESCAPED
            # A cubic term as strong as the spring leaves nothing slow: no verdict.
            gone |= way.spent[lanes] | (way.strength(lanes) > STRONGEST)
            lanes, here = lanes[~gone], here[~gone]
            orbit, distance = self._orbits(lanes, here, (seen[lanes] < QUIET) | (look >= self.patience))
            nearing = (_apart(last[lanes], orbit) < SAME) & (distance < np.maximum(SHRINKS * gap[lanes], CLOSE))
            done = nearing & (distance < NEAR)
            told = done & (way.peak[lanes] <= EDGE * way.top[lanes]).all(axis=1)
            self.outcome[lanes[told]], self.phasor[lanes[told]] = Outcome.OK, orbit[told]
            self.beat[lanes[told]] = self.spread[lanes[told]] = 0.0
            last[lanes], gap[lanes] = orbit, distance
            lost = np.zeros(len(lanes), dtype=bool)
            if look >= self.patience:
                lost = ~done & ~nearing & self._recurrent(changes, lanes, np.isfinite(distance))
                lost[lost] = self._note_beats(lanes[lost])
            lanes = lanes[~done & ~lost]

    def arrival(self, seconds: float) -> Arrival:
        """The result; arrays read-only."""
        rates = rates_at(self.way.flow, self.phasor)
        for array in (self.outcome, self.phasor, rates, self.beat, self.spread):
            array.flags.writeable = False
        work = Stats(rhs_evals=self.way.evals, seconds=seconds)
        return Arrival(self.outcome, self.phasor, rates, self.beat, self.spread, work)

    def _orbits(self, lanes: Lanes, here: Complexes, asked: NDArray[np.bool_]) -> tuple[Complexes, Floats]:
        """The fixed points beside the amplitudes `here`, and how far they are: inf where none is stable or `asked`."""
        orbit, distance = np.full_like(here, np.nan), np.full(len(lanes), np.inf)
        if asked.any():
            flow = self.way.flow.pick(lanes[asked])
            found, known = fixed_point(flow, self.way.drive[lanes[asked]], here[asked], most=NEWTON_STEPS)
            stable = known & (rates_at(flow, found).real.max(axis=1) < 0)
            orbit[asked], distance[asked] = found, np.where(stable, _apart(here[asked], found), np.inf)
        return orbit, distance

    def _recurrent(self, changes: list[Floats], lanes: Lanes, hope: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Whether the change between looks is real and does not fall: where a stable fixed point gives `hope`, not at
        all, else not to the half.
        """
        late = len(changes) // 4
        now: Floats = np.array(changes[-late:])[:, lanes].max(axis=0)
        then: Floats = np.array(changes[-2 * late : -late])[:, lanes].max(axis=0)
        floor = np.maximum(np.where(hope, SHRINKS, 0.5) * then, MOVES)
        moves: NDArray[np.bool_] = now > floor
        return moves

    def _note_beats(self, asked: Lanes) -> NDArray[np.bool_]:
        """Follow what does not lock until its strongest line stays what it is from one window to the next.

        Returns which of them do beat: a long wait at a fold that a stage has just passed looks like motion too.
        """
        steps = self.way.steps
        # Enough samples for the line to be seen, as many in every window.
        steps[asked] = np.maximum(steps[asked], 16)
        for count in np.unique(steps[asked]):
            lanes = asked[steps[asked] == count]
            for _ in range(WINDOWS):
                if len(lanes):
                    lanes = self._window(lanes)
        beats = self.spread[asked] > QUIETEST
        self.outcome[asked[beats]] = Outcome.NOT_LOCKED
        self.beat[asked[~beats]] = self.spread[asked[~beats]] = np.nan
        return np.asarray(beats)

    def _window(self, lanes: Lanes) -> Lanes:
        """Measure the beats of `lanes` once more; returns those that are not yet what they were."""
        samples = self.way.samples(lanes, BEATS)
        h = self.way.look / float(self.way.steps[lanes[0]])
        size = np.abs(samples)
        spread = np.ptp(size, axis=0) / size.max(axis=0)
        most = spread.argmax(axis=1)
        deep = spread[np.arange(len(lanes)), most]
        beat = np.array([strongest_line(samples[:, at, m], h) for at, m in enumerate(most)])
        same = np.abs(beat - self.beat[lanes]) <= STEADY * np.abs(beat)
        same &= np.abs(deep - self.spread[lanes]) <= STEADY
        self.beat[lanes], self.spread[lanes] = beat, deep
        again: Lanes = lanes[~same & (deep > QUIETEST)]
        return again


def strongest_line(samples: Complexes, h: float) -> float:
    """Angular frequency of the strongest line of `samples` (K,), taken every `h`, less its mean; in radians per tau.

    A Hann window and a Gaussian through the three highest bins: good to about 1e-3 of a bin.
    """
    count = len(samples)
    window = np.hanning(count + 2)[1:-1]
    level = samples - (window @ samples) / window.sum()
    power = np.abs(np.fft.fft(window * level, 4 * count)) + 1e-300
    top = int(power.argmax())
    left, mid, right = (np.log(power[(top + k) % len(power)]) for k in (-1, 0, 1))
    bend = left - 2 * mid + right
    place = top + (0.5 * (left - right) / bend if bend else 0.0)
    cycles = (place / len(power) + 0.5) % 1.0 - 0.5
    return float(2 * np.pi * cycles / h)


def _apart(a: Complexes, b: Complexes) -> Floats:
    """Distance relative to each setting's own largest amplitude, worst oscillator, shape (N,); NaN becomes inf."""
    size = np.maximum(np.abs(b).max(axis=1, initial=0.0), 1e-300)
    distance = np.abs(a - b).max(axis=1, initial=0.0) / size
    return np.where(np.isfinite(distance), distance, np.inf)
