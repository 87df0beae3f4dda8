"""The full equations: a sudden drive from rest or a ramp, integrated until sure, polished by shooting."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import basis_for
from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..harmonic_balance.march import branches_of
from ..model.response import Branch, Outcome, Response, Stats
from ..rung import DEFLECTION, MAX_PERIODS, TERMS, VIBRATION, Rung, RungError, Start
from .ramp import settle_ramp
from .shooting import FAR_SMALLER, Orbits, shoot
from .transient import Settled, settle

__all__ = ["OdeRung", "Reached", "reached_from_rest", "steady_from_ramp", "steady_from_rest"]

Floats = NDArray[np.float64]
Lanes = NDArray[np.int64]

_FIRST_STEPS = 32
_DOUBLINGS = 7
_ORDER = 4  # The lowest order in the composition's error, so a bound for what a doubling gains.
_MOST_WORK = 1 << 18  # Steps per period times oscillators, beyond which steps are not doubled again.
_USABLE = 1e-6
_AT_FLOOR = 1e-9  # Below this an error that no longer falls is round-off.
_ROUNDING = 4e-16  # Relative round-off per step, measured against a Taylor integrator at 1e-18.


@dataclass(frozen=True)
class Reached:
    """Which orbit a sudden drive from rest reaches.

    Attributes
    ----------
    outcome : object array of `Outcome`, shape (N,).
    phasor : complex128, shape (N, n), dimensionless, first harmonic to about 1e-5; NaN where not ok.
    stats : the work of the whole batch.
    """

    outcome: NDArray[np.object_]
    phasor: NDArray[np.complex128]
    stats: Stats


def reached_from_rest(chain: Chain, setting: Setting, *, max_periods: int) -> Reached:
    """Integrate from rest under a sudden drive until the reached orbit is sure, without polishing it.

    Parameters
    ----------
    chain, setting : what to solve, N settings.
    max_periods : drive periods after which a setting is given up as out of budget.
    """
    began = time.perf_counter()
    scaled = ScaledChain.of(chain, setting)
    settled = settle(scaled, max_periods)
    stats = _stats(scaled, settled, 0, time.perf_counter() - began)
    return Reached(settled.outcome, settled.phasor / scaled.length, stats)


def steady_from_rest(chain: Chain, setting: Setting, *, tol: float, max_periods: int) -> Response:
    """The periodic steady states reached from rest under a sudden drive.

    Parameters
    ----------
    chain, setting : what to solve, N settings.
    tol : relative to each oscillator's own amplitude, 1e-12 or more.
    max_periods : drive periods after which a setting is given up as out of budget.

    Returns
    -------
    Response with seven harmonics. `ESCAPED`: |z| passed 50/sqrt|beta| (beta < 0) or 1e9; `NOT_LOCKED`: the
    motion goes on without repeating after the drive's period; `OUT_OF_BUDGET`: neither was sure in time;
    `NO_CONVERGENCE`: the orbit was reached but could not be refined to `tol` or 1e-6, or is not stable when refined.

    Raises
    ------
    RungError
        When `tol` is below 1e-12 or not a number, or `max_periods` is below 1.
    """
    _check(tol, max_periods)
    began = time.perf_counter()
    scaled = ScaledChain.of(chain, setting)
    return _polished(scaled, settle(scaled, max_periods), tol, began)


def steady_from_ramp(chain: Chain, setting: Setting, *, tol: float, max_periods: int) -> Response:
    """The periodic steady states reached from equilibrium by a drive that grows linearly within 100/delta.

    As `steady_from_rest`, but what does not lock is out of budget.
    """
    _check(tol, max_periods)
    began = time.perf_counter()
    return _polished(ScaledChain.of(chain, setting), settle_ramp(chain, setting, max_periods=max_periods), tol, began)


def _check(tol: float, max_periods: int) -> None:
    if not tol >= 1e-12:
        raise RungError(f"tol: expected a number >= 1e-12 (double precision gives no more), got {tol}")
    if max_periods < 1:
        raise RungError(f"max_periods: expected 1 or more, got {max_periods}")


def _polished(scaled: ScaledChain, settled: Settled, tol: float, began: float) -> Response:
    polished = _Polished(scaled, settled)
    polished.refine(tol)
    return polished.response(tol, began)


class _Polished:
    """Orbits of all N settings, refined by doubling the steps; NaN where none is known."""

    def __init__(self, scaled: ScaledChain, settled: Settled) -> None:
        size, n = len(scaled), scaled.n
        self.scaled, self.settled = scaled, settled
        self.state = np.array(settled.state)
        self.harmonics = np.full((size, 8, n), np.nan, dtype=np.complex128)
        self.multipliers = np.full((size, n, 2), np.nan, dtype=np.complex128)
        self.error = np.full(size, np.nan)
        self.turns = self.kicks = 0

    def refine(self, tol: float) -> None:
        """Double the steps of every reached orbit until the change says `tol`, or stops falling."""
        reached = self.settled.outcome == Outcome.OK
        for value in np.unique(self.settled.steps[reached]):
            steps = max(4 * int(value), _FIRST_STEPS)
            lanes = self._shoot(np.flatnonzero(reached & (self.settled.steps == value)), steps)
            for _ in range(_DOUBLINGS):
                if not len(lanes) or steps * self.scaled.n > _MOST_WORK:
                    break
                steps *= 2
                before = self.error.copy()
                lanes = self._shoot(lanes, steps)
                stuck = (self.error[lanes] > 0.5 * before[lanes]) & (self.error[lanes] < _AT_FLOOR)
                lanes = lanes[(self.error[lanes] > tol) & ~stuck]

    def _shoot(self, lanes: Lanes, steps: int) -> Lanes:
        """Solve `lanes` at `steps`, note the change since the last solve; returns those that were found."""
        orbits = shoot(self.scaled, lanes, self.state[lanes], steps)
        self.turns += orbits.turns
        self.kicks += 7 * steps * orbits.turns * (self.scaled.n if self.scaled.joint else 1)
        lanes, change = lanes[orbits.found], self._change(lanes, orbits)
        # Rounded flow coefficients err alike in every step, so round-off grows with the steps and with Q.
        gap = np.min(np.abs(1 - orbits.multipliers[orbits.found]), axis=2)
        rounding = _ROUNDING * steps * np.sum(1 / gap, axis=1)
        self.error[lanes] = change / (2**_ORDER - 1) + orbits.defect[orbits.found] + rounding
        self.state[lanes] = orbits.state[orbits.found]
        self.harmonics[lanes] = orbits.harmonics[orbits.found]
        self.multipliers[lanes] = orbits.multipliers[orbits.found]
        return lanes

    def _change(self, lanes: Lanes, orbits: Orbits) -> Floats:
        """Largest change of any harmonic, relative to its oscillator's largest; inf at the first solve."""
        old, new = self.harmonics[lanes[orbits.found]], orbits.harmonics[orbits.found]
        size = np.max(np.abs(new), axis=1)
        if self.scaled.joint:
            size = np.maximum(size, FAR_SMALLER * np.max(size, axis=1, keepdims=True, initial=0.0))
        change = np.max(np.abs(new - old), axis=1)
        ratio = np.divide(change, size, out=np.zeros_like(size), where=size > 0)
        worst: Floats = np.nan_to_num(np.max(ratio, axis=1), nan=np.inf)
        return worst

    def response(self, tol: float, began: float) -> Response:
        """The answer in the chain's own units."""
        outcome = np.array(self.settled.outcome)
        reached = outcome == Outcome.OK
        with np.errstate(invalid="ignore"):
            inside = np.max(np.abs(self.multipliers), axis=(1, 2)) < 1
        # An orbit that only the coarse steps of the transient find stable is none that is reached.
        outcome[reached & ~(inside & (self.error <= max(tol, _USABLE)))] = Outcome.NO_CONVERGENCE
        ok = outcome == Outcome.OK
        harmonics = self.harmonics / self.scaled.length
        harmonics[~ok] = np.nan
        stats = _stats(self.scaled, self.settled, self.turns, time.perf_counter() - began, self.kicks)
        branch = _branches(self.scaled, self.harmonics, ok)
        answer = Response(
            rung=OdeRung.name, outcome=outcome, harmonics=harmonics[:, 1:], mean=harmonics[:, 0].real,
            stable=np.array(ok), locked=ok, multipliers=self.multipliers, branch=branch,
            error_estimate=self.error, stats=stats,
        )  # fmt: skip
        for array in (value for value in vars(answer).values() if isinstance(value, np.ndarray)):
            array.flags.writeable = False
        return answer


def _branches(scaled: ScaledChain, harmonics: NDArray[np.complex128], ok: NDArray[np.bool_]) -> NDArray[np.int8]:
    """`Branch` of each oscillator under the first harmonic of what drives it; int8, shape (N, n)."""
    branch = np.full((len(scaled), scaled.n), Branch.LOW, dtype=np.int8)
    basis, first = basis_for(1, False), harmonics[ok, 1]
    x = np.stack([first.real.T, first.imag.T], axis=1)
    branch[ok] = branches_of(scaled.pick(ok), basis, x).T
    return branch


def _stats(scaled: ScaledChain, settled: Settled, turns: int, seconds: float, kicks: int = 0) -> Stats:
    return Stats(
        rhs_evals=settled.kicks + kicks,
        newton_steps=settled.turns + turns,
        oscillators_solved=len(scaled) * scaled.n,
        periods=settled.periods,
        seconds=seconds,
    )


class OdeRung(Rung):
    """The reference: nothing is left out of the equations."""

    name: ClassVar[str] = "ode"
    order: ClassVar[str] = "tol (steps are doubled until the answer moves by less)"
    valid: ClassVar[str] = "always; a slow settling may exceed the budget of periods"
    models = TERMS
    answers = frozenset({DEFLECTION, VIBRATION})
    adjustable = True
    full_equations = True

    max_periods: ClassVar[int] = MAX_PERIODS

    def refusal(self, chain: Chain, setting: Setting, start: Start) -> str:
        """It goes one way in."""
        if start is Start.ALL:
            return f"it integrates one way in, not start {start}; use start rest or ramp, or rung harmonic_balance"
        return ""

    def steady(self, chain: Chain, setting: Setting, *, tol: float, start: Start) -> Response:
        """The steady states reached from rest or by a ramp, to `tol` or 1e-12, whichever is larger."""
        way = steady_from_rest if start is Start.REST else steady_from_ramp
        return way(chain, setting, tol=max(tol, 1e-12), max_periods=self.max_periods)
