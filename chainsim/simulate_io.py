"""Chain files: one setting of one chain read from YAML, solved, and answered in plain JSON values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from .chain import Chain, Closure, CouplingKind, Setting
from .ladder import solve
from .response import Outcome, Response
from .rung import Start
from .yamlfile import parse_model, read_model

__all__ = ["Simulation", "parse_simulation", "read_simulation", "simulate"]

Finite = Annotated[float, Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
MAX_OSCILLATORS = 4096


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class _Grid(_Part):
    rows: Annotated[int, Field(ge=1, le=MAX_OSCILLATORS)]
    cols: Annotated[int, Field(ge=1, le=MAX_OSCILLATORS)]


class _Chain(_Part):
    grid: _Grid | None = None
    n: Annotated[int, Field(ge=1, le=MAX_OSCILLATORS)] | None = None
    delta: NotNegative | list[NotNegative]
    beta: Finite | list[Finite]
    stiffness: Finite | list[Finite] = 1.0
    closure: Closure = Closure.OPEN
    kind: CouplingKind = CouplingKind.RESISTOR

    @model_validator(mode="after")
    def _fits_together(self) -> _Chain:
        if (self.n is None) == (self.grid is None):
            raise ValueError("give either n, the length of a chain, or grid: {rows: ..., cols: ...}")
        if self.size > MAX_OSCILLATORS:
            raise ValueError(f"expected at most {MAX_OSCILLATORS} oscillators, got {self.size}")
        self.built()
        return self

    @property
    def size(self) -> int:
        """Number of oscillators."""
        return self.grid.rows * self.grid.cols if self.grid is not None else self.n or 0

    def built(self) -> Chain:
        return Chain.of(
            self.size, delta=self.delta, beta=self.beta, stiffness=self.stiffness, closure=self.closure,
            rows=self.grid.rows if self.grid is not None else 1, kind=self.kind,
        )  # fmt: skip


class _Setting(_Part):
    epsilon: Finite
    lam: Finite | list[Finite] = 0.0
    lam_x: Finite | list[list[Finite]] | None = None
    lam_y: Finite | list[list[Finite]] | None = None
    omega: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    preload: Finite = 0.0
    bias: Finite | list[Finite] = 0.0
    phase: Finite = 0.0

    def built(self, chain: Chain, grid: bool) -> Setting:
        links = self._of_grid(chain) if grid else self._of_chain(chain)
        if isinstance(self.bias, list) and len(self.bias) != chain.n:
            raise ValueError(f"setting.bias: expected a number or a list of {chain.n}, got a list of {len(self.bias)}")
        return Setting.of(
            chain, epsilon=self.epsilon, omega=self.omega, preload=self.preload, bias=self.bias, phase=self.phase,
            **links,
        )  # fmt: skip

    def _of_chain(self, chain: Chain) -> dict[str, Any]:
        if self.lam_x is not None or self.lam_y is not None:
            raise ValueError("setting.lam_x, lam_y: these are the links of a grid; give lam for a chain")
        wanted = chain.n if chain.closure is Closure.RING else chain.n - 1
        if isinstance(self.lam, list) and len(self.lam) != wanted:
            raise ValueError(f"setting.lam: expected a number or a list of {wanted}, got a list of {len(self.lam)}")
        return {"lam": self.lam if isinstance(self.lam, float) else np.array(self.lam, dtype=float).reshape(wanted)}

    def _of_grid(self, chain: Chain) -> dict[str, Any]:
        """`lam` is that of every link which `lam_x` (to the right) or `lam_y` (downwards) does not name."""
        if isinstance(self.lam, list):
            raise ValueError("setting.lam: a grid takes a number, or lam_x and lam_y")
        found = {}
        for name, given, shape in (
            ("lam", self.lam_x, (chain.rows, chain.cols - 1)), ("lam_y", self.lam_y, (chain.rows - 1, chain.cols)),
        ):  # fmt: skip
            links: Any = self.lam if given is None else given
            if isinstance(links, list) and [len(row) for row in links] != [shape[1]] * shape[0]:
                field = "lam_x" if name == "lam" else name
                raise ValueError(f"setting.{field}: expected a number or {shape[0]} lists of {shape[1]} numbers")
            found[name] = links if isinstance(links, float) else np.array(links, dtype=float).reshape(shape)
        # A grid of one row is a chain: it has no links downwards.
        return found if chain.rows > 1 else {"lam": np.ravel(found["lam"])} if chain.n > 1 else {"lam": 0.0}


class Simulation(_Part):
    """What a chain file asks for.

    Attributes
    ----------
    chain : n or grid, delta, beta, and optionally stiffness, closure, kind. setting : epsilon, lam (in a grid lam_x
        and lam_y), omega, and optionally preload, bias, phase.
    rung : a name in `RUNGS` or auto. tol : wanted accuracy. start : rest, ramp or all.
    """

    chain: _Chain
    setting: _Setting
    rung: Literal["auto", "static", "linear", "one_harmonic", "harmonic_balance", "envelope", "ode"] = "auto"
    tol: Annotated[float, Field(ge=1e-12, le=1)]
    start: Start = Start.REST

    @field_validator("setting")
    @classmethod
    def _fits_the_chain(cls, value: _Setting, info: ValidationInfo) -> _Setting:
        if "chain" in info.data:
            value.built(info.data["chain"].built(), info.data["chain"].grid is not None)
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
    setting = what.setting.built(chain, what.chain.grid is not None)
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
