"""Try every hostile setting on every rung and system, and draw what came out: docs/stability.png and .json.

Run with ``python -m benchmarks.stability_map``; takes some minutes. The list is the one the tests use.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from chainsim import RungError, solve, steady_from_rest
from tests.support.hostile import HOSTILE, SYSTEMS, built

ROOT = Path(__file__).resolve().parent.parent
COLOURS = {
    "ok": "#2f7d4f", "escaped": "#c8553d", "unstable": "#e0a33a", "not_locked": "#8d6cab", "no_convergence": "#6f7c8c",
    "out_of_budget": "#b9c0c9", "refused": "#ffffff",
}  # fmt: skip
RUNGS = ["static", "linear", "one_harmonic", "harmonic_balance", "envelope", "ode"]
CELL, LEFT, TOP = 22, 330, 150


def shortest(value: float) -> str:
    """The shortest text that is this very number: 1 and its neighbours are three rows."""
    return f"{value:g}" if float(f"{value:g}") == value else repr(float(value))


def tried() -> Iterator[dict[str, Any]]:
    for extreme in HOSTILE:
        for rung in RUNGS:
            for system in SYSTEMS:
                chain, setting = built(system, extreme)
                began = time.perf_counter()
                try:
                    if rung == "ode" and chain.n > 100 and not chain.feed_forward:
                        raise RungError("its joint map is a matrix of 2n x 2n")
                    if rung == "ode":
                        response = steady_from_rest(chain, setting, tol=1e-6, max_periods=2000)
                    else:
                        response = solve(chain, setting, tol=1e-6, rung=rung)
                    outcome, estimate = str(response.outcome[0]), float(response.error_estimate[0])
                except RungError:
                    outcome, estimate = "refused", float("nan")
                yield {
                    "extreme": ", ".join(f"{key} {shortest(value)}" for key, value in extreme.items()), "rung": rung,
                    "system": system, "outcome": outcome, "estimate": estimate if np.isfinite(estimate) else None,
                    "seconds": round(time.perf_counter() - began, 4),
                }  # fmt: skip


def draw(found: list[dict[str, Any]], rows: list[str], systems: list[str]) -> None:
    columns = [(rung, system) for rung in RUNGS for system in systems]
    width = LEFT + CELL * len(columns) + 14 * len(RUNGS)
    image = Image.new("RGB", (width, TOP + CELL * len(rows) + 60), "#fbfaf7")
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(15)
    by = {(one["extreme"], one["rung"], one["system"]): one for one in found}
    for at, (rung, system) in enumerate(columns):
        x = LEFT + CELL * at + 14 * (at // len(systems))
        if at % len(systems) == 0:
            pen.text((x, 8), rung.replace("_", " "), fill="#222222", font=font)
        label = Image.new("L", (110, CELL), 0)
        ImageDraw.Draw(label).text((2, 1), system, fill=255, font=font)
        turned = label.rotate(90, expand=True)
        image.paste("#555555", (x, TOP - 112), turned)
        for row, extreme in enumerate(rows):
            one = by[extreme, rung, system]
            box = (x, TOP + CELL * row, x + CELL - 2, TOP + CELL * row + CELL - 2)
            met = one["outcome"] != "ok" or (one["estimate"] is not None and one["estimate"] <= 1e-6)
            pen.rectangle(box, fill=COLOURS[one["outcome"]] if met else "#bcd9c5", outline="#d8d5cc")
    for row, extreme in enumerate(rows):
        pen.text((10, TOP + CELL * row + 1), extreme, fill="#222222", font=font)
    x, y = 10, TOP + CELL * len(rows) + 22
    for name, colour in {**COLOURS, "ok, estimate above 1e-6": "#bcd9c5"}.items():
        pen.rectangle((x, y, x + 16, y + 16), fill=colour, outline="#d8d5cc")
        pen.text((x + 22, y - 1), name.replace("_", " "), fill="#222222", font=font)
        x += 40 + int(pen.textlength(name, font=font))
    image.save(ROOT / "docs" / "stability.png", optimize=True)


def main() -> None:
    found = list(tried())
    rows = list(dict.fromkeys(one["extreme"] for one in found))
    (ROOT / "docs" / "stability.json").write_text(
        "[\n" + ",\n".join(json.dumps(one) for one in found) + "\n]\n", encoding="utf-8"
    )
    draw(found, rows, list(SYSTEMS))
    for rung in RUNGS:
        count = Counter(one["outcome"] for one in found if one["rung"] == rung)
        slowest = max((one for one in found if one["rung"] == rung), key=lambda one: one["seconds"])
        print(f"{rung:17}", dict(count), f"slowest {slowest['seconds']} s: {slowest['extreme']}, {slowest['system']}")


if __name__ == "__main__":
    main()
