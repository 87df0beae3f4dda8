"""The section `chain` of the YAML files people write, for one setting of a chain or a sweep of it."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..equations.chain import Chain
from ..equations.coupling import Closure, CouplingKind

__all__ = ["ChainSection", "GridSection"]

Finite = Annotated[float, Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Length = Annotated[int, Field(ge=1)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class GridSection(_Part):
    """Rows and columns of a grid."""

    rows: Length
    cols: Length


class ChainSection(_Part):
    """A chain of `n`, or a grid; `most` is the largest number of oscillators that its file may ask for."""

    most: ClassVar[int] = 1_000_000

    grid: GridSection | None = None
    n: Length | None = None
    delta: NotNegative | list[NotNegative]
    beta: Finite | list[Finite]
    stiffness: Finite | list[Finite] = 1.0
    closure: Closure = Closure.OPEN
    kind: CouplingKind = CouplingKind.RESISTOR

    @model_validator(mode="after")
    def _fits_together(self) -> ChainSection:
        if (self.n is None) == (self.grid is None):
            raise ValueError("give either n, the length of a chain, or grid: {rows: ..., cols: ...}")
        if self.size > self.most:
            raise ValueError(f"expected at most {self.most} oscillators, got {self.size}")
        self.built()
        return self

    @property
    def size(self) -> int:
        """Number of oscillators."""
        return self.grid.rows * self.grid.cols if self.grid is not None else self.n or 0

    def built(self) -> Chain:
        """The chain itself."""
        return Chain.of(
            self.size, delta=self.delta, beta=self.beta, stiffness=self.stiffness, closure=self.closure,
            rows=self.grid.rows if self.grid is not None else 1, kind=self.kind,
        )  # fmt: skip
