"""`dotwave explain`, `tradeoff`, `pareto`: what they print, the exit codes, the pictures, and complaints."""

import functools
import itertools
import json

import pytest
from PIL import Image
from typer.testing import CliRunner

from dotwave.cli.plan import commands
from dotwave.errors import AppError
from dotwave.request import seconds_of
from drivers import FileError
from planner import PlanError, trade_off

JOB = """\
schema: dotwave/job/1
device: independent-6x6
sequence:
  - texture: {levels: [[1, 0, 0.5, 0, 0, 0], [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0],
                       [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0]], dwell_s: 1.0}
"""


def run(*arguments):
    return CliRunner().invoke(commands, [str(one) for one in arguments], catch_exceptions=False)


@pytest.fixture
def job(tmp_path):
    path = tmp_path / "job.yaml"
    path.write_text(JOB)
    return path


def test_explain_says_every_term_and_why():
    ended = run("explain", "a", "--device", "independent-6x6", "--tol", "1e-2")
    assert ended.exit_code == 0
    lines = ended.stdout.splitlines()
    assert lines[0] == "What this scene requires on independent-6x6:"
    terms = {line[:18].strip(): line for line in lines[2:12]}
    assert len(terms) == 10
    assert " out " in terms["third harmonic"]
    assert " in " in terms["hysteresis"]
    assert "the rung linear will do" in lines[-1]


def test_explain_of_a_job_as_json(job):
    found = json.loads(run("explain", job, "--tol", "1e-3", "--json").stdout)
    assert found["device"] == "independent-6x6"
    assert found["terms"][0]["name"] == "nonlinearity"
    other = json.loads(run("explain", job, "--device", "paper-6x6", "--json").stdout)
    assert (other["device"], other["rung"]) == ("paper-6x6", "static")


def test_tradeoff_says_what_a_budget_and_a_tolerance_reach(job, tmp_path, monkeypatch):
    # Rows cost what they do here, whatever the clock says: each a second more than the one before it.
    seconds = itertools.count(1.0)
    priced = functools.partial(trade_off, price=lambda run: (run(), next(seconds)))
    monkeypatch.setattr("planner.trade_off", priced)
    picture = tmp_path / "new" / "front.png"
    ended = run("tradeoff", job, "--tol", "1e-3", "--budget", "4s", "--picture", picture)
    assert ended.exit_code == 0
    text = ended.stdout
    assert "Distinct chains on independent-6x6: 2, measured against the full equations from rest" in text
    assert "Cheapest answer to 0.001: one_harmonic reaches" in text
    assert "in 2 s.\nBest answer in 4 s: harmonic_balance at 0.01 reaches" in text
    assert "static: not here" in text
    with Image.open(picture) as drawn:
        assert min(drawn.size) > 300
    assert picture.stat().st_size < 60_000


def test_what_cannot_be_met_is_said_and_ends_with_1():
    ended = run("tradeoff", "a", "--device", "paper-6x6", "--budget", "0.001us", "--tol", "1e-17", "--json")
    assert ended.exit_code == 1
    found = json.loads(ended.stdout)
    assert found["ok"] is False
    assert all("none" in sentence for sentence in found["choices"])


def test_pareto_of_a_frame_with_its_picture(job, tmp_path):
    picture = tmp_path / "ways.svg"
    ended = run("pareto", job, "--picture", picture)
    assert ended.exit_code == 0
    assert "Frame 1 on independent-6x6" in ended.stdout
    assert "least" in ended.stdout
    first = picture.read_bytes()
    found = json.loads(run("pareto", job, "--json").stdout)
    assert len(found["points"]) > 5
    assert b"<svg" in first


@pytest.mark.parametrize(
    ("words", "seconds"), [("50ms", 0.05), ("2 s", 2.0), ("0.5", 0.5), ("300us", 3e-4), ("1e-3s", 1e-3)]
)
def test_times(words, seconds):
    assert seconds_of(words) == pytest.approx(seconds)


@pytest.mark.parametrize("words", ["", "0", "-1ms", "fast", "1h", "nan", "inf", "1e99", "..s", "e"])
def test_times_that_are_none(words):
    with pytest.raises(AppError, match="--budget: expected a time above 0 such as 50ms"):
        seconds_of(words)


def test_complaints(job, tmp_path):
    with pytest.raises(AppError, match=r"expected a picture name that ends with .png or .svg"):
        run("pareto", job, "--picture", tmp_path / "ways.gif")
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="file is not a folder; choose another one"):
        run("pareto", job, "--picture", tmp_path / "file" / "ways.png")
    with pytest.raises(AppError, match="no frame 7"):
        run("pareto", job, "--frame", "7")
    with pytest.raises(PlanError, match="nothing to trade"):
        run("pareto", "a", "--device", "paper-6x6-ring")
    with pytest.raises(PlanError, match="tol: expected a number > 0"):
        run("explain", "a", "--tol", "0")


def test_every_command_has_an_example():
    for name in ("explain", "tradeoff", "pareto"):
        assert f"dotwave {name}" in run(name, "--help").stdout
