"""What an as-built study found, as values, as JSON and as plain text."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reports.report import plain
from ..reports.text import decibels
from .verdict import Verdict

__all__ = ["AsBuiltReport", "EffectAlone"]

Floats = NDArray[np.float64]

QUANTILES = (0.05, 0.5, 0.95)
BARS, BAR_WIDTH = 10, 40


@dataclass(frozen=True)
class EffectAlone:
    """What one effect does alone.

    Attributes
    ----------
    name : as `explain` calls it.
    devices : how many were tried; 1 where the effect is the same on all.
    assumed : whether its values are assumed, not measured.
    verdict : on these devices.
    """

    name: str
    devices: int
    assumed: bool
    verdict: Verdict

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        return {"effect": self.name, "devices": self.devices, "assumed": self.assumed, **_numbers(self.verdict)}

    def line(self) -> str:
        """One line for a person."""
        said = _numbers(self.verdict)
        share = f"{100 * said['yield']:.3g} % of {self.devices}" if self.devices > 1 else (
            "right on all alike" if said["yield"] else "wrong on all alike"
        )  # fmt: skip
        error = "unknown" if said["error"] is None else f"{100 * said['error']:.3g} %"
        middle = decibels(_quantiles(self.verdict.contrast_db)[1])
        mark = ", assumed" if self.assumed else ""
        return f"- {self.name}{mark}: {share}; contrast {middle}, error {error} of full scale (medians)."


@dataclass(frozen=True)
class AsBuiltReport:
    """What a waveform makes felt on many devices as built, by the full equations under its samples.

    Attributes
    ----------
    path : the samples file.
    device : name of the profile.
    devices, seed : how many were drawn, from what.
    verdict : on them, with all effects together.
    effects : each effect alone, and none at all.
    assumed : which values of the surroundings are assumed.
    seconds : time taken.
    """

    path: str
    device: str
    devices: int
    seed: int
    verdict: Verdict
    effects: tuple[EffectAlone, ...]
    assumed: tuple[str, ...]
    seconds: float

    @property
    def yield_(self) -> float:
        """Share of devices on which every dot is right and stands out as far as it should."""
        return float(np.mean(self.verdict.ok))

    @property
    def ok(self) -> bool:
        """Whether that is all of them."""
        return bool(self.verdict.ok.all())

    @property
    def worst_dot(self) -> tuple[int, int] | None:
        """Row and column, from 0, of the dot that is wrong on most devices; None where none is."""
        wrong = self.verdict.wrong
        row, col = np.unravel_index(int(np.argmax(wrong)), wrong.shape)
        return (int(row), int(col)) if wrong[row, col] else None

    @property
    def spoilers(self) -> tuple[str, ...]:
        """The effects that alone spoil some device, worst first."""
        shares = {one.name: float(np.mean(one.verdict.ok)) for one in self.effects}
        return tuple(sorted((name for name, share in shares.items() if share < 1), key=lambda name: shares[name]))

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types; contrasts are the quantiles 5, 50 and 95 %, null where there is none."""
        worst = self.worst_dot
        edges, counts = _histogram(self.verdict.contrast_db)
        return {
            "ok": self.ok, "path": self.path, "device": self.device, "devices": self.devices, "seed": self.seed,
            **_numbers(self.verdict),
            "worst_dot": None if worst is None else {
                "row": worst[0], "col": worst[1], "wrong_on": int(self.verdict.wrong[worst])
            },
            "wrong": self.verdict.wrong.tolist(),
            "histogram": {"edges_db": edges, "devices": counts},
            "spoilers": list(self.spoilers),
            "effects": [one.as_dict() for one in self.effects],
            "assumed": list(self.assumed), "seconds": self.seconds,
        }  # fmt: skip

    def as_text(self) -> str:
        """Lines of plain text: the verdict, the devices, then which effect spoils what."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        right = int(np.count_nonzero(self.verdict.ok))
        yield f"As built: {self.path} on {self.device}, {self.devices} devices drawn from seed {self.seed}."
        yield f"Yield: {100 * self.yield_:.3g} %; on {right} of {self.devices} every dot is right and clear."
        worst = self.worst_dot
        if worst is None:
            yield "Worst dot: none is wrong on any device."
        else:
            share = 100 * self.verdict.wrong[worst] / self.devices
            yield f"Worst dot: row {worst[0]}, column {worst[1]} (from 0), wrong on {share:.3g} % of devices."
        low, middle, high = map(decibels, _quantiles(self.verdict.contrast_db))
        yield f"Contrast: {middle} on half of the devices; {low} to {high} on nine of ten."
        if self.verdict.escaped.any():
            yield f"Left the softening well: {np.count_nonzero(self.verdict.escaped)} devices."
        yield from self._bars()
        yield f"Spoiled by: {', '.join(self.spoilers) or 'no effect alone'}."
        yield "Each effect alone:"
        yield from (one.line() for one in self.effects)
        yield f"Assumed, not measured: {', '.join(self.assumed) or 'nothing'}."
        yield f"Time taken: {self.seconds:.2f} s."

    def _bars(self) -> Iterator[str]:
        edges, counts = _histogram(self.verdict.contrast_db)
        if counts:
            yield "Devices by their lowest contrast:"
        for low, high, count in zip(edges, edges[1:], counts, strict=False):
            bar = "#" * math.ceil(BAR_WIDTH * count / max(counts))
            yield f"  {low:6.1f} to {high:6.1f} dB {count:6d} {bar}".rstrip()


def _numbers(verdict: Verdict) -> dict[str, Any]:
    error = verdict.error[np.isfinite(verdict.error)]
    return {
        "yield": float(np.mean(verdict.ok)),
        "contrast_db": [plain(value) for value in _quantiles(verdict.contrast_db)],
        "error": float(np.median(error)) if len(error) else None,
        "wrong_dots": float(np.mean(verdict.wrong_dots)),
        "escaped": int(np.count_nonzero(verdict.escaped)),
    }


def _quantiles(values: Floats) -> list[float | None]:
    known = values[~np.isnan(values)]
    if not len(known):
        return [None] * len(QUANTILES)
    # Values themselves: between an infinite one and another there is none.
    return [float(value) for value in np.quantile(known, QUANTILES, method="nearest")]


def _histogram(values: Floats) -> tuple[list[float], list[int]]:
    known = values[np.isfinite(values)]
    if len(known) < 2 or np.ptp(known) == 0:
        return [], []
    counts, edges = np.histogram(known, BARS)
    return [float(edge) for edge in edges], [int(count) for count in counts]
