"""Answers in plain JSON values: complex numbers are [re, im], what is not known is None."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..effects.effects import Terms
from ..equations.chain import Chain, Setting
from ..model.response import Outcome, Response, Stats
from ..reach.ladder import every_branch, lists_jointly, solve
from ..rung import RungError, Start

if TYPE_CHECKING:
    from ..effects.steady import Beat

__all__ = ["plain_of", "plain_with_terms"]


# Accuracy at which an integration tells a beat from the tail of a decay.
CLEAR = 1e-4


def plain_of(chain: Chain, setting: Setting, *, tol: float, rung: str, start: Start) -> dict[str, Any]:
    """Solve one setting; with start all, every branch.

    Raises
    ------
    RungError
        When the rung cannot answer.
    """
    if start is Start.ALL:
        return _every_branch(chain, setting, tol=tol, rung=rung)
    answer = _plain(solve(chain, setting, tol=tol, rung=rung, start=start), 0)
    if answer["outcome"] == Outcome.NOT_LOCKED:
        answer["beat"] = _beat(chain, setting, start)
    return answer


def plain_with_terms(
    chain: Chain, setting: Setting, terms: Terms, *, tol: float, rung: str, start: Start
) -> dict[str, Any]:
    """Solve one setting of a chain with extra terms.

    Raises
    ------
    RungError
        When the rung does not carry the terms.
    """
    from ..effects.rungs import solve_with_terms

    found = solve_with_terms(chain, setting, terms, tol=tol, rung=rung, start=start)
    tones = found.lines.index.shape[1]
    third = found.lines.place(3, *[0] * (tones - 1))
    first = found.amplitude[0]
    known = bool(np.isfinite(first).all())
    answer: dict[str, Any] = {
        "outcome": str(found.outcome),
        "rung": found.rung,
        "phasor": _pairs(first),
        "phase_step_deg": _steps(first),
        "third": _pairs(np.full(chain.n, np.nan) if third is None else found.amplitude[third]),
        "mean": _numbers(found.mean),
        "stable": found.stable,
        "locked": known and found.stable is not False,
        "multipliers": _pairs(np.full(2 * chain.n, np.nan)),
        "branch": [None] * chain.n,
        "error_estimate": _number(found.error_estimate),
        "stats": _work(found.stats),
    }
    if tones > 1:
        answer["lines"] = [
            {"k": [int(k) for k in index], "omega": float(omega), "phasor": _pairs(amplitude)}
            for index, omega, amplitude in zip(found.lines.index, found.lines.omega, found.amplitude, strict=True)
        ]
    if terms.creep is not None:
        drift = found.drift
        answer["drift"] = None if drift is None else {
            "tau": drift.tau.tolist(), "mean": drift.mean.tolist(), "amplitude": drift.amplitude.tolist()
        }  # fmt: skip
    if found.outcome is Outcome.NOT_LOCKED:
        answer["beat"] = _plain_beat(found.beat)
    return answer


def _every_branch(chain: Chain, setting: Setting, *, tol: float, rung: str) -> dict[str, Any]:
    """The lowest stable answer with `answers`, all of them, and `complete`, whether there are surely no others."""
    if lists_jointly(chain, rung):
        found = every_branch(chain, setting, tol=tol, rung=rung)
        response, complete = found.response, found.complete
    else:
        response = solve(chain, setting, tol=tol, rung=rung, start=Start.ALL)
        complete = _is_complete(chain, setting, response)
    answers = [_plain(response, index) for index in range(len(response))]
    first = next((answer for answer in answers if answer["outcome"] == Outcome.OK), answers[0])
    return {**first, "answers": answers, "complete": complete}


def _is_complete(chain: Chain, setting: Setting, response: Response) -> bool:
    """Whether each single-harmonic answer has led to one; their cubics are solved to the last root."""
    if response.rung in ("linear", "static"):
        return True
    if setting.bias.any() or setting.preload.any():
        return False
    rough = solve(chain, setting, tol=1.0, rung="one_harmonic", start=Start.ALL)
    return len(rough) == len(response)


def _beat(chain: Chain, setting: Setting, start: Start) -> dict[str, Any] | None:
    """What a motion that does not lock does instead; None where that is not seen."""
    from ..effects.steady import steady_with_terms

    try:
        found = steady_with_terms(chain, setting, Terms(), tol=CLEAR, start=start)
    except RungError:
        return None
    return _plain_beat(found.beat)


def _plain_beat(beat: Beat | None) -> dict[str, Any] | None:
    return None if beat is None else {
        "omega": _number(beat.omega), "depth": _numbers(beat.depth), "phasor": _pairs(beat.phasor),
        "phase_step_deg": _steps(beat.phasor),
    }  # fmt: skip


def _plain(response: Response, index: int) -> dict[str, Any]:
    return {
        "outcome": str(response.outcome[index]),
        "rung": response.rung,
        "phasor": _pairs(response.phasor[index]),
        "phase_step_deg": _numbers(np.degrees(response.phase_step[index])),
        "third": _pairs(response.third[index]),
        "mean": _numbers(response.mean[index]),
        "stable": bool(response.stable[index]),
        "locked": bool(response.locked[index]),
        "multipliers": _pairs(response.multipliers[index].reshape(-1)),
        "branch": [int(branch) for branch in response.branch[index]],
        "error_estimate": _number(float(response.error_estimate[index])),
        "stats": _work(response.stats),
    }


def _work(stats: Stats) -> dict[str, Any]:
    return {
        "seconds": stats.seconds,
        "rhs_evals": stats.rhs_evals,
        "newton_steps": stats.newton_steps,
        "oscillators_solved": stats.oscillators_solved,
        "periods": stats.periods,
    }


def _steps(phasor: NDArray[np.complex128]) -> list[float | None]:
    return _numbers(np.degrees(np.angle(phasor[1:] * np.conj(phasor[:-1]))))


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _numbers(values: ArrayLike) -> list[float | None]:
    return [_number(float(value)) for value in np.asarray(values)]


def _pairs(values: ArrayLike) -> list[list[float | None]]:
    numbers = np.asarray(values, dtype=np.complex128)
    return [
        [float(value.real), float(value.imag)] if ok else [None, None]
        for value, ok in zip(numbers, np.isfinite(numbers), strict=True)
    ]
