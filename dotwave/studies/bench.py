"""`dotwave bench`: runs the measurements of a source tree and tells them in a few lines."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import AppError

__all__ = ["BenchReport", "run_bench"]

HARNESS = Path(__file__).resolve().parents[2] / "benchmarks" / "harness.py"


@dataclass(frozen=True)
class BenchReport:
    """What was measured (the contents of bench.json) and where the files are."""

    found: dict[str, Any]
    folder: Path

    def as_dict(self) -> dict[str, Any]:
        """All of it."""
        return self.found

    def as_text(self) -> str:
        """Our own figures, then for each peer its ratios with the settings they were measured at, then the goals."""
        found = self.found
        steady = found["steady"]
        lines = [
            f"load of the machine before and after: {found['load_before']:.1f}, {found['load_after']:.1f}",
            f"steady states of {steady['settings']}: {1e3 * steady['wall_s']:.0f} ms wall, "
            f"{1e3 * steady['cpu_s']:.0f} ms processor, largest error {steady['largest_error']:.1e}",
            f"one chain alone: {1e3 * found['one_alone']['wall_s']:.2f} ms",
        ]
        lines += [
            f"transients, {each['steps']} steps: {each['chain_periods_per_s'] / 1e6:.1f} M chain-periods/s at "
            f"{each['median_error']:.1e}, {100 * each['share_of_limit']:.0f} % of the arithmetic limit"
            for each in found["transients"]
        ]
        lines += [
            f"{name}s of {each['n'][0]} to {each['n'][-1]} oscillators: time grows as n^{each['slope']:.2f}, memory as "
            f"n^{each['memory_slope']:.2f}; the largest {each['cpu_s'][-1]:.2f} s, {each['bytes'][-1] / 1e6:.0f} MB"
            for name, each in found["lengths"].items()
        ]
        lines.append(f"map of {found['map']['settings']} settings to NPZ and PNG: {found['map']['wall_s']:.2f} s")
        for name, peer in found["peers"].items():
            lines += _said(name, peer)
        lines += [_goal(each) for each in found["goals"]]
        return "\n".join([*lines, f"written: {self.folder / 'bench.json'}, {self.folder / 'bench.svg'}"])


def _goal(each: dict[str, Any]) -> str:
    unit = f" {each['unit']}" if each["unit"] else ""
    asked = f"at {each['sense']} {each['goal']:g}{unit}"
    note = f" ({each['note']})" if each["note"] else ""
    if each["reached"] is None:
        return f"goal, {each['what']}: {asked}; not measured{note}"
    verdict = "reached" if each["reached"] else "NOT reached"
    return f"goal, {each['what']}: {asked}; {each['measured']:.3g}{unit}, {verdict}{note}"


def _said(name: str, peer: dict[str, Any]) -> list[str]:
    if "missing" in peer:
        return [f"{name}: missing: {peer['missing']}"]
    told, steady = [], peer["steady"]
    if "transients" in peer:
        motion = peer["transients"]
        told.append(f"{name}: {_ratio(motion)} times slower in transients [{motion['settings']}]")
    told.append(f"{name}: {_ratio(steady)} times to a steady state, {steady['way']} [{steady['settings']}]")
    if "from_rest" in peer:
        rest = peer["from_rest"]
        told.append(f"{name}: {rest['ratio']:.3g} times by {rest['periods']} periods from rest (extrapolated)")
    return told


def _ratio(found: dict[str, Any]) -> str:
    return f"{found['ratio']:.3g}" + ("" if found["reached"] else " (does not reach our error)")


def run_bench(folder: Path, *, quick: bool) -> BenchReport:
    """Measure in a fresh interpreter, and write bench.json and bench.svg into `folder`.

    Raises
    ------
    AppError
        Outside a source tree, or when the measurement fails.
    """
    if not HARNESS.exists():
        raise AppError(
            "the measurements are in the source tree, in benchmarks/; run this from a clone: ./run dotwave bench"
        )
    call = [sys.executable, str(HARNESS), str(folder), *(["--quick"] if quick else [])]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        raise AppError(f"benchmarks/harness.py: {last}")
    return BenchReport(json.loads((folder / "bench.json").read_text(encoding="utf-8")), folder)
