"""The cheapest answer that is accurate enough, and the best that comes in time, without a reference."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable

import numpy as np

from chainsim import RUNGS, Response, load_rung

from .questions import FINEST, TOLS, Question, TradeoffError, answer, positive, refusal, seconds_words

__all__ = ["climb"]

# The next rung or tolerance takes up to so many times the last one's time.
GROWTH = 10.0
# Seconds that the full equations take before the first step, where nothing compiled was used before.
COLD_S = 3.0


def climb(
    question: Question,
    *,
    tol: float | None = None,
    budget_s: float | None = None,
    clock: Callable[[], float] = time.perf_counter,
) -> tuple[Response, str]:
    """The cheapest answer whose own estimate meets `tol`, or the best that comes within `budget_s`, and what it is.

    Rungs are tried from the cheapest; nothing is compared with a reference. A rung that has begun is not stopped: the
    next one is tried only when ten times what the last one took is left of the time, and the full equations only when
    there is time to load what is compiled for them. `clock` tells the time in seconds.

    Raises
    ------
    TradeoffError
        Unless one of `tol` and `budget_s` is given, above 0.
    """
    if (tol is None) == (budget_s is None):
        raise TradeoffError("climb: expected either a tolerance or a budget")
    positive("tol" if tol is not None else "budget", tol or budget_s or 0.0)
    began, best, last = clock(), None, 0.0
    for rung, asked in _ladder(question, tol):
        start = clock()
        if best is not None and budget_s is not None and start - began + GROWTH * last + _loading_s(rung) > budget_s:
            break
        found = answer(rung, asked, question)
        last = clock() - start
        if best is None or _estimate(found) < _estimate(best):
            best = found
        if _estimate(best) <= (FINEST if tol is None else tol):
            break
    assert best is not None
    reached, spent = _estimate(best), clock() - began
    met = spent <= budget_s if budget_s is not None else reached <= (tol or 0.0)
    wish = f"tolerance {tol:g}" if tol is not None else f"budget {seconds_words(budget_s or 0.0)}"
    verdict = "met" if met else "not met"
    return best, f"{best.rung} to about {reached:.1e} in {seconds_words(spent)}; {wish} {verdict}"


def _loading_s(rung: str) -> float:
    return COLD_S if load_rung(rung).full_equations and "numba" not in sys.modules else 0.0


def _estimate(found: Response) -> float:
    """An answer's own worst estimate; infinite where a chain has none."""
    worst = float(np.max(found.error_estimate))
    return worst if math.isfinite(worst) else math.inf


def _ladder(question: Question, tol: float | None) -> list[tuple[str, float]]:
    """Rungs and tolerances by price: what gives what it has, up to the first rung that gives what is asked for."""
    rungs = [load_rung(name) for name in RUNGS]
    first = next(place for place, rung in enumerate(rungs) if rung.adjustable)
    steps = [(rung.name, 1.0) for rung in rungs[:first]]
    tols = TOLS if tol is None else (max(tol, FINEST),)
    steps += [(rung.name, one) for rung in rungs[first:] if rung.adjustable for one in tols]
    return [(rung, one) for rung, one in steps if not refusal(rung, question)]
