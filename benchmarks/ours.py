"""What dotwave's own solvers take."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from problem import CHAIN, PERIODS, median_error, settings

from chainsim import Chain, Setting, solve
from chainsim.scaled import in_threads, scaled
from chainsim.splitting import WIDTH, advance_block, forcing_table
from chainsim.sweeps import OUTCOMES, sweep

__all__ = ["lengths", "one_alone", "states_after", "steady", "timed", "transients"]

# Multiplying instructions of one kick and the flow after it: x^2, the shear of p from cubic and flow, that shear, the
# input, the shear of q, the force handed on.
_MULTIPLIES = 6


def timed(work: Callable[[], Any], rounds: int) -> tuple[float, float]:
    """Best wall and best processor seconds of `rounds` calls, after one to warm up."""
    work()
    walls, cpus = [], []
    for _ in range(rounds):
        cpu, wall = time.process_time(), time.perf_counter()
        work()
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
    return min(walls), min(cpus)


def steady(size: int, rounds: int) -> dict[str, Any]:
    """Outcome, branches, multipliers and phasors of `size` settings to 1e-6."""
    asked = settings(size)
    wall, cpu = timed(lambda: sweep(CHAIN, asked, tol=1e-6, from_rest=False), rounds)
    found = sweep(CHAIN, asked, tol=1e-6, from_rest=False)
    sample = slice(0, min(size, 2000))
    wanted = solve(CHAIN, asked[sample], tol=1e-9, rung="harmonic_balance")
    error = np.abs(found.phasor[sample] - wanted.phasor) / np.abs(wanted.phasor)
    return {
        "settings": size, "wall_s": wall, "cpu_s": cpu, "us_per_setting": 1e6 * wall / size,
        "largest_error": float(error.max()), "largest_estimate": float(found.error_estimate.max()),
        "ok": int((found.code == OUTCOMES.index("ok")).sum()),
    }  # fmt: skip


def one_alone() -> dict[str, Any]:
    """One chain by NumPy, no compiler imported for it."""
    one = settings(1)
    wall, cpu = timed(lambda: solve(CHAIN, one, tol=1e-6, rung="harmonic_balance"), 20)
    return {"wall_s": wall, "cpu_s": cpu}


def states_after(size: int, steps: int, periods: int = PERIODS) -> NDArray[np.float64]:
    """States (z, v) of `size` chains that start from rest, by the splitting kernel on all cores."""
    problem = scaled(CHAIN, settings(size))
    state, peak, lanes = np.zeros((size, 2 * CHAIN.n)), np.zeros(size), np.arange(size)
    table, system = forcing_table(steps), problem.system

    def work(part: slice) -> None:
        advance_block(state, lanes[part], system, table, 0, steps * periods, peak)

    in_threads(work, size, 2 * WIDTH)
    state[:, CHAIN.n :] -= 0.5 * CHAIN.delta * state[:, : CHAIN.n]
    return state


def transients(size: int, rounds: int) -> list[dict[str, Any]]:
    """Chain-periods a second at 6, 8 and 12 steps a period, and the share of the arithmetic limit."""
    wanted, peak, cores = states_after(size, 64), _multiplies_per_second(), os.cpu_count() or 1
    found = []
    for steps in (6, 8, 12):
        wall, cpu = timed(lambda steps=steps: states_after(size, steps), rounds)
        kicks = size * PERIODS * steps * 7 * CHAIN.n
        found.append({
            "steps": steps, "chain_periods_per_s": size * PERIODS / wall, "wall_s": wall, "cpu_s": cpu, "cores": cores,
            "median_error": median_error(states_after(size, steps), wanted),
            "kicks_per_cpu_s": kicks / cpu, "share_of_limit": _MULTIPLIES * kicks / cpu / peak,
        })  # fmt: skip
    return found


def lengths(longest: int) -> dict[str, Any]:
    """Seconds for one chain of n oscillators, and the slope in the logarithms."""
    sizes = [n for n in (1000, 10_000, 100_000, 1_000_000) if n <= longest]
    seconds = []
    for n in sizes:
        chain = Chain(n, 5.3006e-3, -1.0)
        asked = Setting.of(chain, epsilon=1e-2, lam=0.3, omega=1.1)
        wall, _ = timed(lambda chain=chain, asked=asked: sweep(chain, asked, tol=1e-6, from_rest=False), 2)
        seconds.append(wall)
    slope = float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])
    return {"n": sizes, "wall_s": seconds, "slope": slope}


@njit(fastmath={"contract"})
def _multiply(work: NDArray[np.float64], rounds: int) -> None:
    for _ in range(rounds):
        for w in range(64):
            x, y = work[w], work[64 + w]
            for _ in range(32):
                x = x * y + 1e-9
            work[w] = x


def _multiplies_per_second() -> float:
    """Multiply-adds a second and core, of eight independent vectors, as measured here and now."""
    work = np.full(128, 0.5)
    rounds = 20_000
    _, cpu = timed(lambda: _multiply(work, rounds), 5)
    peak = rounds * 64 * 32 / cpu
    return peak if math.isfinite(peak) else math.nan
