"""The tutorial is a notebook kept as a script: it runs from top to bottom, and says what its figures show."""

from __future__ import annotations

import base64
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import dotwave as dw
from tests.support.known import known

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


def test_what_is_felt_draws_itself_in_a_notebook_with_its_words() -> None:
    felt = dw.verify(dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6"))
    shown = known(felt.figure()._repr_html_())
    found = re.fullmatch(r'<img alt="([^"]*)" src="data:image/png;base64,([^"]*)">', shown, flags=re.DOTALL)
    assert found is not None
    assert "Dots felt: the same." in found[1]
    assert base64.b64decode(found[2]).startswith(b"\x89PNG")


def test_executed_as_a_notebook_it_shows_both_figures(tmp_path: Path) -> None:
    jupytext, client = pytest.importorskip("jupytext"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = jupytext.read(TUTORIAL)
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    client.NotebookClient(notebook, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", [])]
    assert sum("image/png" in data or "data:image/png" in data.get("text/html", "") for data in outputs) == 2
