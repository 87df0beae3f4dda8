"""Many settings of one chain at once: harmonic balance compiled for vectors, every setting on its own."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..equations.chain import Chain, Setting
from ..model.response import Outcome, Response, Stats
from ..reach.ladder import solve
from ..reach.rest import sure_from_rest
from ..threads import in_threads
from .balance import WIDTH
from .chains import Found, Given, march_blocks
from .deep import ORDERS, Tables, march_deep, tables_for
from .grids import march_grids
from .multipliers import nodes

__all__ = ["OUTCOMES", "SweepResult", "sweep", "unit_of"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Lanes = NDArray[np.int64]

OUTCOMES = tuple(Outcome)
"""What a `SweepResult.code` counts."""

_CODE = {outcome: np.int8(number) for number, outcome in enumerate(OUTCOMES)}
# Oscillators that are integrated or answered by NumPy at once.
_UNIT = 65_536


@dataclass(frozen=True)
class SweepResult:
    """Periodic steady states of N settings of a chain of n, without the harmonics above the third.

    ``z_m(tau) = mean_m + Re(phasor_m e^{i omega tau} + third_m e^{3 i omega tau}) + ...``

    Attributes
    ----------
    code : int8, shape (N,), index into `OUTCOMES`.
    phasor, third : complex128, shape (N, n), dimensionless; NaN where there is no answer.
    mean : float64, shape (N, n), dimensionless.
    multipliers : complex128, shape (N, n, 2), of each oscillator's 2 x 2 block.
    branch : int8, shape (N, n), `Branch` of each oscillator.
    answers : int8, shape (N, n), how many answers each oscillator has under its input, by the one-harmonic cubic:
        1 or 3; 0 where it was not counted (answers of `solve`).
    stable : bool, shape (N,).
    error_estimate : float64, shape (N,), of the phasors, relative to each setting's largest amplitude.
    stats : the work of the whole batch.
    """

    code: NDArray[np.int8]
    phasor: NDArray[np.complex128]
    third: NDArray[np.complex128]
    mean: Floats
    multipliers: NDArray[np.complex128]
    branch: NDArray[np.int8]
    answers: NDArray[np.int8]
    stable: Bools
    error_estimate: Floats
    stats: Stats = field(default_factory=Stats)

    @property
    def outcome(self) -> NDArray[np.object_]:
        """`Outcome` of each setting, shape (N,)."""
        names = np.empty(len(OUTCOMES), dtype=object)
        names[:] = OUTCOMES
        found: NDArray[np.object_] = names[self.code]
        return found

    @property
    def outcome_name(self) -> NDArray[np.str_]:
        """The same as text, shape (N,)."""
        return np.array([str(outcome) for outcome in OUTCOMES])[self.code]

    @property
    def locked(self) -> Bools:
        """Whether a motion that repeats with the drive was found; bool, shape (N,)."""
        known = np.isfinite(self.phasor.real)
        every: Bools = np.logical_and.reduce(known, axis=1)
        return every

    @property
    def phase_step(self) -> Floats:
        """Phase of m minus phase of m-1, radians in (-pi, pi], shape (N, n-1); negative = lag."""
        step: Floats = np.angle(self.phasor[:, 1:] * np.conj(self.phasor[:, :-1]))
        return step

    def __len__(self) -> int:
        return len(self.code)


def unit_of(n: int) -> int:
    """Settings of a chain of n that `sweep` hands to other solvers together, counted from the first."""
    return max(1, _UNIT // max(n, 16))


def sweep(chain: Chain, setting: Setting, *, tol: float, from_rest: bool) -> SweepResult:
    """Steady states of many settings of one chain.

    Open chains and grids of equal oscillators over resistors without constant forces are solved by compiled harmonic
    balance on all cores; where harmonics 1, 3 and 5 do not meet `tol`, up to 33 are taken. Everything else (rings,
    links both ways, amplifiers, oscillators that differ, forces that do not change) is answered by `solve`, `unit_of`
    settings at a time. An answer does not depend, to the last bit, on the settings outside its unit (where harmonic
    balance answers: on any other) nor on the number of threads.

    Parameters
    ----------
    tol : wanted accuracy of the phasors, relative to each setting's largest amplitude; from 1e-12 up to 1.
    from_rest : False, the lower branch of every oscillator, as the rung ``harmonic_balance``. True, what a sudden drive
        from rest reaches: settings in which that is not plainly the lower branch are integrated.

    Raises
    ------
    ValueError
        When `tol` is out of range.
    RungError
        When `solve` cannot answer.
    """
    if not (math.isfinite(tol) and 1e-12 <= tol <= 1):
        raise ValueError(f"tol: expected a number from 1e-12 to 1, got {tol}")
    if setting.n != chain.n:
        raise ValueError(f"setting: made for {setting.n} oscillators, the chain has {chain.n}")
    began = time.perf_counter()
    alike = chain.spread is None and bool(chain.law.back)
    compiled = alike and (chain.law.in_line or chain.rows > 1)
    if not compiled or setting.preload.any() or setting.bias.any():
        answer = _blank(len(setting), chain.n)
        rung = "auto" if from_rest else "harmonic_balance"
        _fill(answer, chain, setting, np.arange(len(setting)), tol, rung)
    else:
        answer = _lower(chain, setting, tol)
        if from_rest:
            _settle(answer, chain, setting, tol)
    for array in (value for value in vars(answer).values() if isinstance(value, np.ndarray)):
        array.flags.writeable = False
    work = Stats(oscillators_solved=len(setting) * chain.n, seconds=time.perf_counter() - began)
    return replace(answer, stats=work)


def _lower(chain: Chain, setting: Setting, tol: float) -> SweepResult:
    size = len(setting)
    length = math.sqrt(abs(chain.beta)) or 1.0
    sign = float(np.sign(chain.beta))
    # One layout: every other would be compiled apart.
    links = np.ascontiguousarray(setting.lam)
    downs = None if setting.lam_y is None else np.ascontiguousarray(setting.lam_y)
    given = Given(setting.epsilon, links, setting.omega, setting.phase, float(chain.delta), sign, length)
    answer = _blank(size, chain.n)
    found = Found(
        answer.phasor, answer.third, answer.multipliers, answer.branch, answer.answers, answer.error_estimate,
        np.zeros(size),
    )  # fmt: skip

    def march(part: slice) -> None:
        if downs is None:
            march_blocks(given, found, nodes(), part.start, part.stop)
        else:
            march_grids(given, downs, chain.cols, found, nodes(), part.start, part.stop)

    in_threads(march, size, WIDTH if downs is None else 1)
    if downs is not None:
        _judge(answer, found.largest, tol)
        _fill(answer, chain, setting, np.flatnonzero(~(answer.error_estimate <= tol)), tol, "harmonic_balance")
        return answer
    for order in ORDERS:
        lanes = np.flatnonzero(~(answer.error_estimate <= tol))
        if not len(lanes):
            break
        in_threads(partial(_march_some, given, found, lanes, tables_for(order)), len(lanes), 1)
    _judge(answer, found.largest, tol)
    return answer


def _march_some(given: Given, found: Found, lanes: Lanes, tables: Tables, part: slice) -> None:
    march_deep(given, found, lanes[part], tables)


def _judge(answer: SweepResult, largest: Floats, tol: float) -> None:
    """Outcome and stability, and NaN where there is no answer."""
    code, estimate = answer.code, answer.error_estimate
    np.less(largest, 1.0, out=answer.stable)
    code[:] = np.where(answer.stable, _CODE[Outcome.OK], _CODE[Outcome.UNSTABLE])
    code[~(estimate <= tol) | ~np.isfinite(largest)] = _CODE[Outcome.OUT_OF_BUDGET]
    lost = np.flatnonzero(~np.isfinite(estimate))
    code[lost] = _CODE[Outcome.NO_CONVERGENCE]
    _erase(answer, lost)


def _erase(answer: SweepResult, lost: Lanes) -> None:
    nothing = complex(np.nan, np.nan)
    answer.phasor[lost], answer.third[lost], answer.multipliers[lost] = nothing, nothing, nothing
    answer.branch[lost], answer.answers[lost], answer.stable[lost] = 0, 0, False
    answer.error_estimate[lost] = np.inf
    answer.mean[lost] = np.nan


def _settle(answer: SweepResult, chain: Chain, setting: Setting, tol: float) -> None:
    """Ask for an integration wherever the lower branch is not plainly what a sudden drive reaches."""
    unit = unit_of(chain.n)
    for first in range(0, len(setting), unit):
        part = slice(first, first + unit)
        with np.errstate(all="ignore"):
            sure = sure_from_rest(chain, setting[part], _as_response(answer, part))
        sure &= answer.code[part] == _CODE[Outcome.OK]
        _fill(answer, chain, setting, first + np.flatnonzero(~sure), tol, "auto")


def _as_response(answer: SweepResult, part: slice) -> Response:
    return Response(
        "harmonic_balance", answer.outcome[part], answer.phasor[part][:, None, :], answer.mean[part],
        answer.stable[part], answer.locked[part], answer.multipliers[part], answer.branch[part],
        answer.error_estimate[part],
    )  # fmt: skip


def _fill(answer: SweepResult, chain: Chain, setting: Setting, lanes: Lanes, tol: float, rung: str) -> None:
    """Put what `solve` says of the settings `lanes` into `answer`."""
    unit = unit_of(chain.n)
    for first in range(0, len(lanes), unit):
        some = lanes[first : first + unit]
        response = solve(chain, setting[some], tol=tol, rung=rung)
        answer.code[some] = [_CODE[outcome] for outcome in response.outcome]
        answer.phasor[some], answer.third[some] = response.phasor, response.third
        answer.multipliers[some], answer.branch[some] = response.multipliers, response.branch
        answer.stable[some], answer.error_estimate[some] = response.stable, response.error_estimate
        answer.answers[some] = 0
        answer.mean[some] = response.mean


def _blank(size: int, n: int) -> SweepResult:
    def empty(*shape: int) -> NDArray[np.complex128]:
        return np.empty(shape, dtype=np.complex128)

    return SweepResult(
        np.zeros(size, dtype=np.int8), empty(size, n), empty(size, n), np.zeros((size, n)), empty(size, n, 2),
        np.zeros((size, n), dtype=np.int8), np.zeros((size, n), dtype=np.int8), np.zeros(size, dtype=bool),
        np.empty(size),
    )  # fmt: skip
