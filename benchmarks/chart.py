"""The picture of a run, as SVG: ratios to the peers as bars, cost against length as points with their slope."""

from __future__ import annotations

import math
from typing import Any

__all__ = ["draw"]

WIDE, ROW, LEFT = 720, 22, 190


def draw(found: dict[str, Any]) -> str:
    """SVG text of a result of `harness.measure`."""
    lines, top = _bars("Transients, times slower at equal error, per core", "transient_ratio", found["peers"], 20)
    more, top = _bars(
        "Steady state, times slower, per core (integrators: 1300 periods from rest, extrapolated)",
        "steady_ratio",
        found["peers"],
        top + 20,
    )
    points, top = _lengths(found["lengths"], top + 20)
    body = "\n".join([*lines, *more, *points])
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDE}" height="{top + 10}" font-family="sans-serif" '
        f'font-size="12"><rect width="100%" height="100%" fill="white"/>\n{body}\n</svg>\n'
    )


def _text(x: float, y: float, words: str, weight: str = "normal") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" font-weight="{weight}">{words}</text>'


def _bars(title: str, key: str, peers: dict[str, Any], top: int) -> tuple[list[str], int]:
    lines, y = [_text(10, top, title, "bold")], top + 10
    largest = max([each[key] for each in peers.values() if key in each], default=10.0)
    for name, each in peers.items():
        lines.append(_text(10, y + 14, name))
        if key in each:
            length = max(2.0, 380 * math.log10(max(each[key], 1.0)) / math.log10(max(largest, 10.0)))
            lines.append(f'<rect x="{LEFT}" y="{y + 3}" width="{length:.1f}" height="14" fill="#266694"/>')
            lines.append(_text(LEFT + length + 6, y + 14, f"{each[key]:,.3g}"))
        else:
            lines.append(_text(LEFT, y + 14, each.get("missing", "does not apply")))
        y += ROW
    return lines, y + 10


def _lengths(found: dict[str, Any], top: int) -> tuple[list[str], int]:
    lines = [_text(10, top, f"One chain of n oscillators: slope {found['slope']:.2f} in the logarithms", "bold")]
    tall, wide = 160, 420
    sizes, seconds = [math.log10(n) for n in found["n"]], [math.log10(s) for s in found["wall_s"]]
    low, high = min(seconds), max(seconds)
    places = [
        (LEFT + wide * (x - sizes[0]) / (sizes[-1] - sizes[0]), top + 20 + tall * (high - y) / max(high - low, 1e-9))
        for x, y in zip(sizes, seconds, strict=True)
    ]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    lines.append(f'<polyline points="{path}" fill="none" stroke="#266694"/>')
    for (x, y), n, s in zip(places, found["n"], found["wall_s"], strict=True):
        lines.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="#266694"/>')
        lines.append(_text(x - 80, y + 4, f"{n:,}: {s:.3g} s"))
    return lines, top + 40 + tall
