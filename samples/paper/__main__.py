"""`python -m samples.paper [FOLDER]`: makes every figure and a report beside the paper's numbers (out/paper)."""

from __future__ import annotations

import sys
import time
from pathlib import Path

from . import control, equilibrium, ranges, single, states

__all__ = ["FIGURES", "main", "reproduce"]

FIGURES = (single, equilibrium, states, ranges, control)

INTRODUCTION = """# The paper's figures, made again

S. Naik and D. Nair, "Coupled Piezoelectric Actuators for the Tactile Display". The paper gives neither damping nor the
cubic term. Everything here rests on one inference, delta = 5.3006e-3 from its critical lambda (Fig. 4), and on
beta = -1, which only sets the unit of z.
"""


def reproduce(out: Path) -> Path:
    """Make the figures in `out`, and ``report.md`` beside them; returns the report."""
    out.mkdir(parents=True, exist_ok=True)
    pages = []
    for module in FIGURES:
        began = time.perf_counter()
        page = module.figure(out)
        pages.append(page)
        print(f"{page.title}  ({time.perf_counter() - began:.1f} s)")
        for finding in page.findings:
            print(f"  {finding.what}: {finding.ours}" + (f"   [paper: {finding.paper}]" if finding.paper else ""))
    report = out / "report.md"
    report.write_text(INTRODUCTION + "\n" + "\n".join(page.text() for page in pages), encoding="utf-8")
    return report


def main() -> None:
    """Read the folder from the command line and make everything."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        sys.exit("matplotlib is missing; give this: .venv/bin/python -m pip install matplotlib")
    print(f"Written: {reproduce(Path(sys.argv[1] if len(sys.argv) > 1 else 'out/paper'))}")


if __name__ == "__main__":
    main()
