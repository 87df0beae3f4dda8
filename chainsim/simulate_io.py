"""Chain files: one setting of one chain read from YAML, solved, and answered in plain JSON values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

from .chain import Chain, Closure, Setting
from .ladder import solve
from .response import Outcome, Response
from .rung import Start
from .yamlfile import parse_model, read_model

__all__ = ["Simulation", "parse_simulation", "read_simulation", "simulate"]

Finite = Annotated[float, Field(allow_inf_nan=False)]
MAX_OSCILLATORS = 4096


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class _Chain(_Part):
    n: Annotated[int, Field(ge=1, le=MAX_OSCILLATORS)]
    delta: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    beta: Finite
    closure: Closure = Closure.OPEN

    def built(self) -> Chain:
        return Chain(self.n, self.delta, self.beta, self.closure)


class _Setting(_Part):
    epsilon: Finite
    lam: Finite | list[Finite] = 0.0
    omega: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    preload: Finite = 0.0
    bias: Finite | list[Finite] = 0.0
    phase: Finite = 0.0

    def built(self, chain: Chain) -> Setting:
        links = chain.n if chain.closure is Closure.RING else chain.n - 1
        for name, value, wanted in (("lam", self.lam, links), ("bias", self.bias, chain.n)):
            if isinstance(value, list) and len(value) != wanted:
                raise ValueError(f"setting.{name}: expected a number or a list of {wanted}, got a list of {len(value)}")
        lam: Any = self.lam if isinstance(self.lam, float) else np.array(self.lam, dtype=np.float64).reshape(links)
        return Setting.of(
            chain, epsilon=self.epsilon, lam=lam, omega=self.omega,
            preload=self.preload, bias=self.bias, phase=self.phase,
        )  # fmt: skip


class Simulation(_Part):
    """What a chain file asks for.

    Attributes
    ----------
    chain : n, delta, beta, closure. setting : epsilon, lam, omega and optionally preload, bias, phase.
    rung : a name in `RUNGS` or auto. tol : wanted accuracy. start : rest, ramp or all.
    """

    grid: Any = None
    chain: _Chain
    setting: _Setting
    rung: Literal["auto", "static", "linear", "one_harmonic", "harmonic_balance", "ode"] = "auto"
    tol: Annotated[float, Field(ge=1e-12, le=1)]
    start: Start = Start.REST

    @field_validator("grid")
    @classmethod
    def _no_grid(cls, value: object) -> object:
        if value is not None:
            raise ValueError("a 2-D grid of coupled oscillators is not solved here; give one row as chain:")
        return value

    @field_validator("setting")
    @classmethod
    def _fits_the_chain(cls, value: _Setting, info: ValidationInfo) -> _Setting:
        if "chain" in info.data:
            value.built(info.data["chain"].built())
        return value


def read_simulation(path: Path) -> Simulation:
    """Read a chain file.

    Raises
    ------
    ProfileError
        When the file cannot be read or does not fit: ``file:line: field: what is wrong``.
    """
    return read_model(path, Simulation)


def parse_simulation(text: str, name: str) -> Simulation:
    """Read the text of a chain file; `name` stands for the file in messages.

    Raises
    ------
    ProfileError
        As `read_simulation`.
    """
    return parse_model(text, name, Simulation)


def simulate(what: Path | Simulation | Mapping[str, Any]) -> dict[str, Any]:
    """Solve what a chain file, or the same in plain values, asks for.

    Returns
    -------
    dict of plain JSON values: outcome, rung, phasor, phase_step_deg, third, mean, stable, locked, multipliers, branch,
    error_estimate, stats. Complex numbers are [re, im]; what is not known is None (null in JSON, which has no NaN).
    With start ``all`` these are of the lowest stable branch, and `answers` lists every branch.

    Raises
    ------
    ProfileError
        When the question does not fit.
    RungError
        When the rung cannot answer it.
    """
    if isinstance(what, Path):
        what = read_simulation(what)
    elif not isinstance(what, Simulation):
        what = parse_simulation(yaml.safe_dump(dict(what), sort_keys=False), "spec")
    chain = what.chain.built()
    setting = what.setting.built(chain)
    response = solve(chain, setting, tol=what.tol, rung=what.rung, start=what.start)
    answers = [_plain(response, index) for index in range(len(response))]
    if what.start is not Start.ALL:
        return answers[0]
    first = next((answer for answer in answers if answer["outcome"] == Outcome.OK), answers[0])
    return {**first, "answers": answers}


def _plain(response: Response, index: int) -> dict[str, Any]:
    stats = response.stats
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
        "stats": {
            "seconds": stats.seconds,
            "rhs_evals": stats.rhs_evals,
            "newton_steps": stats.newton_steps,
            "oscillators_solved": stats.oscillators_solved,
            "periods": stats.periods,
        },
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _numbers(values: NDArray[np.float64]) -> list[float | None]:
    return [_number(float(value)) for value in values]


def _pairs(values: NDArray[np.complex128]) -> list[list[float | None]]:
    known = np.isfinite(values)
    return [
        [float(value.real), float(value.imag)] if ok else [None, None] for value, ok in zip(values, known, strict=True)
    ]
