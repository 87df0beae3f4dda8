"""Peers that follow a branch of steady states: processor time a point, at an error of at most the goal."""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from integrators import Missing
from problem import CHAIN, states_error

from chainsim import Setting, solve

__all__ = ["CONTINUATIONS", "PYHARM", "auto_07p", "pyharm"]

HERE = Path(__file__).resolve().parent
PYHARM = HERE.parent / ".venv-pyharm" / "bin" / "python"
ALONE = {"OMP_NUM_THREADS": "1"}
# Intervals and collocation points of AUTO.
MESHES = ((10, 4), (8, 4), (6, 4), (5, 5))
ROUNDS = 3


def pyharm(goal: float) -> dict[str, Any]:
    """pyHarm-os in its own environment, along a branch in omega."""
    if not PYHARM.exists():
        here = PYHARM.parent.parent
        raise Missing(f"pyHarm-os has no environment: python3 -m venv {here} && {here}/bin/pip install pyHarm-os")
    base = {"epsilon": 4e-4, "lam": 6.131e-3}
    solvers: tuple[tuple[str, dict[str, float]], ...] = (
        ("scipyroot", {}),
        ("NewtonRaphson", {"tol_residual": 1e-9, "tol_delta_x": 1e-5}),
    )
    ways = [
        {"harmonics": harmonics, "samples": 16, "solver": solver, "options": options, "predictor": predictor,
         "corrector": corrector}
        for harmonics, (solver, options), predictor, corrector in product(
            ([1, 3], [1, 3, 5]), solvers, ("tangent", "secant"), ("arc_length", "pseudo_arc_length")
        )
    ]  # fmt: skip
    asked = base | {"n": CHAIN.n, "delta": CHAIN.delta, "omega": [0.985, 1.015], "points": 60, "step": 4e-4}
    # It leaves a folder where it runs.
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [str(PYHARM), "-W", "ignore", str(HERE / "pyharm_points.py")], input=json.dumps(asked | {"ways": ways}),
            text=True, capture_output=True, check=False, cwd=folder, env=os.environ | ALONE,
        )  # fmt: skip
    if done.returncode:
        raise Missing(f"pyHarm-os failed: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    version, told = json.loads(done.stdout.splitlines()[-1])
    found = []
    for way, each in zip(ways, told, strict=True):
        ours = solve(CHAIN, Setting.of(CHAIN, **base, omega=each["omega"]), tol=1e-9, rung="harmonic_balance")
        size = np.abs(ours.phasor[0])
        error = float((np.abs(np.array(each["amplitude"]) - size) / size).max()) if each["accepted"] else np.inf
        words = ", ".join(f"{name} {value}" for name, value in way.items())
        found.append(_point(f"pyHarm-os {version}, {words}", each["s_per_point"], error, goal))
    return _cheapest(found)


def auto_07p(goal: float) -> dict[str, Any]:
    """AUTO-07p, steady states with multipliers along a branch in epsilon, derivatives given."""
    program = shutil.which("auto-07p")
    if program is None or shutil.which("gfortran") is None:
        raise Missing("AUTO-07p is not installed: apt-get install auto-07p gfortran")
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for name in ("chain.f90", "c.chain"):
            shutil.copy(HERE / "auto" / name, folder)
        for intervals, points in MESHES:
            mesh = f"NTST={intervals}, NCOL={points}"

            def run(count: int, mesh: str = mesh) -> float:
                return _auto(program, Path(folder), count, mesh)

            run(20)
            # The difference leaves out what starting takes.
            seconds = (min(run(60) for _ in range(ROUNDS)) - min(run(20) for _ in range(ROUNDS))) / 40
            run(60)
            error = _auto_error(Path(folder) / "s.found")
            words = f"AUTO-07p, {mesh}, EPSL=EPSU=1e-9, JAC=1 (derivatives given), with multipliers (ISP=2)"
            found.append(_point(words, seconds, error, goal))
    return _cheapest(found)


def _auto(program: str, folder: Path, count: int, mesh: str) -> float:
    """Processor seconds of a branch of `count` points, its last one kept in s.found."""
    script = f"run(e='chain', c='chain', NMX={count}, NPR={count}, {mesh})\nsave('found')\n"
    (folder / "run.auto").write_text(script, encoding="utf-8")
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run(
        [program, "run.auto"], cwd=folder, capture_output=True, text=True, env=os.environ | ALONE, check=True
    )
    if not any(line.split()[:2] == ["1", str(count)] for line in done.stdout.splitlines()):
        raise Missing(f"AUTO-07p stopped before point {count}")
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def _auto_error(path: Path) -> float:
    """Of the last solution in a file of AUTO, at the beginning of its period: the worst oscillator's."""
    lines = path.read_text(encoding="utf-8").splitlines()
    at = 0
    while at < len(lines):
        # The ninth number of a header is the lines of its solution, the twelfth its parameters.
        header = [int(word) for word in lines[at].split()]
        words = " ".join(lines[at + 1 : at + 1 + header[8]]).replace("D", "E").split()
        numbers, at = np.array(words, dtype=np.float64), at + 1 + header[8]
    state, (epsilon, lam, omega) = numbers[1 : 3 + 2 * CHAIN.n], numbers[-header[11] :][:3]
    turn = np.exp(1j * np.arctan2(state[-1], state[-2]))
    ours = solve(CHAIN, Setting.of(CHAIN, epsilon=epsilon, lam=lam, omega=omega), tol=1e-12, rung="harmonic_balance")
    first, third = ours.phasor * turn, ours.third * turn**3
    wanted = np.concatenate([(first + third).real, (1j * omega * (first + 3 * third)).real], axis=1)
    return float(states_error(state[None, : 2 * CHAIN.n], wanted)[0])


def _point(words: str, seconds: float, error: float, goal: float) -> dict[str, Any]:
    return {"settings": words, "s_per_chain": seconds, "largest_error": error, "reached": bool(error <= goal)}


def _cheapest(found: list[dict[str, Any]]) -> dict[str, Any]:
    best = min(found, key=lambda each: (not each["reached"], each["s_per_chain"]))
    return best | {"tried": {each["settings"]: each["s_per_chain"] for each in found}}


CONTINUATIONS: dict[str, Callable[[float], dict[str, Any]]] = {"pyHarm-os": pyharm, "AUTO-07p": auto_07p}
