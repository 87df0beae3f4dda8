"""Other tools on the same problem, at equal error; one that is not here is said to be missing, and why.

Times are of the processor, so that other work on the machine counts for nobody; each peer has one core.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from problem import CHAIN, PERIODS, median_error, settings

from chainsim import Setting, solve

__all__ = ["PEERS", "Missing"]

Floats = NDArray[np.float64]
HERE = Path(__file__).resolve().parent
PYHARM = HERE.parent / ".venv-pyharm" / "bin" / "python"
# Six to a decade, so that nobody is asked for much more than the goal.
_TOLERANCES = tuple(10 ** (-6 - k / 6) for k in range(22))


class Missing(Exception):
    """A peer cannot be measured here, with the reason."""


def scipy_dop853(wanted: Floats, goal: float) -> dict[str, Any]:
    """scipy.integrate.solve_ivp, DOP853, a right side compiled by numba; three chains."""
    from numba import njit
    from scipy.integrate import solve_ivp

    delta, n = CHAIN.delta, CHAIN.n

    @njit
    def slope(tau: float, y: Floats, epsilon: float, lam: Floats, omega: float) -> Floats:
        out = np.empty(2 * n)
        for m in range(n):
            z = y[m]
            push = epsilon * np.cos(omega * tau) if m == 0 else lam[m] * (y[m - 1] - z)
            out[m], out[n + m] = y[n + m], push - delta * y[n + m] - z + z * z * z
        return out

    asked = settings(3)

    def run(tolerance: float) -> tuple[float, float]:
        states, began = [], time.process_time()
        for i in range(3):
            given = (asked.epsilon[i], asked.lam[i], asked.omega[i])
            end = PERIODS * asked.period[i]
            done = solve_ivp(
                slope, (0, end), np.zeros(2 * n), method="DOP853", rtol=tolerance, atol=tolerance / 100, args=given
            )
            states.append(done.y[:, -1])
        return (time.process_time() - began) / 3, median_error(np.array(states), wanted[:3])

    slope(0.0, np.zeros(2 * n), 1e-4, asked.lam[0], 1.0)
    return _at_equal_error(run, goal, _TOLERANCES)


def heyoka_batch(wanted: Floats, goal: float) -> dict[str, Any]:
    """heyoka, batches of eight, one core; 64 chains."""
    try:
        import heyoka as hy
    except ImportError:
        raise Missing("heyoka is not installed: pip install heyoka") from None
    n, lanes, size = CHAIN.n, 8, 64
    asked = settings(size)
    z, v = hy.make_vars(*[f"z{m}" for m in range(n)]), hy.make_vars(*[f"v{m}" for m in range(n)])
    system = []
    for m in range(n):
        push = hy.par[0] * hy.cos(hy.par[2] * hy.time) if m == 0 else hy.par[1] * (z[m - 1] - z[m])
        system += [(z[m], v[m]), (v[m], push - CHAIN.delta * v[m] - z[m] + z[m] * z[m] * z[m])]

    def run(tolerance: float) -> tuple[float, float]:
        made = hy.taylor_adaptive_batch(system, np.zeros((2 * n, lanes)), tol=tolerance, compact_mode=True)
        states, seconds = np.empty((size, 2 * n)), 0.0
        for first in range(0, size, lanes):
            part = slice(first, first + lanes)
            made.set_time(0.0)
            made.state[:] = 0.0
            made.pars[:] = np.stack([asked.epsilon[part], asked.lam[part, 1], asked.omega[part]])
            began = time.process_time()
            made.propagate_until(PERIODS * asked.period[part])
            seconds += time.process_time() - began
            states[part, :n], states[part, n:] = made.state[0::2].T, made.state[1::2].T
        return seconds / size, median_error(states, wanted[:size])

    return _at_equal_error(run, goal, _TOLERANCES)


def numbalsoda_dop853(wanted: Floats, goal: float) -> dict[str, Any]:
    """numbalsoda, dop853 in Fortran behind a compiled loop; 64 chains."""
    try:
        import numba as nb
        from numbalsoda import dop853, lsoda_sig
    except ImportError:
        raise Missing("numbalsoda is not installed: pip install numbalsoda (needs gfortran and cmake)") from None
    # It stops after 10,000 steps of one call.
    n, delta, size, hop = CHAIN.n, CHAIN.delta, 64, 30
    asked = settings(size)

    @nb.cfunc(lsoda_sig)
    def slope(tau, y_, out_, given_):  # type: ignore[no-untyped-def]
        y, out, given = nb.carray(y_, (2 * n,)), nb.carray(out_, (2 * n,)), nb.carray(given_, (3,))
        for m in range(n):
            push = given[0] * np.cos(given[2] * tau) if m == 0 else given[1] * (y[m - 1] - y[m])
            out[m], out[n + m] = y[n + m], push - delta * y[n + m] - y[m] + y[m] * y[m] * y[m]

    def run(tolerance: float) -> tuple[float, float]:
        states, began = np.zeros((size, 2 * n)), time.process_time()
        for i in range(size):
            given = np.array([asked.epsilon[i], asked.lam[i, 1], asked.omega[i]])
            for first in range(0, PERIODS, hop):
                span = np.array([first, first + hop]) * asked.period[i]
                found, _ = dop853(slope.address, states[i], span, data=given, rtol=tolerance, atol=tolerance / 100)
                states[i] = found[-1]
        return (time.process_time() - began) / size, median_error(states, wanted[:size])

    run(1e-6)
    return _at_equal_error(run, goal, _TOLERANCES)


def boost_odeint(wanted: Floats, goal: float) -> dict[str, Any]:
    """Boost.odeint, controlled Runge-Kutta-Fehlberg 7(8), compiled here with -O3 -march=native; 64 chains."""
    compiler = shutil.which("g++")
    if compiler is None or not Path("/usr/include/boost/numeric/odeint.hpp").exists():
        raise Missing("needs g++ and Boost.odeint: apt-get install g++ libboost-dev")
    size, asked = 64, settings(64)
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "odeint"
        build = [compiler, "-O3", "-march=native", "-std=c++17", str(HERE / "odeint.cpp"), "-o", str(program)]
        subprocess.run(build, check=True, capture_output=True)
        table = "\n".join(
            f"{e!r} {a!r} {o!r}"
            for e, a, o in zip(asked.epsilon.tolist(), asked.lam[:, 1].tolist(), asked.omega.tolist(), strict=True)
        )

        def run(tolerance: float) -> tuple[float, float]:
            call = [str(program), repr(CHAIN.delta), str(PERIODS), repr(tolerance)]
            done = subprocess.run(
                call,
                input=table,
                text=True,
                check=True,
                capture_output=True,
            )
            numbers = np.array(done.stdout.split(), dtype=np.float64)
            return float(numbers[0]) / size, median_error(numbers[1:].reshape(size, -1), wanted[:size])

        return _at_equal_error(run, goal, _TOLERANCES)


def pyharm(wanted: Floats, goal: float) -> dict[str, Any]:
    """pyHarm-os in its own environment: the harmonics of our kernel along a branch in omega, processor time a point."""
    if not PYHARM.exists():
        here = PYHARM.parent.parent
        raise Missing(f"pyHarm-os has no environment: python3 -m venv {here} && {here}/bin/pip install pyHarm-os")
    base = {"epsilon": 4e-4, "lam": 6.131e-3}
    asked = base | {
        "n": CHAIN.n, "delta": CHAIN.delta, "omega": [0.985, 1.015], "harmonics": [1, 3, 5], "points": 60, "step": 4e-4,
        "solver": "scipyroot",
    }  # fmt: skip
    # It leaves a folder where it runs.
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [str(PYHARM), "-W", "ignore", str(HERE / "pyharm_points.py")],
            input=json.dumps(asked), text=True, capture_output=True, check=False, cwd=folder,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )  # fmt: skip
    if done.returncode:
        raise Missing(f"pyHarm-os failed: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    told = json.loads(done.stdout.splitlines()[-1])
    ours = solve(CHAIN, Setting.of(CHAIN, **base, omega=told["omega"]), tol=1e-9, rung="harmonic_balance")
    size = np.abs(ours.phasor[0])
    error = float((np.abs(np.array(told["amplitude"]) - size) / size).max())
    return {"s_per_point_one_core": told["s_per_point"], "largest_error": error, "accepted": told["accepted"]}


def auto_07p(wanted: Floats, goal: float) -> dict[str, Any]:
    """AUTO-07p: steady states with multipliers along a branch in epsilon, 20 intervals, processor time a point."""
    program = shutil.which("auto-07p")
    if program is None or shutil.which("gfortran") is None:
        raise Missing("AUTO-07p is not installed: apt-get install auto-07p gfortran")
    with tempfile.TemporaryDirectory() as folder:
        for name in ("chain.f90", "c.chain"):
            shutil.copy(HERE / "auto" / name, folder)

        def run(points: int) -> float:
            script = Path(folder) / "run.auto"
            script.write_text(f"run(e='chain', c='chain', NMX={points})\n", encoding="utf-8")
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            alone = {**os.environ, "OMP_NUM_THREADS": "1"}
            done = subprocess.run(
                [program, "run.auto"], cwd=folder, capture_output=True, text=True, env=alone, check=True
            )
            if not any(line.split()[:2] == ["1", str(points)] for line in done.stdout.splitlines()):
                raise Missing(f"AUTO-07p stopped before point {points}")
            return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before

        run(20)
        # The difference leaves out what starting takes.
        return {"s_per_point_one_core": (run(60) - run(20)) / 40}


def _at_equal_error(run: Any, goal: float, tolerances: tuple[float, ...]) -> dict[str, Any]:
    """The first (loosest) tolerance whose median error is within `goal`, or the last one, said so."""
    for tolerance in tolerances:
        seconds, error = run(tolerance)
        if error <= goal:
            break
    return {
        "tolerance": tolerance, "median_error": error, "reached": bool(error <= goal), "s_per_chain_one_core": seconds,
        "chain_periods_per_s_one_core": PERIODS / seconds,
    }  # fmt: skip


PEERS = {
    "scipy DOP853": scipy_dop853, "heyoka batch 8": heyoka_batch, "numbalsoda dop853": numbalsoda_dop853,
    "Boost.odeint rkf78": boost_odeint, "pyHarm-os": pyharm, "AUTO-07p": auto_07p,
}  # fmt: skip
