"""How every figure of this folder looks, and what it says about itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

__all__ = ["BLUE", "GREEN", "GREY", "ORANGE", "RED", "Finding", "Page", "sheet"]

BLUE, ORANGE, GREEN, RED, GREY = "#2458a6", "#d9791a", "#2f8f5b", "#b8322f", "#8a8a8a"


@dataclass(frozen=True)
class Finding:
    """One number beside the paper's: `paper` is "" where the paper gives none."""

    what: str
    ours: str
    paper: str = ""


@dataclass(frozen=True)
class Page:
    """A figure with its title, its numbers and an honest sentence on what fits and what is inferred."""

    name: str
    title: str
    verdict: str
    findings: list[Finding] = field(default_factory=list)

    def text(self) -> str:
        """As Markdown."""
        rows = [f"| {f.what} | {f.ours} | {f.paper or '-'} |" for f in self.findings]
        table = ["| quantity | here | paper |", "|---|---|---|", *rows] if rows else []
        return "\n".join([f"## {self.title}", "", f"![{self.name}]({self.name}.png)", "", *table, "", self.verdict, ""])


def sheet(
    out: Path, name: str, shape: tuple[int, int], size: tuple[float, float], paint: Callable[[Any], None]
) -> None:
    """Make ``out/name.png`` with axes of `shape` (rows, columns), filled by `paint`."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    style: Any = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False,
             "axes.titlesize": 10, "axes.titlelocation": "left"}  # fmt: skip
    with pyplot.rc_context(style):
        figure, axes = pyplot.subplots(*shape, figsize=size, squeeze=False, layout="constrained")
        paint(axes)
        figure.savefig(out / f"{name}.png", dpi=130)
        pyplot.close(figure)
