"""What an integrator takes for transients and, by shooting, for steady states, at equal error.

Times are of the processor, so that other work on the machine counts for nobody; each peer has one core. Compiling is
not counted.
"""

from __future__ import annotations

import time
from bisect import bisect_left
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from chain_rows import STATES, VARIED, Floats, given_of, rows_of, states_of, turned
from integrators import Flow, Way
from problem import CHAIN, PERIODS, median_error, settings, states_error

from chainsim import solve

__all__ = ["CHAINS", "steady_by_shooting", "transients_by"]

CHAINS = 256
ROUNDS = 2
# Four to a decade, so that nobody is asked for much more than the goal.
TOLERANCES = tuple(10 ** (-4 - k / 4) for k in range(29))
# Steps of Newton with the derivatives of the end by the start, then steps that keep the last derivatives.
PLANS = ((2, 0), (1, 1))
COLD_STEPS = 6


@dataclass(frozen=True)
class _Run:
    """Seconds a chain, and the states at the end, shape (CHAINS, 2n)."""

    seconds: float
    states: Floats


def transients_by(ways: Iterable[Way], wanted: Floats, goal: float) -> dict[str, Any]:
    """The cheapest of some ways to `PERIODS` periods from rest, with a median error of at most `goal`."""
    found = []
    for way in ways:

        def run(tolerance: float, way: Way = way) -> _Run:
            flow = way.make(tolerance, STATES)
            rest = np.zeros((STATES, way.lanes))
            return _timed(way, lambda given, _: states_of(flow(rest, given, PERIODS)))

        found.append(_loosest(way.settings, run, lambda states: median_error(states, wanted), goal))
    best = _cheapest(found)
    return best | {"median_error": best.pop("error"), "chain_periods_per_s_one_core": PERIODS / best["s_per_chain"]}


def steady_by_shooting(ways: Iterable[Way], wanted: Floats, goal: float) -> dict[str, Any]:
    """The cheapest of some ways to steady states whose largest error is at most `goal`, by shooting.

    Newton begins at the answers of one harmonic, which are not counted. `cold` is the best way from rest: its time,
    and the share of chains it has the steady state of.
    """
    asked = settings(CHAINS)
    phasor = solve(CHAIN, asked, tol=1.0, rung="one_harmonic").phasor
    near = np.concatenate([phasor.real, (1j * asked.omega[:, None] * phasor).real], axis=1)
    found, runs = [], {}
    for way in ways:
        for plan in PLANS:

            def run(tolerance: float, start: Floats = near, plan: tuple[int, int] = plan, way: Way = way) -> _Run:
                flows = way.make(tolerance, VARIED), way.make(tolerance, STATES)
                return _timed(way, lambda given, part: _newton(*flows, start[part], given, plan))

            words = f"{way.settings}; {plan[0]} Newton steps with variations, {plan[1]} with their derivatives kept"
            found.append(_loosest(words, run, lambda states: float(states_error(states, wanted).max()), goal))
            runs[words] = run
    best = _cheapest(found)
    cold = runs[best["settings"]](best["tolerance"], np.zeros_like(near), (COLD_STEPS, 0))
    share = float((states_error(cold.states, wanted) <= goal).mean())
    best["largest_error"] = best.pop("error")
    return best | {"cold": {"s_per_chain": cold.seconds, "steps": COLD_STEPS, "share_found": share}}


def _newton(varied: Flow, plain: Flow, states: Floats, given: Floats, plan: tuple[int, int]) -> Floats:
    """States that return after one period."""
    slow, quick = plan
    for _ in range(slow):
        end = varied(rows_of(states, VARIED), given, 1.0)
        apart = np.eye(STATES) - turned(end)
        states = states + np.linalg.solve(apart, (states_of(end) - states)[:, :, None])[:, :, 0]
    for _ in range(quick):
        end = plain(rows_of(states, STATES), given, 1.0)
        states = states + np.linalg.solve(apart, (states_of(end) - states)[:, :, None])[:, :, 0]
    return states


def _timed(way: Way, work: Callable[[Floats, slice], Floats]) -> _Run:
    """Best of a few rounds over all chains, `way.lanes` at a time; the first of them warms up."""
    asked, best = settings(CHAINS), np.inf
    parts = [slice(first, first + way.lanes) for first in range(0, CHAINS, way.lanes)]
    work(given_of(asked, parts[0]), parts[0])
    for _ in range(ROUNDS):
        began = time.process_time()
        states = [work(given_of(asked, part), part) for part in parts]
        best = min(best, time.process_time() - began)
    return _Run(best / CHAINS, np.concatenate(states))


def _loosest(
    words: str, run: Callable[[float], _Run], error_of: Callable[[Floats], float], goal: float
) -> dict[str, Any]:
    """The loosest tolerance within `goal`, or the last one, said so."""
    made: dict[float, _Run] = {}

    def good(tolerance: float) -> bool:
        made[tolerance] = run(tolerance)
        return error_of(made[tolerance].states) <= goal

    place = min(bisect_left(TOLERANCES, True, key=good), len(TOLERANCES) - 1)
    tolerance = TOLERANCES[place]
    taken = made.get(tolerance) or run(tolerance)
    error = error_of(taken.states)
    return {
        "settings": words, "tolerance": tolerance, "error": error, "reached": bool(error <= goal),
        "s_per_chain": taken.seconds,
    }  # fmt: skip


def _cheapest(found: list[dict[str, Any]]) -> dict[str, Any]:
    """The quickest that reaches the goal, and beside it what all took."""
    best = min(found, key=lambda each: (not each["reached"], each["s_per_chain"]))
    tried = {each["settings"]: each["s_per_chain"] for each in found}
    return dict(best) | {"tried": tried}
