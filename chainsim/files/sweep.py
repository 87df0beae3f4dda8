"""Sweep files: one chain and many settings of it, as ranges in YAML or as a table beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator

from ..equations.chain import Chain, Setting
from ..errors import ProfileError
from ..yamlfile import read_model
from .chain_section import ChainSection
from .sweep_table import AXES, read_table

__all__ = ["SettingSweep", "read_sweep"]

Floats = NDArray[np.float64]
Finite = Annotated[float, Field(allow_inf_nan=False)]
MOST_STEPS = 10_000_000
MOST_SETTINGS = 1_000_000_000


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class _Range(_Part):
    start: Annotated[Finite, Field(alias="from")]
    to: Finite
    steps: Annotated[int, Field(ge=1)]
    log: bool = False

    @model_validator(mode="after")
    def _can_be_made(self) -> _Range:
        if self.steps > MOST_STEPS:
            raise ValueError(
                f"expected at most {MOST_STEPS} steps, got {self.steps}; take fewer, or sweep a part at a time"
            )
        if not math.isfinite(self.to - self.start):
            raise ValueError(f"from {self.start} to {self.to} is too far for numbers of a computer; take a part of it")
        if self.log and min(self.start, self.to) <= 0:
            raise ValueError(f"a log range needs ends > 0, got {self.start} and {self.to}")
        return self

    def values(self) -> Floats:
        if not self.log:
            return np.linspace(self.start, self.to, self.steps)
        made = np.exp(np.linspace(math.log(self.start), math.log(self.to), self.steps))
        made[0], made[-1] = self.start, self.to if self.steps > 1 else self.start
        return made


def _kind(value: object) -> str:
    return "range" if isinstance(value, dict | _Range) else "number"


_Axis = Annotated[Annotated[Finite, Tag("number")] | Annotated[_Range, Tag("range")], Discriminator(_kind)]


def _lam_kind(value: object) -> str:
    return "links" if isinstance(value, list) else _kind(value)


_Links = Annotated[
    Annotated[Finite, Tag("number")] | Annotated[_Range, Tag("range")] | Annotated[list[Finite], Tag("links")],
    Discriminator(_lam_kind),
]


class _Setting(_Part):
    table: str | None = None
    epsilon: _Axis | None = None
    lam: _Links | None = None
    lam_y: Finite | None = None
    omega: _Axis | None = None
    preload: Finite = 0.0
    bias: Finite | list[Finite] = 0.0
    phase: Finite = 0.0


class _File(_Part):
    chain: ChainSection
    setting: _Setting
    rung: Literal["auto", "harmonic_balance"] = "auto"
    tol: Annotated[float, Field(ge=1e-12, le=1)]
    start: Literal["rest"] = "rest"


@dataclass(frozen=True)
class SettingSweep:
    """Many settings of one chain.

    Attributes
    ----------
    chain : what was built.
    tol : wanted accuracy.
    from_rest : what a sudden drive reaches (rung auto), or the lower branch (rung harmonic_balance).
    columns : epsilon, lam, omega; float64, shape (a,), (b, 1 or links), (c,). As ranges each has its own length, the
        settings are all combinations and omega changes fastest; as a table (`shape` of one number) all have the same.
    shape : numbers of epsilon, lam and omega; or of the table's rows.
    fixed : preload, bias and phase; of a grid also lam_y, unless its links downwards are those to the right.
    """

    chain: Chain
    tol: float
    from_rest: bool
    columns: tuple[Floats, Floats, Floats]
    shape: tuple[int, ...]
    fixed: dict[str, Any]

    def __len__(self) -> int:
        return math.prod(self.shape)

    def settings(self, first: int, last: int) -> Setting:
        """Settings first..last-1."""
        places = np.unravel_index(np.arange(first, min(last, len(self))), self.shape)
        picked = places if len(places) == 3 else places * 3
        epsilon, lam, omega = (column[at] for column, at in zip(self.columns, picked, strict=True))
        if self.chain.rows > 1:
            lam = lam[:, :, None]
            return Setting.of(self.chain, epsilon=epsilon, lam=lam, omega=omega, **{"lam_y": lam, **self.fixed})
        return Setting.of(self.chain, epsilon=epsilon, lam=lam, omega=omega, **self.fixed)


def read_sweep(path: Path) -> SettingSweep:
    """Read a sweep file, and the table it names (relative to itself).

    ``epsilon``, ``lam`` and ``omega`` are each a number or ``{from, to, steps, log}``; ``lam`` may be a list of links.
    A grid has one ``lam`` for all its links, or a number ``lam_y`` beside it for those downwards.
    ``table`` names an NPZ or a CSV with any of them as columns (links: ``lam_1``, ``lam_2``, ...; in NPZ one array with
    a column each); what the table lacks is a number beside it.

    Raises
    ------
    ProfileError
        When a file cannot be read or does not fit; the message starts with the place.
    """
    given = read_model(path, _File)
    chain, asked = given.chain.built(), given.setting
    table = {} if asked.table is None else read_table(path.parent / asked.table)
    columns = [_column(path, asked, table, name) for name in AXES]
    if table:
        rows = len(next(iter(table.values())))
        columns = [np.broadcast_to(c, (rows, *c.shape[1:])) if len(c) == 1 else c for c in columns]
    shape = (rows,) if table else tuple(len(column) for column in columns)
    if math.prod(shape) > MOST_SETTINGS:
        sizes = " x ".join(map(str, shape))
        raise ProfileError(
            f"{path}: setting: {sizes} = {math.prod(shape)} settings; a sweep has at most {MOST_SETTINGS}; "
            "take fewer steps, or sweep a part at a time"
        )
    fixed: dict[str, Any] = {"preload": asked.preload, "bias": np.asarray(asked.bias), "phase": asked.phase}
    if asked.lam_y is not None:
        fixed["lam_y"] = asked.lam_y
    if chain.rows > 1 and columns[1].shape[1] != 1:
        raise ProfileError(f"{path}: setting.lam: a grid takes one number for all its links, got {columns[1].shape[1]}")
    made = SettingSweep(chain, given.tol, given.rung == "auto", (columns[0], columns[1], columns[2]), shape, fixed)
    try:
        made.settings(0, 1)
        if np.any(columns[2] <= 0):
            raise ValueError(f"setting.omega: expected a number > 0, got {columns[2].min()}")
    except ValueError as error:
        raise ProfileError(f"{path}: {error}") from None
    return made


def _column(path: Path, asked: _Setting, table: dict[str, Floats], name: str) -> Floats:
    """One axis, its values along the first dimension; links along the second."""
    value = getattr(asked, name)
    if name in table:
        if value is not None:
            raise ProfileError(f"{path}: setting.{name}: given here and in the table; keep one")
        found = table[name]
        return found[:, None] if name == "lam" and found.ndim == 1 else found
    if value is None:
        if name == "lam":
            value = 0.0
        else:
            raise ProfileError(
                f"{path}: setting.{name}: expected a number, a range {{from, to, steps}} or a table column"
            )
    if isinstance(value, _Range):
        if table:
            raise ProfileError(f"{path}: setting.{name}: a range beside a table; give one number")
        made = value.values()
    else:
        made = np.array([value], dtype=np.float64)
    return made.reshape(len(made), -1) if name == "lam" else made
