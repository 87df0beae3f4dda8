"""`dotwave reach`: which kinds of patterns a device makes, how fast, how surely and at what drive."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import Any

from chainsim import Device
from planner import KINDS, ReachRow, WaveMap, reach_row, wave_map

from ..errors import AppError
from ..progress import progress
from ..reports.html import html_table

__all__ = ["ReachReport", "reach_of"]

HEAD = ("kind", "made", "way in", "error", "drive", "well", "noise", "yield")


@dataclass(frozen=True, repr=False)
class ReachReport:
    """What a device can make.

    Attributes
    ----------
    device : its name.
    rows : of every kind of patterns what came of a few, each really planned from rest.
    waves : which waves stand on a chain; None where actuators are alone.
    spread : standard deviation of natural frequencies that `yield` stands for; None where none was given.
    """

    device: str
    rows: tuple[ReachRow, ...]
    waves: WaveMap | None
    spread: float | None = None
    seconds: float = 0.0

    def __repr__(self) -> str:
        made = [row.kind for row in self.rows if row.made == row.tried]
        return f"<Reach: {self.device} makes {', '.join(made) or 'nothing that was tried'}>"

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        waves = None
        if self.waves is not None:
            lags, levels = list(self.waves.lags_deg), list(self.waves.levels)
            waves = {"lags_deg": lags, "levels": levels, "stands": self.waves.stands.tolist()}
        rows = [
            {("yield" if key == "yield_" else key): value for key, value in asdict(row).items()} for row in self.rows
        ]
        return {"device": self.device, "spread": self.spread, "kinds": rows, "waves": waves, "seconds": self.seconds}

    def as_text(self) -> str:
        """A table of kinds, what is lacking for those that are not made, and the map."""
        return "\n".join(self._lines())

    def table(self) -> list[tuple[str, ...]]:
        """The table's cells in words, without its head."""
        return [_cells(row) for row in self.rows]

    def map_lines(self) -> list[str]:
        """The map in letters: o stands, . does not; nothing where there is none."""
        if self.waves is None:
            return []
        lines = ["level   lag in degrees", "        " + " ".join(f"{lag:3d}" for lag in self.waves.lags_deg)]
        for level, row in zip(self.waves.levels, self.waves.stands, strict=True):
            lines.append(f"{level:5g}   " + " ".join("  o" if stands else "  ." for stands in row))
        return lines

    def lacking(self) -> list[str]:
        """A sentence for every kind that is not made, or not always."""
        return [f"{row.kind}: {row.lacking}" for row in self.rows if row.lacking]

    def _lines(self) -> list[str]:
        rows = [HEAD, *self.table()]
        widths = [max(len(row[column]) for row in rows) for column in range(len(HEAD))]
        spread = "" if self.spread is None else f", natural frequencies spread by {100 * self.spread:g} %"
        lines = [f"What {self.device} makes, a few patterns of each kind planned from rest{spread}:"]
        lines += ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
        lines += [f"- {one}" for one in self.lacking()]
        if self.waves is not None:
            lines += ["Waves that stand on a chain (o), whatever their way in:", *self.map_lines()]
        return [*lines, f"Time taken: {self.seconds:.3g} s."]

    def _repr_html_(self) -> str:
        return html_table(f"What {self.device} makes", HEAD, self.table())


def _cells(row: ReachRow) -> tuple[str, ...]:
    made = f"{row.made} of {row.tried}" + (", as carriers swell" if row.modulated else "")
    if not row.made:
        return (row.kind, made, *("-",) * 6)
    share = "-" if row.yield_ is None else f"{100 * row.yield_:.0f} %"
    return (
        row.kind, made, f"{row.way_in_s:.3g} s", f"{100 * row.error:.2g} %", f"{100 * row.volts:.2g} %",
        f"{100 * row.well:.2g} %", f"{row.noise_gain:.1e}", share,
    )  # fmt: skip


def reach_of(device: Device, spread: float | None = None) -> ReachReport:
    """Plan a few patterns of every kind on a device.

    Raises
    ------
    AppError
        When the spread is not above 0 and below 1.
    """
    if spread is not None and not 0 < spread < 1:
        raise AppError(f"spread: expected a share above 0 and below 1 such as 0.01, got {spread:g}")
    began, rows = time.perf_counter(), []
    with progress("planning") as update:
        for number, kind in enumerate(KINDS):
            rows.append(reach_row(kind, device, spread))
            update(number + 1, len(KINDS) + 1)
        waves = wave_map(device)
    return ReachReport(device.name, tuple(rows), waves, spread, time.perf_counter() - began)
