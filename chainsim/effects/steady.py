"""The steady state of a chain with extra terms: integrated from rest until it repeats, then with ever shorter steps."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..averaging.settle import strongest_line
from ..equations.chain import Chain, Setting
from ..model.response import Outcome, Stats
from ..rung import RungError, Start
from .effects import Terms, Tone
from .lines import Lines
from .ode import Walk

__all__ = ["Beat", "Drift", "Steady", "steady_with_terms"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

FIRST_STEP = 0.1  # Phase of the fastest rate in the first steps.
SHARE = 0.1  # Of the tolerance, for what is left of the transient.
SAFETY = 2.0
DRIFTS = 1e-5  # Relative change between two looks that is motion and not the tail of a decay.
STAYS = 0.98  # Share of the change that must be left over a quarter of the looks.
LARGE = 1e-2  # Change below which a motion is given four times as long: near a threshold decays are slow.
MOST_LOOKS = 600
MOST_EVALS = 240_000_000  # Of one oscillator; about ten seconds.
HALVINGS = 8
RAMP = 100.0  # Length of a ramp, in units of 1/delta.
BEAT_PERIODS = 4096
BEATS = 32  # Looks over which a beat is measured,
WINDOWS = 5  # at most so often,
STEADY = 3e-3  # until its frequency changes by less than this.
MOST_SAMPLES = 50_000
CALM = 1e-2  # Relative change between two looks below which creep is taken to its end.


@dataclass(frozen=True)
class Beat:
    """A motion that does not lock.

    omega : radians per tau, of the strongest line beside the drive's, less the drive's. depth : float64, shape (n,),
    (largest - smallest)/largest amplitude. phasor : complex128, shape (n,), the part that does follow the drive.
    """

    omega: float
    depth: Floats
    phasor: Complexes


@dataclass(frozen=True)
class Drift:
    """How creep moves what is reached.

    tau : float64, shape (K,). mean, amplitude : float64, shape (K, n), of the first line.
    """

    tau: Floats
    mean: Floats
    amplitude: Floats


@dataclass(frozen=True)
class Steady:
    """The steady state of one setting.

    Attributes
    ----------
    outcome : ok, or why there is none.
    rung : which solver answered.
    lines : the frequencies.
    amplitude : complex128, shape (L, n), NaN where unknown.
    mean : float64, shape (n,).
    error_estimate : relative to the largest amplitude or mean.
    stable : whether the motion was reached; None where that was not looked at.
    beat : where it does not lock.
    drift : where creep is on and its end was within the budget.
    """

    outcome: Outcome
    rung: str
    lines: Lines
    amplitude: Complexes
    mean: Floats
    error_estimate: float
    stable: bool | None
    beat: Beat | None
    drift: Drift | None
    stats: Stats


def steady_with_terms(chain: Chain, setting: Setting, terms: Terms, *, tol: float, start: Start) -> Steady:
    """Integrate one setting until what repeats is known to `tol`.

    With creep it is the limit of long times, all its relaxations done, and `drift` is the way there up to the creep's
    `last`.

    Parameters
    ----------
    tol : relative to the largest amplitude.
    start : rest, or ramp (the drive is raised within 100/delta).

    Raises
    ------
    RungError
        Without damping, or for start all.
    TermsError
        When `setting` is not one setting of `chain`.
    """
    if start is Start.ALL:
        raise RungError("rung ode: it follows one way in, not every branch; use start rest or ramp")
    slowest = min(float(chain.deltas.min()), *(mode.delta for mode in terms.modes or ()), math.inf)
    if not slowest > 0:
        raise RungError("rung ode: without damping nothing settles; give delta > 0 to every oscillator and mode")
    began = time.perf_counter()
    with np.errstate(all="ignore"):
        run = _Run(chain, setting, terms, slowest, start)
        run.solve(tol)
        return run.steady(tol, time.perf_counter() - began)


class _Run:
    """One call of `steady_with_terms`."""

    def __init__(self, chain: Chain, setting: Setting, terms: Terms, slowest: float, start: Start) -> None:
        one = Tone(float(setting.epsilon[0]), float(setting.omega[0]))
        ramp = RAMP / slowest if start is Start.RAMP else 0.0
        self.walk = Walk(chain, setting, terms, ramp=ramp)
        self.lines = Lines.of(terms.tones or (one,))
        self.window = self.lines.window
        self.creep = terms.creep
        # Where the plays have corners and the amplifier its limits, errors fall with the second order only.
        amplifier = terms.amplifier
        rough = amplifier is not None and math.isfinite(min(amplifier.slew, amplifier.limit))
        self.order = 2 if rough or terms.hysteresis is not None else 4
        self.bounded = bool((chain.betas >= 0).all())
        bandwidth = math.inf if amplifier is None else amplifier.bandwidth
        self.look = max(1, math.ceil(max(2 / slowest, 1 / bandwidth) / self.window.length))
        self.ramp_looks = math.ceil(ramp / (self.look * self.window.length))
        self.several = self.lines.index.shape[1] > 1
        # Fed forward, beats that stay are rare, and what looks like one may be a slow passage by the ghost of a fold.
        longer = 3 if chain.feed_forward and not self.several else 1
        self.patience = (20 + 4 * chain.n) * longer + self.ramp_looks
        self.every = max(1, math.ceil(self.window.length / self.window.count * self.walk.fastest / FIRST_STEP))
        self.reader = self.window.reader() if self.window.count <= MOST_SAMPLES else np.empty((0, 0))
        shape = len(self.lines.omega), chain.n
        self.amplitude, self.mean = np.full(shape, np.nan, dtype=np.complex128), np.full(chain.n, np.nan)
        self.error, self.outcome = math.inf, Outcome.OUT_OF_BUDGET
        self.beat: Beat | None = None
        self.drift: Drift | None = None

    def solve(self, tol: float) -> None:
        """Settle, then halve the steps until that moves the answer by less than `tol`."""
        if not self.reader.size:
            return
        if self.creep is not None and not self._follow_creep(self.creep.last):
            return
        left = self._settle(SHARE * tol)
        if self._is(Outcome.NOT_LOCKED):
            self.beat = self._beats()
        for _ in range(HALVINGS):
            if not self._is(Outcome.OK) or self.error <= tol:
                return
            mean, amplitude = self.mean, self.amplitude
            self.every *= 2
            left = self._settle(SHARE * tol)
            if self._is(Outcome.OUT_OF_BUDGET):
                # What the longer steps have reached stands, at the error it is known to have.
                self.mean, self.amplitude, self.outcome = mean, amplitude, Outcome.OK
                return
            if not self._is(Outcome.OK):
                return
            moved = _change(_whole(mean, amplitude), _whole(self.mean, self.amplitude))
            self.error = SAFETY * (moved / (2**self.order - 1) + left)
            if SAFETY * left > tol:
                return

    def steady(self, tol: float, seconds: float) -> Steady:
        """The result."""
        known = self.outcome is Outcome.OK and math.isfinite(self.error)
        outcome = Outcome.OUT_OF_BUDGET if self.outcome is Outcome.OK and not self.error <= tol else self.outcome
        stats = Stats(rhs_evals=self.walk.evals, seconds=seconds)
        amplitude, mean = (self.amplitude, self.mean) if known else (self.amplitude * np.nan, self.mean * np.nan)
        for array in (amplitude, mean):
            array.flags.writeable = False
        error = self.error if known else math.inf
        return Steady(outcome, "ode", self.lines, amplitude, mean, error, known, self.beat, self.drift, stats)

    def _is(self, outcome: Outcome) -> bool:
        return self.outcome is outcome

    def _go(self, windows: int) -> bool:
        """Move on by whole windows and read the last; False where the budget is spent or the motion has escaped."""
        h = self.window.length / (self.window.count * self.every)
        n = len(self.walk.plant.lam)
        if self.walk.evals + 4 * windows * self.window.count * self.every * n > MOST_EVALS:
            self.outcome = Outcome.OUT_OF_BUDGET
            return False
        if windows > 1 and not len(self.walk.go(1, (windows - 1) * self.window.count * self.every, h)):
            return self._gone()
        begin = self.walk.tau
        tip = self.walk.go(self.window.count, self.every, h)
        if len(tip) < self.window.count:
            return self._gone()
        self.mean, self.amplitude = self.window.read(self.reader, begin, tip)
        return True

    def _gone(self) -> bool:
        # What cannot run away has outrun the steps.
        self.outcome = Outcome.NO_CONVERGENCE if self.bounded else Outcome.ESCAPED
        return False

    def _settle(self, goal: float) -> float:
        """Look until what is left of the transient is below `goal`; what is left, relative."""
        last, before, changes = None, math.inf, []
        for look in range(MOST_LOOKS):
            creeping = self.walk.relaxed.copy()
            if not self._go(self.look):
                return math.inf
            here = _whole(self.mean, self.amplitude)
            change = math.inf if last is None else _change(last, here)
            changes.append(change)
            ratio = min(max(change / before if before else 0.0, 0.3), 1.0)
            left = change * ratio / (1 - ratio) if ratio < 1 else math.inf
            if look >= max(2, self.ramp_looks + 2) and (change == 0 or (left <= goal and changes[-2] <= 20 * goal)):
                self.outcome = Outcome.OK
                return 0.0 if change == 0 else left
            if look >= self.patience and self._recurrent(changes):
                # A small change that stays is of mixtures of the tones which are not among the lines.
                self.outcome = Outcome.OK if self.several and change <= LARGE else Outcome.NOT_LOCKED
                return max(changes[-len(changes) // 4 :])
            if self.creep is not None and change < CALM:
                self._finish_creep(creeping)
            last, before = here, change
        self.outcome = Outcome.OUT_OF_BUDGET
        return math.inf

    def _recurrent(self, changes: list[float]) -> bool:
        """Whether the change between looks is real and does not fall."""
        quarter = len(changes) // 4
        now, then = max(changes[-quarter:]), max(changes[-2 * quarter : -quarter])
        patient = self.several or now > LARGE or len(changes) > 4 * self.patience
        return patient and (self.several or now > DRIFTS) and now > STAYS * then

    def _finish_creep(self, before: Floats) -> None:
        """Put every slow relaxation where its force of the last look would take it in the end."""
        rate = self.walk.plant.creep
        kept = np.exp(-rate * self.look * self.window.length)
        slow = kept > math.exp(-1)
        ends = (self.walk.relaxed - kept * before) / (1 - kept)
        self.walk.relaxed[:, slow] = ends[:, slow]

    def _follow_creep(self, last: float) -> bool:
        """Note mean and amplitude twice a decade up to `last`, where the budget allows; False where it escapes."""
        length, n = self.window.length, len(self.walk.plant.lam)
        if 4 * last / length * self.window.count * self.every * n > MOST_EVALS / 2:
            return True
        marks = np.unique(np.ceil(last * 10.0 ** (0.5 * np.arange(-24, 1)) / length)).astype(int)
        rows, done = [], 0
        for mark in marks[marks > 1]:
            if not self._go(int(mark) - done):
                return False
            done = int(mark)
            rows.append((self.walk.tau, self.mean, np.abs(self.amplitude[0])))
        if rows:
            tau, mean, amplitude = (np.array(each) for each in zip(*rows, strict=True))
            self.drift = Drift(tau, mean, amplitude)
        return True

    def _beats(self) -> Beat | None:
        """Demodulate the one tone until beat and depth stay what they are."""
        beat = None
        for _ in range(0 if self.several else WINDOWS):
            last, found = beat, []
            for _ in range(min(BEAT_PERIODS, BEATS * self.look)):
                if not self._go(1):
                    self.outcome = Outcome.NOT_LOCKED
                    return last
                found.append(self.amplitude[0])
            beat = _beat_of(np.array(found), self.window.length)
            if last is not None and abs(beat.omega - last.omega) <= STEADY * abs(beat.omega):
                break
        return beat


def _beat_of(samples: Complexes, step: float) -> Beat:
    """Depth, strongest line and what follows the drive of amplitudes (K, n) taken every `step`."""
    size = np.abs(samples)
    depth = np.ptp(size, axis=0) / np.maximum(size.max(axis=0), 1e-300)
    window = np.hanning(len(samples) + 2)[1:-1]
    beat = strongest_line(samples[:, int(depth.argmax())], step)
    return Beat(beat, depth, window @ samples / window.sum())


def _whole(mean: Floats, amplitude: Complexes) -> Complexes:
    return np.concatenate([mean[None], amplitude])


def _change(a: Complexes, b: Complexes) -> float:
    """Largest difference over the largest entry of `b`; 0 for nothing."""
    size = float(np.abs(b).max())
    return float(np.abs(a - b).max()) / size if size > 0 else 0.0
