"""`--tol`, `--budget`, `--explain`, `--pareto` on the commands that plan: what they decide, and what is told."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from chainsim import Outcome, load_device
from dotwave.errors import AppError
from dotwave.request import TOLERANCES, FrameRequest, frame_request, request_of, tolerance_of
from dotwave.studies.judge import Findings, Judge
from encoders import GridShape, Scene, TextOptions, TextSource, encode_text
from planner import FramePlan, Plan, plan_scene

HEART = Path(__file__).resolve().parents[3] / "samples" / "icons" / "heart.svg"
JOB = """\
device: {device}
sequence:
  - texture: {{levels: [[1, 0, 0.5, 0, 0, 1], [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0],
                       [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0]], dwell_s: 1.0}}
"""


@pytest.fixture
def job(tmp_path: Path) -> Path:
    path = tmp_path / "job.yaml"
    path.write_text(JOB.format(device="independent-6x6"))
    return path


def plan_of(words: str, device: str) -> Plan:
    profile = load_device(device)
    scene = encode_text(TextSource.of_text(words), GridShape(profile.rows, profile.cols), TextOptions())
    return plan_scene(scene, profile)


def off_by(plan: Plan, error: float) -> Plan:
    def worse(frame: FramePlan) -> FramePlan:
        return replace(frame, states=tuple(replace(state, error=error) for state in frame.states))

    return replace(plan, frames=[worse(frame) for frame in plan.frames])


@pytest.mark.parametrize(("tol", "rung"), [("1e-2", "linear"), ("1e-4", "one_harmonic"), ("1e-9", "harmonic_balance")])
def test_a_tolerance_takes_the_cheapest_rung_that_meets_it(dotwave, tol: str, rung: str) -> None:
    ended = dotwave("text", "a", "-d", "independent-6x6", "--tol", tol, "--json")
    assert ended.code == 0
    planned, predicted = json.loads(ended.out)["reached"]
    assert planned.startswith("Planned in ")
    assert predicted.startswith(f"Predicted by {rung} to about ")
    assert f"tolerance {float(tol):g} met" in predicted
    assert ("nonlinearity" in predicted) == (rung == "linear")
    assert ("third harmonic" in predicted) == (rung != "harmonic_balance")
    assert "left out of it" in predicted


def test_a_tolerance_that_no_rung_meets_is_said_and_ends_with_1(dotwave) -> None:
    ended = dotwave("text", "a", "--tol", "1e-17", "--json")
    assert ended.code == 1
    found = json.loads(ended.out)
    assert found["ok"] is False
    assert found["outcomes"] == {"ok": 1}
    assert "tolerance 1e-17 not met" in found["reached"][1]


def test_dots_that_idle_above_the_tolerance_are_named(dotwave) -> None:
    told = dotwave("text", "a", "-d", "linked-6x6", "--tol", "1e-2").out
    assert "Unraised dots idle at up to 10 % of full scale" in told
    lower = dotwave("text", "a", "-d", "linked-6x6", "--tol", "1e-2", "--contrast", "26").out
    assert "Unraised dots idle at up to 5 % of full scale" in lower
    assert "idle" not in dotwave("text", "a", "-d", "linked-6x6", "--tol", "0.2").out
    assert "idle" not in dotwave("text", "a", "--tol", "1e-3").out


@pytest.mark.parametrize("error", [0.004, 0.01, 0.05, 0.2])
@pytest.mark.parametrize("name", [*TOLERANCES, "0.03"])
def test_frames_that_are_off_by_more_are_not_ok(error: float, name: str) -> None:
    judge = Judge(request_of(tol=name))
    (frame, *_) = judge.judged(off_by(plan_of("a", "paper-6x6"), error))
    good = error <= tolerance_of(name)
    assert (frame.outcome is Outcome.OK) == good
    assert good or f"off by {100 * error:g} % of full scale, {100 * tolerance_of(name):g} % are allowed" in frame.note


def test_without_a_tolerance_nothing_is_held_to_one() -> None:
    judge = Judge()
    assert all(frame.outcome is Outcome.OK for frame in judge.judged(off_by(plan_of("a", "paper-6x6"), 0.9)))
    assert judge.findings() == Findings((), True, {})


def test_a_budget_takes_the_best_answer_that_is_left_time_for(dotwave) -> None:
    ended = dotwave("text", "a", "-d", "independent-6x6", "--budget", "1e6s")
    assert ended.code == 0
    assert "Predicted by harmonic_balance to about " in ended.out
    assert "Budget 1e+06 s kept; by the clock" in ended.out


@pytest.mark.parametrize(
    # A reading of the clock takes a second: planning one a frame and one to see the end, a step of the prediction two.
    ("budget_s", "late", "rung", "kept"),
    [
        (2.5, 2, "linear", "not kept"),
        (4, 0, "linear", "not kept"),
        (5, 0, "linear", "kept"),
        (18, 0, "one_harmonic", "kept"),
        (20, 0, "harmonic_balance", "kept"),
    ],
)
def test_frames_are_late_when_the_clock_says_so(budget_s: float, late: int, rung: str, kept: str) -> None:
    seconds = itertools.count()
    judge = Judge(request_of(budget=f"{budget_s}s"), clock=lambda: float(next(seconds)))
    frames = list(judge.judged(plan_of("Hello there you all", "independent-6x6")))
    assert [str(frame.outcome) for frame in frames] == ["ok"] * (4 - late) + ["out_of_budget"] * late
    told = judge.findings().reached
    assert told[0] == "Planned in 5 s."
    assert told[1].startswith(f"Predicted by {rung} ")
    assert f"Budget {budget_s:g} s {kept}; by the clock" in told[-1]


@pytest.mark.parametrize("command", ["text", "image", "render"])
def test_a_budget_that_is_used_up_is_an_outcome(dotwave, job: Path, tmp_path: Path, command: str) -> None:
    source = {"text": "Hello there", "image": HEART, "render": job}[command]
    out = tmp_path / "x.wav"
    ended = dotwave(command, source, "--budget", "0.001us", "-o", out, "--json")
    assert ended.code == 1
    found = json.loads(ended.out)
    assert found["outcomes"] == {"out_of_budget": 1}
    assert any("--budget" in note for note in found["notes"])
    assert not any("nearest" in note for note in found["notes"])
    assert "Budget 0.001 us not kept" in found["reached"][-1]
    assert not out.exists()


def test_the_command_line_comes_before_the_job(dotwave, job: Path) -> None:
    job.write_text("tolerance: 1e-12\nbudget: {planning_s: 1.0e-9}\n" + job.read_text())
    assert json.loads(dotwave("render", job, "--json").out)["outcomes"] == {"out_of_budget": 1}
    ended = dotwave("render", job, "--tol", "draft", "--budget", "100", "--json")
    found = json.loads(ended.out)
    assert (ended.code, found["tolerance"]) == (0, 0.1)
    assert "Predicted by linear" in found["reached"][1]


def test_a_job_means_its_tolerance_as_the_option_does(dotwave, job: Path) -> None:
    usual = json.loads(dotwave("render", job, "--json").out)
    assert usual["tolerance"] == 0.02
    assert "tolerance 0.02 met" in usual["reached"][1]
    job.write_text("tolerance: 1.0e-4\n" + job.read_text())
    strict = json.loads(dotwave("render", job, "--json").out)
    asked = json.loads(dotwave("render", job, "--tol", "1e-4", "--json").out)
    assert strict["tolerance"] == asked["tolerance"] == 1e-4
    assert "Predicted by one_harmonic" in strict["reached"][1]
    assert strict["reached"][1].split(", in ")[0] == asked["reached"][1].split(", in ")[0]


def test_pictures_and_icons_are_held_to_a_tolerance(dotwave, tmp_path: Path) -> None:
    assert json.loads(dotwave("image", HEART, "--json").out)["tolerance"] is None
    found = json.loads(dotwave("image", HEART, "--tol", "1e-6", "--json").out)
    assert found["tolerance"] == 1e-6
    assert "Predicted by static" in found["reached"][1]
    ended = dotwave("icons", HEART.parent, "-o", tmp_path / "set", "--workers", "1", "--tol", "fine", "--json")
    icons = json.loads(ended.out)
    assert ended.code == 0
    assert icons["reached"][0].startswith("Tolerance 0.005: predicted to at most ")


def test_a_set_of_icons_goes_on_where_the_budget_ended(dotwave, tmp_path: Path) -> None:
    out = tmp_path / "set"
    ended = dotwave("icons", HEART.parent, "-o", out, "--workers", "1", "--budget", "0.001us", "--json")
    late = json.loads(ended.out)
    assert ended.code == 1
    assert (late["complete"], late["worked"], late["failed"]) == (False, 0, [])
    assert len(late["unfinished"]) >= 5
    assert "used up" in late["reached"][0]
    whole = json.loads(dotwave("icons", HEART.parent, "-o", out, "--workers", "1", "--budget", "1000s", "--json").out)
    assert (whole["complete"], whole["unfinished"]) == (True, [])
    assert len(whole["icons"]) == len(late["unfinished"])
    assert whole["reached"] == ["Budget 1000 s: kept."]


def test_explain_tells_what_the_command_of_its_own_tells(dotwave) -> None:
    told = json.loads(dotwave("text", "Hi", "--explain", "--tol", "1e-3", "--json").out)["requirement"]
    alone = json.loads(dotwave("explain", "Hi", "--tol", "1e-3", "--json").out)
    assert told == alone
    assert "What this scene requires on paper-6x6:" in dotwave("text", "Hi", "--explain").out


def test_pareto_tells_what_the_command_of_its_own_tells(dotwave, job: Path, tmp_path: Path) -> None:
    picture = tmp_path / "ways.png"
    told = json.loads(dotwave("render", job, "--pareto", f"1:{picture}", "--json").out)["pareto"]
    alone = json.loads(dotwave("pareto", job, "--json").out)
    assert told | {"picture": None} == alone
    with Image.open(picture) as drawn:
        assert min(drawn.size) > 300
    late = dotwave("render", job, "--pareto", "7")
    assert late.code == 2
    assert "--pareto: the scene has no frame 7" in late.err


def test_what_is_watched_of_a_long_scene_does_not_grow() -> None:
    plan = plan_of("Hello", "linked-6x6")
    (frame, *_) = plan.frames
    watched = 0

    def many():
        nonlocal watched
        for _ in range(5000):
            watched += 1
            yield frame

    judge = Judge(request_of(tol="normal", explain=True))
    for _ in judge.judged(replace(plan, frames=many())):
        pass
    assert watched == 5000
    assert len(judge._frames) == 1
    assert judge.findings().met


@pytest.mark.parametrize("words", ["", "high", "0", "-1", "nan", "inf"])
def test_tolerances_that_are_none(words: str) -> None:
    with pytest.raises(AppError, match="--tol: expected draft, normal, fine or a number above 0"):
        request_of(tol=words)


@pytest.mark.parametrize(
    ("words", "frame"),
    [
        ("3", FrameRequest(3)),
        ("ways.png", FrameRequest(1, Path("ways.png"))),
        ("2:a/b.svg", FrameRequest(2, Path("a/b.svg"))),
        ("C:ways.png", FrameRequest(1, Path("C:ways.png"))),
    ],
)
def test_frames_to_be_traded(words: str, frame: FrameRequest) -> None:
    assert frame_request(words) == frame


@pytest.mark.parametrize("words", ["0", "0:ways.png", "2:", "ways.gif", "two", ""])
def test_frames_that_are_none(words: str) -> None:
    with pytest.raises(AppError, match=r"--pareto: expected a frame|expected a picture name"):
        frame_request(words)


def test_a_blank_scene_needs_no_prediction() -> None:
    plan = plan_of("Hello", "paper-6x6")
    judge = Judge(request_of(tol="fine"))
    list(judge.judged(replace(plan, frames=plan_scene(Scene(GridShape(6, 6), ()), plan.device).frames)))
    assert judge.findings().reached[0].startswith("Planned in")
