"""Jobs and pictures rendered and proven through the file they were written to."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from chainsim import load_device
from dotwave.api.pictures import image as image_scene
from dotwave.api.scenes import device as device_of
from dotwave.cli.options import picture_options
from dotwave.errors import AppError
from dotwave.rendering.job import render_job
from dotwave.rendering.render import render
from dotwave.rendering.steps import write_steps
from dotwave.reports.scene import SceneReport
from dotwave.verification import verify
from encoders import EncodeError, GridShape, PictureOptions, encode_picture
from planner import plan_scene
from tests.support.everyday import one_in

SAMPLES = Path(__file__).resolve().parents[3] / "samples"
JOBS = sorted((SAMPLES / "jobs").glob("*.yaml"))
HEART = SAMPLES / "icons" / "heart.svg"


def test_there_is_a_job_of_every_kind() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in JOBS)
    for word in (
        "text:",
        "image:",
        "icon:",
        "texture:",
        "pause_s:",
        "wave:",
        "bars:",
        "walking_bars:",
        "levels:",
        "regions:",
        "scroll:",
        "dot:",
    ):
        assert word in text


@pytest.mark.parametrize("job", one_in(2, JOBS), ids=lambda path: path.stem)
def test_samples_are_rendered_and_felt(job: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.wav"
    report = render_job(job, out)
    assert report.frames >= 1
    if not report.ok:
        # What cannot be made is said, and nothing is written.
        assert report.notes
        assert not out.exists()
        return
    assert report.files == (str(out), str(out.with_suffix(".json")))
    check = verify(out)
    assert check.wrong_dots == 0
    assert check.amplitude_error < 0.02
    assert len(check.frames) == report.frames


def job(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "job.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_output_is_beside_the_job_and_its_folder_is_made(tmp_path: Path) -> None:
    report = render_job(job(tmp_path, "output: made/here.wav\nsequence: [{text: a}]"))
    assert report.files[0] == str(tmp_path / "made/here.wav")
    assert verify(tmp_path / "made/here.wav").felt_text == "a"


def test_the_parts_follow_one_another(tmp_path: Path) -> None:
    text = f"sequence: [{{icon: {HEART}}}, {{pause_s: 0.5}}, {{texture: {{bars: {{width: 1, gap: 1}}, dwell_s: 1.5}}}}]"
    out = tmp_path / "x.wav"
    assert render_job(job(tmp_path, text), out).ok
    frames = verify(out).frames
    heart = np.abs(encode_picture(HEART, GridShape(6, 6)).frames[0].pattern.amplitude) > 0
    bars = np.broadcast_to(np.arange(6) % 2 == 0, (6, 6))
    for frame, dots in zip(frames, (heart, np.zeros((6, 6), bool), bars), strict=True):
        assert np.array_equal(frame.felt_dots, dots)
    assert [round(frame.end_s - frame.start_s, 3) for frame in frames] == [1.0, 0.5, 1.5]
    assert [frame.page for frame in frames] == [0, 1, 2]
    assert json.loads(out.with_suffix(".json").read_text())["encoding"]["kind"] == "sequence"


def test_presentation_of_the_job_and_of_a_text(tmp_path: Path) -> None:
    spread = render_job(job(tmp_path, "presentation: by-row\nsequence: [{text: Hello}]"))
    together = render_job(
        job(tmp_path, "presentation: by-row\nsequence: [{text: {say: Hello, presentation: together}}]")
    )
    assert together.frames == 1 < spread.frames


def test_what_the_device_cannot_make_is_said_and_not_written(tmp_path: Path) -> None:
    text = "device: paper-6x6-ring\noutput: x.wav\nsequence: [{texture: {bars: {width: 1, gap: 1}}}]"
    report = render_job(job(tmp_path, text))
    assert not report.ok
    assert report.outcomes == {"unreachable": 1}
    assert "Nothing was written." in report.notes
    assert len(report.notes) >= 8
    assert not (tmp_path / "x.wav").exists()


def test_the_tolerance_decides_what_is_ok(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "tolerance: {}\nsequence: [{{texture: {{bars: {{width: 1, gap: 1}}}}}}]"
    for error, good in (
        (0.004, {"draft", "normal", "fine"}),
        (0.01, {"draft", "normal"}),
        (0.05, {"draft"}),
        (0.2, set()),
    ):
        for name in ("draft", "normal", "fine"):
            from dotwave.rendering import render as module

            plain = plan_scene
            monkeypatch.setattr(module, "plan_scene", lambda *a, e=error, p=plain, **k: off_by(p(*a, **k), e))
            assert render_job(job(tmp_path, text.format(name))).ok == (name in good)
            monkeypatch.setattr(module, "plan_scene", plain)


def off_by(plan, error):
    from dataclasses import replace

    frames = [
        replace(frame, states=tuple(replace(state, error=error) for state in frame.states)) for frame in plan.frames
    ]
    return replace(plan, frames=frames)


def test_a_budget_that_is_used_up_is_an_outcome(tmp_path: Path) -> None:
    report = render_job(job(tmp_path, "budget: {planning_s: 1.0e-9}\nsequence: [{text: Hello there}]"))
    assert report.outcomes == {"out_of_budget": 1}
    assert "budget.planning_s" in report.notes[0]


def test_errors_name_the_item(tmp_path: Path) -> None:
    with pytest.raises(AppError, match=r"job.yaml:1: sequence.1.image: .*nowhere.png: cannot be read"):
        render_job(job(tmp_path, "sequence: [{text: a}, {image: nowhere.png}]"))
    with pytest.raises(AppError, match=r"sequence.0: levels|region|.*"):
        render_job(
            job(
                tmp_path,
                "sequence: [{texture: {regions: [{top: 0, bottom: 9, left: 0, right: 1, bars: {width: 1, gap: 1}}]}}]",
            )
        )


def test_images_one_after_another_with_every_step(tmp_path: Path) -> None:
    files = [HEART, SAMPLES / "icons" / "play.svg"]
    device = device_of("paper-6x6")
    written = write_steps(files, device, PictureOptions(), tmp_path / "steps")
    report = render(image_scene(files, device), device, tmp_path / "two.wav")
    assert report.ok
    assert verify(tmp_path / "two.wav").ok
    steps = sorted((tmp_path / "steps").iterdir())
    assert {path.name.split("-")[0] for path in steps} == {"1", "2"}
    assert sorted(written) == [str(path) for path in steps]
    last = np.asarray(Image.open(next(path for path in steps if "1-heart" in path.name and "on-off" in path.name)))
    side = last.shape[0] // 6
    dots = last[side // 2 :: side, side // 2 :: side] > 128
    assert np.array_equal(dots, np.abs(encode_picture(HEART, GridShape(6, 6)).frames[0].pattern.amplitude) > 0)


def test_the_pitch_is_that_of_the_device(tmp_path: Path) -> None:
    device = load_device("linked-40x96")
    report = render(image_scene(HEART, device), device)
    options = PictureOptions(pitch_m=(device.pitch_m, device.pitch_m))
    expected = encode_picture(HEART, GridShape(40, 96), options).report.similarity
    assert isinstance(report, SceneReport)
    assert report.parts == (f"icon: heart.svg, similarity {expected:.2f}",)


def test_choices_are_checked() -> None:
    assert picture_options(style="photo", zoom=2).zoom == 2
    with pytest.raises(AppError, match="--as: expected one of on_off, levels, texture, got 'loud'"):
        picture_options(output="loud")
    with pytest.raises(EncodeError, match="zoom"):
        picture_options(zoom=99)


def test_the_pace_of_bars_is_told(tmp_path: Path) -> None:
    job = tmp_path / "walk.yaml"
    walk = "  - texture: {walking_bars: {width: 2, rate_hz: 3, level: 0.3}, dwell_s: 3}\n"
    job.write_text("schema: dotwave/job/1\ndevice: independent-6x6\nsequence:\n" + 2 * walk, encoding="utf-8")
    report = render_job(job, None)
    assert report.ok
    assert [note for note in report.notes if "walk" in note] == ["Frame 1: 3 bars a second walk past an actuator."]
