"""`import dotwave as dw`: the ten lines of the tutorial, plans that stream, waveforms, and what is felt of them."""

from __future__ import annotations

import html.parser
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dotwave as dw
from chainsim import Outcome
from dotwave.api import plans
from drivers import read_waveform
from encoders.braille import text as encoder
from encoders.braille.filling import paginate
from planner import Plan, plan_scene

ROOT = Path(__file__).resolve().parents[3]
HEAVY = {"PIL", "dask", "matplotlib", "numba", "scipy"}


def loaded_after(code: str) -> set[str]:
    code += "; import sys; print(*{name.split('.')[0] for name in sys.modules})"
    ran = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    return set(ran.stdout.split())


def test_importing_dotwave_imports_nothing_of_weight() -> None:
    assert not loaded_after("import dotwave as dw; dir(dw)") & (HEAVY | {"numpy", "pydantic", "yaml", "typer", "rich"})


@pytest.mark.parametrize("to", ["scene", "plan[0]", "plan.waveform().samples(0, 1)"])
def test_a_text_on_a_device_with_bias_needs_nothing_heavy(to: str) -> None:
    code = "import dotwave as dw; device = dw.device('paper-6x6'); scene = dw.text('Hi', device); "
    assert not loaded_after(code + f"plan = dw.plan(scene, device); {to}") & HEAVY


def test_the_ten_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    device = dw.device("linked-6x6")
    scene = dw.text("Hello world", device)
    plan = dw.plan(scene, device, tol=0.02)
    assert (plan[0].outcome, len(plan)) == (dw.Outcome.OK, 2)
    assert plan[0].error <= 0.02
    assert "nonlinearity" in plan.explain().as_text()
    assert plan.report().ok
    wave = plan.waveform()
    volts = wave.samples(0.0, 0.5)
    assert volts.dtype == np.float64
    assert volts.shape == (wave.rate_hz // 2, len(wave.channels))
    wave.write("hello.wav")
    felt = dw.verify("hello.wav")
    assert felt.ok
    assert felt.text == "Hello world"
    assert felt.frames[1].amplitude.shape == (6, 6)
    assert len(felt.figure().axes) == 4
    chain = dw.Chain(n=6, delta=5.3006e-3, beta=-1.0)
    setting = dw.Setting.of(chain, epsilon=1e-4, lam=6.131e-3, omega=1.0)
    one = dw.solve(chain, setting, tol=1e-6)
    many = dw.sweep(chain, epsilon=1e-4, lam=6.131e-3, omega=[0.99, 1.0])
    np.testing.assert_allclose(np.asarray(many["phasor"])[0, 0, 1], one.phasor[0], rtol=1e-5)
    with dw.open("controller:/dev/nowhere") as sink, pytest.raises(dw.DriverError, match="/dev/nowhere"):
        sink.play(wave)


def test_samples_are_those_of_the_file(tmp_path: Path) -> None:
    wave = dw.plan(dw.text("Hi there", "paper-6x6"), "paper-6x6").waveform()
    wave.write(tmp_path / "x.npz")
    _, reader = read_waveform(tmp_path / "x.npz")
    written = np.concatenate(list(reader.blocks(999)))
    assert np.array_equal(wave.samples(0.0, 100.0), written)
    assert np.array_equal(wave.samples(0.9, 1.1), written[7200:8800])
    assert wave.samples(5.0, 5.0).shape == (0, 42)
    with pytest.raises(ValueError, match="rise from 0"):
        wave.samples(1.0, 0.5)


def test_the_file_is_that_of_the_command_line(tmp_path: Path, dotwave) -> None:
    dotwave("text", "Hi", "-d", "linked-6x6", "-o", tmp_path / "a.wav")
    (tmp_path / "b").mkdir()
    dw.plan(dw.text("Hi", "linked-6x6"), "linked-6x6").waveform().write(tmp_path / "b" / "a.wav")
    for name in ("a.wav", "a.json"):
        assert (tmp_path / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_a_long_text_is_not_encoded_before_it_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[object] = []

    def counted(*given: Any) -> Iterator[Any]:
        for page in paginate(*given):
            made.append(page)
            yield page

    monkeypatch.setattr(encoder, "paginate", counted)
    plan = dw.plan(dw.text("It rains and it pours. " * 2000, "paper-6x6"), "paper-6x6")
    assert repr(plan) == "<ScenePlan of text: It rains and it pours. It rains and i... on paper-6x6>"
    assert made == []
    assert plan[1].frame is not None
    assert len(made) < 8


def test_a_plan_is_a_sequence() -> None:
    plan = dw.plan(dw.text("Hello there you", "linked-6x6"), "linked-6x6")
    frames = list(plan)
    assert len(plan) == len(frames) >= 2
    assert [frame.end_s for frame in frames] == [plan[k].end_s for k in range(len(plan))]
    assert plan[-1].end_s == frames[-1].end_s == plan[-2:][1].end_s
    # The way out is on the time line, and no frame of the scene.
    assert len(list(plan.frames)) == len(plan) + 1
    for beyond in (len(plan), -len(plan) - 1):
        with pytest.raises(IndexError, match=f"frame {beyond}: the plan has {len(plan)}"):
            plan[beyond]


def test_a_tolerance_judges_every_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    def off(*given: Any, **named: Any) -> Any:
        plan = plan_scene(*given, **named)
        frames = [replace(one, states=tuple(replace(state, error=0.05) for state in one.states)) for one in plan.frames]
        return replace(plan, frames=frames)

    monkeypatch.setattr(plans, "plan_scene", off)
    scene = dw.text("Hi", "paper-6x6")
    for tol, outcome in ((0.04, "unreachable"), (0.06, "ok"), (None, "ok")):
        frame = dw.plan(scene, "paper-6x6", tol=tol)[0]
        assert (frame.outcome, frame.error) == (outcome, 0.05)
        assert ("off by 5 % of full scale, 4 % are allowed" in frame.note) == (outcome == "unreachable")


def test_what_cannot_be_made_is_raised_and_not_written(tmp_path: Path) -> None:
    plan = dw.plan(dw.text("Hello", "paper-6x6-ring"), "paper-6x6-ring")
    assert not plan.report().ok
    for call in (lambda: plan.waveform().write(tmp_path / "x.wav"), lambda: dw.verify(plan)):
        with pytest.raises(dw.NotMade, match="Frame 1: paper-6x6-ring cannot make this pattern"):
            call()
    assert list(tmp_path.iterdir()) == []


def test_memory_is_felt_as_the_file_is(tmp_path: Path) -> None:
    plan = dw.plan(dw.text("Hi", "linked-6x6"), "linked-6x6")
    plan.waveform().write(tmp_path / "x.npz")
    file, memory = dw.verify(tmp_path / "x.npz"), dw.verify(plan.waveform())
    assert np.array_equal(file.frames[0].amplitude, memory.frames[0].amplitude)
    assert memory.path == "a waveform in memory"


class Table(html.parser.HTMLParser):
    """Counts what a screen reader needs of a table."""

    def __init__(self, words: str) -> None:
        super().__init__()
        self.scopes: dict[str, int] = {}
        self.tags: list[str] = []
        self.feed(words)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag == "th":
            scope = dict(attrs)["scope"] or ""
            self.scopes[scope] = self.scopes.get(scope, 0) + 1


def test_objects_show_themselves_in_one_line_and_as_tables() -> None:
    plan = dw.plan(dw.text("<b>Hi</b> & you, it rains", "paper-6x6"), "paper-6x6")
    felt = dw.verify(plan)
    report, terms = plan.report(), plan.explain()
    facts = len(report.as_dict())
    shown_as = ((plan, len(plan)), (plan.waveform(), 42), (felt, len(plan)), (report, facts), (terms, 10))
    for shown, rows in shown_as:
        assert "\n" not in repr(shown)
        assert len(repr(shown)) < 200
        words = shown._repr_html_()
        table = Table(words)
        assert table.tags.count("caption") == 1
        assert table.scopes["row"] == rows
        assert table.scopes["col"] >= 2
        assert "<b>" not in words
    assert len(repr(plan[0])) < 100
    assert repr(felt.frames[0]) == "FrameCheck(from 0.00 s, 0 wrong dots, error 0.00 %)"
    assert len(repr(plan.scene)) < 100


def test_a_job_brings_its_device_and_its_tolerance(tmp_path: Path) -> None:
    path = tmp_path / "job.yaml"
    path.write_text("device: linked-6x6\ntolerance: fine\nsequence: [{text: Hi}, {pause_s: 0.01}]\n", "utf-8")
    plan = dw.plan(dw.job(path))
    assert (plan.device.name, plan.request.tol) == ("linked-6x6", 0.005)
    with pytest.raises(dw.AppError, match=r"job.yaml:3: sequence.1.pause_s: a frame of 0.01 s"):
        list(plan)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: dw.device({"base": "paper-6x6", "grid": {"cols": 0}}), r"device.grid.cols: expected a whole number"),
        (lambda: dw.device("paper"), "not a built-in profile"),
        (lambda: dw.texture({"bar": {}}), r"texture.bar: unknown key"),
        (lambda: dw.image([]), "no picture"),
        (lambda: dw.image("nowhere.png"), "nowhere.png"),
        (lambda: dw.image("x.png", style="loud"), "style: expected one of"),
        (lambda: dw.text("Hi", presentation="backwards"), "presentation: expected one of together"),
        (lambda: dw.plan(dw.text("Hi")), "no device was given"),
        (lambda: dw.plan(dw.text("Hi"), "linked-40x96"), "laid out for 6 x 6"),
        (lambda: dw.verify("nowhere.wav"), "nowhere.wav"),
    ],
)
def test_bad_input_is_one_line(call, says: str) -> None:
    with pytest.raises((dw.AppError, dw.ChainError, dw.DriverError, dw.EncodeError, dw.PlanError), match=says) as error:
        call()
    assert "\n" not in str(error.value)


def test_words_choose_as_objects_do() -> None:
    by_word = dw.text("Hi", "paper-6x6", presentation="by-row")
    assert len(list(by_word.frames)) > len(list(dw.text("Hi", "paper-6x6").frames))
    heart = ROOT / "samples" / "icons" / "heart.svg"
    assert dw.image(heart.read_bytes(), style="photo").parts[0].startswith("photo: ")


def test_the_frame_that_failed_is_named_not_one_that_was_remarked_upon(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def second_fails(*args: Any, **kwargs: Any) -> Plan:
        made = plan_scene(*args, **kwargs)
        first, second, *rest = made.frames
        return replace(made, frames=[first, replace(second, outcome=Outcome.UNREACHABLE, note="not this"), *rest])

    monkeypatch.setattr("dotwave.rendering.render.plan_scene", second_fails)
    job = tmp_path / "job.yaml"
    walk = "  - texture: {walking_bars: {width: 2, rate_hz: 3, level: 0.3}, dwell_s: 3}\n"
    job.write_text("schema: dotwave/job/1\ndevice: independent-6x6\nsequence:\n" + 2 * walk, encoding="utf-8")
    plan = dw.plan(dw.job(job))
    report = plan.report()
    assert report.failure == "Frame 2: not this"
    assert report.notes[:2] == ("Frame 1: 3 bars a second walk past an actuator.", report.failure)
    with pytest.raises(dw.NotMade, match=r"^Frame 2: not this$"):
        plan.waveform().write(tmp_path / "x.wav")
