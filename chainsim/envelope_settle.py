"""Which steady state the slow flow reaches, or at what beat it goes on."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .chain import Chain, Setting
from .envelope import EnvelopeError, hilltop, slow_refusal
from .envelope_flow import SlowFlow, Steps, fixed_point, pick, rates_at
from .response import Outcome, Stats
from .rung import Start

__all__ = ["Arrival", "reached"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Lanes = NDArray[np.int64]

ORDER = 2
# Phase of the fastest slow rate in one step: the steps only have to find the basin, Newton finds the steady state.
STEP = 0.4
LOOK = 4.0  # Time between two looks, in units of 1/delta: two e-folds.
NEAR = 1e-3  # Distance from a fixed point, relative to each oscillator, at which its linearised flow decides.
SAME = 1e-6  # Two fixed points found one after the other are one.
CLOSE = 1e-4  # Distance within which it need not shrink any more: the slaving's own error is below it.
SHRINKS = 0.98  # A decaying distance falls by more between two looks.
MOVES = 1e-5  # Change between two looks, relative, that is motion and not the tail of a decay.
MOST_STEPS = 8000  # Steps between two looks; a setting that needs more is out of budget at once.
LOOKS = 160  # Looks after which a setting is out of budget.
BEATS = 8  # Looks over which a beat is measured,
WINDOWS = 5  # at most so often,
STEADY = 3e-3  # until its frequency (relative) and its depth change less than this.
QUIET = 1e-4  # Depth below which a beat is none.
RAMP = 100.0  # Length of the ramp, in units of 1/delta.


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
    start : ``rest`` (sudden drive), ``ramp`` (drive raised linearly within 100/delta), or amplitudes, complex128, shape
        (n,) or (N, n).

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
        run = _Run(chain, setting)
        run.begin(start)
        run.settle()
        return run.arrival(time.perf_counter() - began)


class _Run:
    """One call of `reached`; arrays have the leading axis N."""

    def __init__(self, chain: Chain, setting: Setting) -> None:
        size, n = len(setting), setting.n
        self.flow = SlowFlow.of(chain, setting, setting.lam, ORDER)
        self.drive = setting.epsilon * np.exp(1j * setting.phase)
        self.top = hilltop(chain, setting.lam)
        fastest = np.abs(self.flow.rate) + np.abs(self.flow.weight) * np.abs(setting.lam) + _bend(chain, setting)
        look = LOOK / float(chain.deltas.min())
        needed = np.nan_to_num(np.ceil(look * fastest.max(axis=1) / STEP), nan=np.inf)
        self.payable = np.flatnonzero(needed <= MOST_STEPS)
        self.count = int(max(8, needed[self.payable].max(initial=0)))
        self.h = look / self.count
        self.steps = Steps.of(self.flow.rate, np.full((size, 1), self.h))
        self.slow = np.zeros((size, n), dtype=np.complex128)
        self.outcome = np.empty(size, dtype=object)
        self.outcome.fill(Outcome.OUT_OF_BUDGET)
        self.phasor = np.full((size, n), np.nan, dtype=np.complex128)
        self.beat, self.spread = np.full(size, np.nan), np.full(size, np.nan)
        self.patience = int(np.ceil((20 + 4 * n) * 2 / LOOK))
        self.evals = 0

    def begin(self, start: Start | ArrayLike) -> None:
        """Set the state at the first look."""
        if isinstance(start, str):
            if Start(start) is Start.ALL:
                raise EnvelopeError("start: expected rest, ramp or amplitudes, got all; use rung harmonic_balance")
            if Start(start) is Start.RAMP:
                looks = int(RAMP / LOOK)
                for k in range(looks):
                    self._advance(self.payable, (k / looks, (k + 1) / looks))
            else:
                self.slow = self.flow.at_rest(self.drive, self.flow.lam)
            return
        amplitude = np.asarray(start, dtype=np.complex128)
        if amplitude.shape not in (self.slow.shape, self.slow.shape[1:]) or not np.isfinite(amplitude).all():
            raise EnvelopeError(f"start: expected finite amplitudes of shape {self.slow.shape}, got {amplitude.shape}")
        self.slow = self.flow.slow_part(np.broadcast_to(amplitude, self.slow.shape), self.drive, self.flow.lam)

    def settle(self) -> None:
        """Look again and again until every setting has its outcome."""
        lanes = self.payable
        last, gap = np.full_like(self.phasor, np.nan), np.full(len(self.drive), np.inf)
        changes: list[Floats] = []
        for look in range(LOOKS):
            if not len(lanes):
                return
            before = self._amplitude(lanes)
            self._advance(lanes, (1.0, 1.0))
            here = self._amplitude(lanes)
            seen = np.full(len(self.drive), np.inf)
            seen[lanes] = _apart(before, here)
            changes.append(seen)
            gone = ~(np.abs(here) <= self.top[lanes]).all(axis=1)
            self.outcome[lanes[gone]] = Outcome.ESCAPED
            lanes, here = lanes[~gone], here[~gone]
            orbit, found = fixed_point(pick(self.flow, lanes), self.drive[lanes], here)
            distance = np.where(found & self._stable(lanes, orbit), _apart(here, orbit), np.inf)
            nearing = (_apart(last[lanes], orbit) < SAME) & (distance < np.maximum(SHRINKS * gap[lanes], CLOSE))
            done = nearing & (distance < NEAR)
            self.outcome[lanes[done]], self.phasor[lanes[done]] = Outcome.OK, orbit[done]
            self.beat[lanes[done]] = self.spread[lanes[done]] = 0.0
            last[lanes], gap[lanes] = orbit, distance
            lost = np.zeros(len(lanes), dtype=bool)
            if look >= self.patience:
                lost = ~done & ~nearing & self._recurrent(changes, lanes, np.isfinite(distance))
                lost[lost] = self._note_beats(lanes[lost])
            lanes = lanes[~done & ~lost]

    def arrival(self, seconds: float) -> Arrival:
        """The result; arrays read-only."""
        rates = rates_at(self.flow, self.phasor)
        for array in (self.outcome, self.phasor, rates, self.beat, self.spread):
            array.flags.writeable = False
        return Arrival(
            self.outcome, self.phasor, rates, self.beat, self.spread, Stats(rhs_evals=self.evals, seconds=seconds)
        )

    def _amplitude(self, lanes: Lanes) -> Complexes:
        flow = pick(self.flow, lanes)
        return flow.amplitude(self.slow[lanes], self.drive[lanes], flow.lam)

    def _advance(self, lanes: Lanes, ramp: tuple[float, float], keep: list[Complexes] | None = None) -> None:
        """Move `lanes` from one look to the next while the drive goes from ramp[0] to ramp[1] of its value."""
        flow, drive, slow = pick(self.flow, lanes), self.drive[lanes], self.slow[lanes]
        steps = Steps(*(array[lanes] for array in vars(self.steps).values()))
        for j in range(self.count):
            u, v = (ramp[0] + (ramp[1] - ramp[0]) * (j + i) / self.count for i in (0, 1))
            slow = steps.take(flow, slow, (u * drive, v * drive), (flow.lam, flow.lam))
            if keep is not None:
                keep.append(flow.amplitude(slow, drive, flow.lam))
        self.slow[lanes] = slow
        self.evals += 4 * self.count * slow.size

    def _stable(self, lanes: Lanes, orbit: Complexes) -> NDArray[np.bool_]:
        rates = rates_at(pick(self.flow, lanes), orbit)
        stable: NDArray[np.bool_] = rates.real.max(axis=1) < 0
        return stable

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

    def _note_beats(self, lanes: Lanes) -> NDArray[np.bool_]:
        """Follow what does not lock until its strongest line stays what it is from one window to the next.

        Returns which of them do beat: a long wait at a fold that a stage has just passed looks like motion too.
        """
        asked = lanes
        for _ in range(WINDOWS):
            if not len(lanes):
                break
            kept: list[Complexes] = []
            for _ in range(BEATS):
                self._advance(lanes, (1.0, 1.0), kept)
            samples = np.stack(kept)
            size = np.abs(samples)
            spread = np.ptp(size, axis=0) / size.max(axis=0)
            most = spread.argmax(axis=1)
            deep = spread[np.arange(len(lanes)), most]
            beat = np.array([strongest_line(samples[:, at, m], self.h) for at, m in enumerate(most)])
            same = np.abs(beat - self.beat[lanes]) <= STEADY * np.abs(beat)
            same &= np.abs(deep - self.spread[lanes]) <= STEADY
            self.beat[lanes], self.spread[lanes] = beat, deep
            lanes = lanes[~same & (deep > QUIET)]
        beats = self.spread[asked] > QUIET
        self.outcome[asked[beats]] = Outcome.NOT_LOCKED
        self.beat[asked[~beats]] = self.spread[asked[~beats]] = np.nan
        return np.asarray(beats)


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


def _bend(chain: Chain, setting: Setting) -> Floats:
    """Bound of the rate the cubic term adds, shape (N, 1): 3/8 |beta| a^2/omega at the largest transient amplitude."""
    delta, beta = float(chain.deltas.min()), float(np.abs(chain.betas).max())
    strength = np.abs(setting.epsilon) / np.maximum(delta * setting.omega, 1e-9)
    if beta:
        # Past resonance the cubic itself holds the amplitude: 3/4 |beta| a^3 = 4 epsilon covers the overshoot.
        strength = np.minimum(2 * strength, np.cbrt(16 * np.abs(setting.epsilon) / (3 * beta)) * 1.5)
        strength = strength + np.sqrt(8 / 3 * np.abs(1 - setting.omega**2) / beta) * (strength > 0)
        strength = np.minimum(strength, hilltop(chain, setting.lam).max(axis=1))
    bound: Floats = (0.375 * beta * strength**2 / setting.omega)[:, None]
    return bound
