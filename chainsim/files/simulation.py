"""Chain files: one setting of one chain read from YAML, solved, and answered in plain JSON values."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

from ..equations.chain import Chain, Setting
from ..rung import RUNGS, Start
from ..yamlfile import parse_model, read_model
from .answer import plain_of, plain_with_terms
from .chain_section import ChainSection
from .effects_section import TermsSection

__all__ = ["Simulation", "parse_simulation", "read_simulation", "simulate"]

Finite = Annotated[float, Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
MAX_OSCILLATORS = 4096

if TYPE_CHECKING:
    RungName = str
else:
    RungName = Literal["auto", *RUNGS]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class _Chain(ChainSection):
    most: ClassVar[int] = MAX_OSCILLATORS


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
        wanted = chain.law.count(chain.n)
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
    chain : n or grid, delta, beta, and optionally stiffness, closure, kind.
    setting : epsilon, lam (in a grid lam_x and lam_y), omega, and optionally preload, bias, phase.
    terms : what else the actuators do, see `TermsSection`; each off unless asked for.
    rung : a name in `RUNGS` or auto.
    tol : wanted accuracy.
    start : rest, ramp or all.
    """

    chain: _Chain
    setting: _Setting
    terms: TermsSection | None = None
    rung: RungName = "auto"
    tol: Annotated[float, Field(ge=1e-12, le=1)]
    start: Start = Start.REST

    @field_validator("setting")
    @classmethod
    def _fits_the_chain(cls, value: _Setting, info: ValidationInfo) -> _Setting:
        if "chain" in info.data:
            value.built(info.data["chain"].built(), info.data["chain"].grid is not None)
        return value

    @field_validator("terms")
    @classmethod
    def _tones_differ(cls, value: TermsSection | None, info: ValidationInfo) -> TermsSection | None:
        setting = info.data.get("setting")
        tones = [] if value is None or setting is None else [setting.omega, *(tone.omega for tone in value.tones or ())]
        if len(set(tones)) < len(tones):
            raise ValueError(f"tones: expected frequencies other than the setting's {tones[0]:g} and each other's")
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
    Some answers have more keys:

    start all : the first keys are of the lowest stable branch; `answers` lists every branch, and `complete` says
        whether each single-harmonic answer is among them.
    outcome not_locked : `beat`, with `omega`, the strongest line's beside the drive's less the drive's, `depth`,
        (largest - smallest)/largest amplitude, and `phasor` and `phase_step_deg` of the part that follows the drive.
    several tones : `lines`, of which k counts the tones, the setting's first: `k`, `omega`, `phasor`.
    creep : `drift`, the way to the end: `tau`, `mean` and `amplitude`; None where it was not followed.

    With terms, phasors are those of the tips, multipliers and branch are not known, and `stable` says whether the
    motion was reached by integration (None for rung harmonic_balance, which does not look).

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
    if what.terms is None:
        return plain_of(chain, setting, tol=what.tol, rung=what.rung, start=what.start)
    terms = what.terms.built(setting)
    return plain_with_terms(chain, setting, terms, tol=what.tol, rung=what.rung, start=what.start)
