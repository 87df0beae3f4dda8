"""Every frame of a manifest says of every row whether it moves; what was written before that is still read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chainsim import load_device
from dotwave.verification import verify
from drivers import UnreadableWaveform, read_waveform, write_waveform
from drivers.protocol.record import frame_note
from encoders import Frame, GridShape, Scene, TargetPattern, plane_wave
from planner import plan_scene

OLD = Path(__file__).parents[2] / "data" / "old" / "standing.wav"
DOTS = np.array([[0] * 6, *[[1, 0, 1, 1, 0, 0], [0, 1, 1, 0, 0, 1]] * 2, [1] * 6], dtype=np.complex128)


@pytest.fixture(autouse=True)
def _cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path_factory.getbasetemp() / "plans"))


def written(device: str, pattern: TargetPattern, folder: Path, dwell_s: float = 0.6) -> tuple[Path, dict[str, Any]]:
    plan = plan_scene(Scene(GridShape(6, 6), (Frame(pattern, dwell_s),)), load_device(device))
    path = write_waveform(plan, folder / "x.wav").samples_path
    (frame,) = json.loads(path.with_suffix(".json").read_text())["frames"]
    return path, frame


@pytest.mark.parametrize(
    ("device", "pattern", "moving"),
    [
        ("paper-6x6", TargetPattern(DOTS), [False] * 6),
        ("linked-6x6", TargetPattern(DOTS), [False, True, True, True, True, True]),
        ("independent-6x6", TargetPattern(DOTS), [False, True, True, True, True, True]),
        ("linked-6x6", plane_wave(GridShape(6, 6), lag_deg=60), [True] * 6),
    ],
    ids=["dots on a bias", "dots on links", "dots alone", "a wave"],
)
def test_every_row_says_whether_it_moves(
    device: str, pattern: TargetPattern, moving: list[bool], tmp_path: Path
) -> None:
    dwell_s = 8.0 if pattern.phase_matters else 0.6
    path, frame = written(device, pattern, tmp_path, dwell_s)
    assert frame["moving"] == moving
    assert [omega > 0 for omega in frame["omega"]] == moving
    (check,) = verify(path).frames
    assert check.wrong_dots == 0
    assert check.amplitude_error < 0.01
    (mark,) = read_waveform(path)[0].frames
    assert mark.moving == tuple(moving)


def test_what_moves_in_a_row_that_is_to_rest_is_felt(tmp_path: Path) -> None:
    path, _ = written("linked-6x6", TargetPattern(DOTS), tmp_path)
    manifest = path.with_suffix(".json")
    plain = json.loads(manifest.read_text())
    plain["channels"][0]["row"], plain["channels"][5]["row"] = 5, 0
    manifest.write_text(json.dumps(plain))
    (check,) = verify(path).frames
    assert np.count_nonzero(check.felt[0] > 0.5)
    assert check.wrong_dots > 0


def test_a_record_says_it_too(tmp_path: Path) -> None:
    path, _ = written("linked-6x6", TargetPattern(DOTS), tmp_path)
    (mark,) = read_waveform(path)[0].frames
    from drivers.protocol.record import _unpacked

    assert _unpacked(frame_note(mark))["moving"] == list(mark.moving)


def test_a_file_from_before_frames_said_it_is_read_as_it_was() -> None:
    """Standing dots with an omega of 1 and no `moving`."""
    frame = json.loads(OLD.with_suffix(".json").read_text())["frames"][0]
    assert "moving" not in frame
    assert frame["omega"] == [1.0, 1.0]
    (mark,) = read_waveform(OLD)[0].frames
    assert mark.moving == (False, False)
    report = verify(OLD)
    assert report.frames[0].wrong_dots == 0
    assert report.frames[0].amplitude_error < 1e-4


@pytest.mark.parametrize("moving", [[True, False], None], ids=["said", "from before it was said"])
def test_a_row_that_moves_at_no_frequency_is_refused(moving: list[bool] | None, tmp_path: Path) -> None:
    plain = json.loads(OLD.with_suffix(".json").read_text())
    plain["frames"][0]["omega"] = [0.0, 0.0]
    if moving is None:
        plain["device"]["bias"] = "none"
        plain["channels"] = plain["channels"][:2]
    else:
        plain["frames"][0]["moving"] = moving
    (tmp_path / "standing.json").write_text(json.dumps(plain))
    (tmp_path / "standing.wav").write_bytes(OLD.read_bytes())
    with pytest.raises(UnreadableWaveform, match=r"frames\[0\]\.omega\[0\]: expected a number above 0"):
        read_waveform(tmp_path / "standing.wav")
