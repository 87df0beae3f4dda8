"""The tutorial is a notebook kept as a script: it runs from top to bottom, and says what its figures show."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
TUTORIAL = ROOT / "docs" / "tutorial.py"
CELLS = re.split(r"^# %%", TUTORIAL.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]


def test_it_runs_from_top_to_bottom(tmp_path: Path) -> None:
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8"}
    command = [sys.executable, "-W", "error", str(TUTORIAL)]
    ran = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert "right - Hello world" in ran.stdout
    assert "What this scene requires on linked-6x6:" in ran.stdout
    assert "Dots felt: the same." in ran.stdout
    assert (tmp_path / "hello.wav").is_file()


def test_every_figure_is_followed_by_its_numbers_as_text() -> None:
    last = [cell.strip().splitlines()[-1] for cell in CELLS]
    figures = [number for number, line in enumerate(last) if line.startswith(("figure", "felt.figure("))]
    assert len(figures) == 2
    for number in figures:
        assert "[markdown]" in CELLS[number + 1]
        assert "print(" in CELLS[number + 2]


def test_it_becomes_a_notebook() -> None:
    jupytext = pytest.importorskip("jupytext")
    notebook = jupytext.read(TUTORIAL)
    assert [cell.cell_type for cell in notebook.cells].count("code") >= 10
