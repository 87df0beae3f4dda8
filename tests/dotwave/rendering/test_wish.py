"""A verification judges by what the scene asked for, not by what the plan aims at."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dotwave as dw
from dotwave.verification import verify
from drivers import write_waveform
from drivers.waveform.manifest_reader import read_manifest

OLD = Path(__file__).parents[2] / "data" / "old" / "compromised.wav"


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path / "cache"))


def test_an_old_file_with_raised_flat_dots_does_not_verify() -> None:
    """It has no wish, so its aim is one: 4.7 dB between dots, which once passed for levels without a contrast."""
    mark = read_manifest(OLD.with_suffix(".json")).frames[0]
    np.testing.assert_array_equal(mark.wish.level, mark.target)
    report = verify(OLD)
    assert report.contrast_db == pytest.approx(4.7, abs=0.1)
    assert not report.ok
    assert report.text_equal
    assert "contrast 4.7 dB" in report.as_text()


def test_a_manifest_without_a_wish_is_read_as_before(tmp_path: Path) -> None:
    plan = dw.plan(dw.text("Hi", "linked-6x6"), "linked-6x6")
    plan.waveform().write(tmp_path / "hi.wav")
    path = tmp_path / "hi.json"
    data = json.loads(path.read_text(encoding="utf-8"))
    frame = data["frames"][0]
    wish = np.array(frame.pop("wish"))
    assert set(np.unique(wish)) == {0.0, 1.0}
    # Flat dots idle; that is the aim, not the wish.
    assert np.all(np.array(frame["target"])[wish == 0].max() == 0.1)
    path.write_text(json.dumps(data), encoding="utf-8")
    assert verify(tmp_path / "hi.wav").ok


def test_a_plan_that_raises_flat_dots_does_not_verify(tmp_path: Path) -> None:
    """What it aims at is held exactly, and is not what was asked for."""
    device = dw.device("linked-6x6")
    plan = dw.plan(dw.text("Hi", device), device, contrast_db=8.0)
    frames = [replace(frame, contrast_db=None) for frame in plan.frames]
    write_waveform(replace(plan, frames=frames), tmp_path / "hi.wav")
    report = verify(tmp_path / "hi.wav")
    assert not report.ok
    assert report.amplitude_error < 1e-3
    assert report.contrast_db == pytest.approx(8, abs=0.01)


@pytest.mark.parametrize("contrast_db", [6.0, 9.0, 20.0])
def test_a_contrast_that_is_asked_for_is_judged(tmp_path: Path, contrast_db: float) -> None:
    job = tmp_path / "job.yaml"
    job.write_text(
        f"device: linked-6x6\ncontrast_db: {contrast_db}\nsequence:\n  - text: Hi\noutput: hi.wav\n", encoding="utf-8"
    )
    assert dw.plan(dw.job(job)).waveform().write(tmp_path / "hi.wav").ok
    report = verify(tmp_path / "hi.wav")
    assert report.ok, report.as_text()
    assert f"(at least {contrast_db:g} dB wanted)" in report.as_text()
    path = tmp_path / "hi.json"
    data = json.loads(path.read_text(encoding="utf-8"))
    assert data["frames"][0]["contrast_db"] == contrast_db
    # The same samples are not enough for one who asks for more.
    data["frames"][0]["contrast_db"] = contrast_db + 1
    path.write_text(json.dumps(data), encoding="utf-8")
    assert not verify(tmp_path / "hi.wav").ok
