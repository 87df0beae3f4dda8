"""Sixty long chains that amplify, followed in extended precision by a program that shares nothing with chainsim.

`python -m tests.support.long_chains` makes tests/data/long_chains.json again: numbers of 19 digits, and of 34 where
those do not settle. It needs gcc and about ten minutes of a core.
"""

from __future__ import annotations

import json
import math
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

__all__ = ["DATA", "LongChain", "Reached", "compiled", "drawn", "kept", "reached"]

HERE = Path(__file__).parent
DATA = HERE.parent / "data" / "long_chains.json"
COMMAND = "python -m tests.support.long_chains"
COUNT, SEED, WORKERS = 60, 2, 4
REALS = {19: "long double", 34: "_Float128"}
FOLDS = 500  # E-folds of an oscillator's own decay after which what has not settled is called not locked.


@dataclass(frozen=True)
class LongChain:
    """An open chain of equal oscillators and its setting."""

    n: int
    delta: float
    beta: float
    epsilon: float
    lam: float
    omega: float

    @property
    def gain(self) -> float:
        """By how much a disturbance at resonance grows along it."""
        return (self.lam / self.delta) ** (self.n - 1)

    @property
    def periods(self) -> int:
        """After which it is given up."""
        return int(FOLDS * self.omega / (math.pi * self.delta))


@dataclass(frozen=True)
class Reached:
    """What a chain reaches from rest: ok, escaped or not_locked, after how many periods, in numbers of how many digits.

    re, im : of every first harmonic, empty unless ok.
    """

    outcome: str
    period: int
    digits: int
    re: list[float]
    im: list[float]


def drawn() -> list[LongChain]:
    """The chains: n 8..24, lam/delta 1.5..4."""
    rng, found = np.random.default_rng(SEED), []
    for _ in range(COUNT):
        n, ratio = int(rng.integers(8, 25)), rng.uniform(1.5, 4)
        delta = 10 ** rng.uniform(np.log10(6e-3), np.log10(2e-2))
        omega, epsilon = 1 + rng.uniform(-0.07, 0.07), 10 ** rng.uniform(-5, -2.5)
        beta = -1.0 if rng.random() < 0.8 else 1.0
        found.append(LongChain(n, *(float(f"{x:.6g}") for x in (delta, beta, epsilon, ratio * delta, omega))))
    return found


def compiled(folder: Path, digits: int) -> Path:
    """The program in numbers of 19 or 34 digits."""
    program = folder / f"long_chain_{digits}"
    source = HERE / "long_chain.c"
    command = ["gcc", "-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", f"-DREAL={REALS[digits]}", "-o", str(program)]
    subprocess.run([*command, str(source)], check=True)
    return program


def reached(program: Path, chain: LongChain, digits: int) -> Reached:
    """What the program says."""
    given = [str(value) for value in asdict(chain).values()]
    told = subprocess.run([str(program), *given, str(chain.periods)], check=True, capture_output=True, text=True)
    outcome, period, *parts = told.stdout.split()
    numbers = [float(f"{float(part):.10g}") for part in parts] if outcome == "ok" else []
    return Reached(outcome, int(period), digits, numbers[::2], numbers[1::2])


def kept() -> list[tuple[LongChain, Reached]]:
    """What DATA holds."""
    held = json.loads(DATA.read_text("utf-8"))
    return [(LongChain(**each["chain"]), Reached(**each["reached"])) for each in held["chains"]]


def main() -> None:
    """Make DATA again."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(WORKERS) as pool:
        programs = {digits: compiled(Path(folder), digits) for digits in REALS}

        def row(chain: LongChain) -> str:
            for digits, program in programs.items():
                found = reached(program, chain, digits)
                if found.outcome != "not_locked":
                    break
            print(f"{chain}: {found.outcome} after {found.period} periods, {found.digits} digits", flush=True)
            return json.dumps({"chain": asdict(chain), "reached": asdict(found)})

        lines = ",\n".join(pool.map(row, drawn()))
    DATA.write_text(f'{{"made_by": "{COMMAND}",\n"chains": [\n{lines}\n]}}\n', "utf-8")


if __name__ == "__main__":
    main()
