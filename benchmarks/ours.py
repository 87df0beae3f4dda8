"""What dotwave's own solvers take."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from problem import CHAIN, PERIODS, median_error, settings

from chainsim import Chain, Setting, solve
from chainsim.batch.sweep import OUTCOMES, sweep
from chainsim.equations.scaled_chain import ScaledChain
from chainsim.threads import in_threads
from chainsim.time_domain.splitting import WIDTH, advance_block, forcing_table

__all__ = ["ALONE", "lengths", "map_of_settings", "one_alone", "states_after", "steady", "timed", "transients"]

# Multiplying instructions of one kick and the flow after it: x^2, the shear of p from cubic and flow, that shear, the
# input, the shear of q. A step of seven takes six more (four weights of the input, two for its decay); the drive takes
# three for each kick on the first of six oscillators.
_MULTIPLIES = 5 + 6 / 7 + 3 / 6


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


ALONE = """
import sys, time
sys.path.insert(0, {folder!r})
from problem import CHAIN, settings
from chainsim import solve
one = settings(1)
walls, cpus = [], []
for _ in range(200):
    cpu, wall = time.process_time(), time.perf_counter()
    solve(CHAIN, one, tol=1e-6, rung="harmonic_balance")
    walls.append(time.perf_counter() - wall)
    cpus.append(time.process_time() - cpu)
assert "numba" not in sys.modules
print(min(walls), min(cpus))
"""


def one_alone() -> dict[str, Any]:
    """One chain by NumPy, in an interpreter that imports no compiler."""
    script = ALONE.format(folder=str(Path(__file__).resolve().parent))
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    wall, cpu = (float(number) for number in done.stdout.split())
    return {"wall_s": wall, "cpu_s": cpu}


def states_after(size: int, steps: int, periods: int = PERIODS) -> NDArray[np.float64]:
    """States (z, v) of `size` chains that start from rest, by the splitting kernel on all cores."""
    scaled = ScaledChain.of(CHAIN, settings(size))
    state, peak, lanes = np.zeros((size, 2 * CHAIN.n)), np.zeros(size), np.arange(size)
    table, system = forcing_table(steps), scaled.network.plain

    def work(part: slice) -> None:
        advance_block(state, lanes[part], system, table, 0, steps * periods, peak)

    in_threads(work, size, WIDTH)
    state[:, CHAIN.n :] -= 0.5 * CHAIN.delta * state[:, : CHAIN.n]
    return state


def transients(size: int, rounds: int) -> list[dict[str, Any]]:
    """Chain-periods a second at 6, 8 and 12 steps a period, and the share of the arithmetic limit."""
    wanted, peak, cores = states_after(size, 64), _multiplies_per_second(), os.cpu_count() or 1
    found = []
    for steps in (6, 8, 12):
        wall, cpu = timed(partial(states_after, size, steps), rounds)
        kicks = size * PERIODS * steps * 7 * CHAIN.n
        found.append({
            "steps": steps, "chain_periods_per_s": size * PERIODS / wall, "wall_s": wall, "cpu_s": cpu, "cores": cores,
            "median_error": median_error(states_after(size, steps), wanted),
            "kicks_per_cpu_s": kicks / cpu, "share_of_limit": _MULTIPLIES * kicks / cpu / peak,
        })  # fmt: skip
    return found


def lengths(longest: int) -> dict[str, Any]:
    """Processor seconds and bytes for one chain and one square grid of n oscillators, and slopes in the logarithms."""
    return {"chain": _grows(_chain, longest), "grid": _grows(_grid, longest)}


def _grows(make: Callable[[int], tuple[Chain, Setting]], longest: int) -> dict[str, Any]:
    sizes, seconds, peaks, outcomes = [], [], [], []
    for size in (1000, 10_000, 100_000, 1_000_000):
        if size > longest:
            break
        chain, asked = make(size)
        work = partial(sweep, chain, asked, tol=1e-6, from_rest=False)
        _, cpu = timed(work, 5 if size < 100_000 else 2)
        tracemalloc.start()
        found = work()
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        sizes.append(chain.n)
        seconds.append(cpu)
        outcomes.append(str(found.outcome[0]))
    along = np.log(sizes)
    return {
        "n": sizes, "cpu_s": seconds, "bytes": peaks, "outcome": outcomes,
        "slope": float(np.polyfit(along, np.log(seconds), 1)[0]),
        "memory_slope": float(np.polyfit(along, np.log(peaks), 1)[0]),
    }  # fmt: skip


def _chain(size: int) -> tuple[Chain, Setting]:
    """The wave grows over the first few oscillators, then keeps an amplitude of 0.73 for good."""
    chain = Chain(size, 5.3006e-3, -1.0)
    return chain, Setting.of(chain, epsilon=1e-2, lam=0.3, omega=1.1)


def _grid(size: int) -> tuple[Chain, Setting]:
    """Along the edges the amplitude settles at 0.35, inside, where twice as much arrives, at 0.73 as in the chain.

    With links of 0.3 it would settle at 1.17, for which five harmonics are not enough.
    """
    side = round(math.sqrt(size))
    chain = Chain(side * side, 5.3006e-3, -1.0, rows=side)
    return chain, Setting.of(chain, epsilon=1e-2, lam=0.15, lam_y=0.15, omega=1.1)


MAP = """\
chain: {{n: 6, delta: 6.1e-3, beta: -1.0}}
setting:
  epsilon: {{from: 3.0e-5, to: 3.0e-3, steps: {side}, log: true}}
  lam: 6.131e-3
  omega: {{from: 0.985, to: 1.015, steps: {side}}}
rung: harmonic_balance
tol: 1.0e-6
"""


def map_of_settings(side: int, rounds: int) -> dict[str, Any]:
    """``dotwave sweep`` of side x side settings to NPZ and PNG: the whole command, from its start to its end."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "map.yaml").write_text(MAP.format(side=side), encoding="utf-8")
        call = [sys.executable, "-c", "from dotwave.cli.app import main; main()", "sweep", "map.yaml", "-o", "map.npz"]
        call += ["--only", "epsilon,omega,outcome,phase_step_deg,stable", "--picture", "map.png", "--json"]
        walls, solving = [], []
        for _ in range(rounds + 1):
            began = time.perf_counter()
            done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=True)
            walls.append(time.perf_counter() - began)
            solving.append(json.loads(done.stdout)["seconds"])
    return {"settings": side * side, "wall_s": min(walls[1:]), "solved_and_written_s": min(solving[1:])}


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
