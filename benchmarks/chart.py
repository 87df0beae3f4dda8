"""The picture of a run, as SVG: ratios to the peers as bars, cost against length as points with their slope."""

from __future__ import annotations

import math
from typing import Any

__all__ = ["draw"]

WIDE, ROW, LEFT = 720, 22, 190
COLOURS = ("#266694", "#c2571a")
BARS = {
    "transients": "Transients, times slower at equal error, per core, each peer at its best",
    "steady": "Steady state, times slower, per core: integrators by shooting, AUTO and pyHarm a point",
    "from_rest": "Steady state by 1300 periods from rest (extrapolated), times slower",
}


def draw(found: dict[str, Any]) -> str:
    """SVG text of a result of `harness.measure`."""
    lines, top = [], 0
    for kind, title in BARS.items():
        more, top = _bars(title, kind, found["peers"], top + 20)
        lines += more
    points, top = _lengths(found["lengths"], top + 20)
    body = "\n".join([*lines, *points])
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDE}" height="{top + 10}" font-family="sans-serif" '
        f'font-size="12"><rect width="100%" height="100%" fill="white"/>\n{body}\n</svg>\n'
    )


def _text(x: float, y: float, words: str, weight: str = "normal") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" font-weight="{weight}">{words}</text>'


def _bars(title: str, key: str, peers: dict[str, Any], top: int) -> tuple[list[str], int]:
    lines, y = [_text(10, top, title, "bold")], top + 10
    ratios = {name: each[key]["ratio"] for name, each in peers.items() if key in each}
    largest = max(ratios.values(), default=10.0)
    for name, each in peers.items():
        lines.append(_text(10, y + 14, name))
        if name in ratios:
            length = max(2.0, 380 * math.log10(max(ratios[name], 1.0)) / math.log10(max(largest, 10.0)))
            lines.append(f'<rect x="{LEFT}" y="{y + 3}" width="{length:.1f}" height="14" fill="#266694"/>')
            lines.append(_text(LEFT + length + 6, y + 14, f"{ratios[name]:,.3g}"))
        else:
            lines.append(_text(LEFT, y + 14, each.get("missing", "does not apply")))
        y += ROW
    return lines, y + 10


def _lengths(found: dict[str, Any], top: int) -> tuple[list[str], int]:
    """Seconds on the left and megabytes on the right, chain and grid in each, in the logarithms."""
    lines = [_text(10, top, "One chain, one square grid of n oscillators (processor seconds; megabytes)", "bold")]
    for left, key, scale, slope, unit in (
        (60, "cpu_s", 1.0, "slope", "s"),
        (420, "bytes", 1e-6, "memory_slope", "MB"),
    ):
        every = [math.log10(scale * value) for each in found.values() for value in each[key]]
        for number, (name, each) in enumerate(found.items()):
            colour = COLOURS[number]
            values = [scale * value for value in each[key]]
            places = [
                (
                    left + _along(math.log10(n), 3, 6, 210),
                    top + 185 - _along(math.log10(v), min(every), max(every), 130),
                )
                for n, v in zip(each["n"], values, strict=True)
            ]
            path = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
            lines.append(f'<polyline points="{path}" fill="none" stroke="{colour}"/>')
            lines += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>' for x, y in places]
            said = f"{name}: n^{each[slope]:.2f}, {values[-1]:.3g} {unit} at {each['n'][-1]:,}"
            lines.append(_text(left, top + 22 + 16 * number, f'<tspan fill="{colour}">{said}</tspan>'))
        lines += [_text(left + 70 * k - 8, top + 205, f"10^{k + 3}") for k in range(4)]
    return lines, top + 215


def _along(value: float, low: float, high: float, length: float) -> float:
    return length * (value - low) / max(high - low, 1e-9)
