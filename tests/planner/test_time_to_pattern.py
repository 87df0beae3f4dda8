"""How soon amplitude profiles stand on linked actuators, at which drive, and that they do: through the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from chainsim import load_device
from dotwave.verification import verify
from drivers import write_waveform
from encoders import Frame, GridShape, Scene, TargetPattern, levels
from planner import Plan, plan_scene
from tests.support.known import known

LINKED = load_device("linked-6x6")
GRID = GridShape(6, 6)


@pytest.mark.parametrize("kind", ["on/off", "levels"])
def test_from_rest_in_a_third_of_a_second_at_three_times_the_steady_drive(kind: str, tmp_path: Path) -> None:
    """Waiting under a constant drive takes 4 to 11 s."""
    rng = np.random.default_rng(4)
    for _ in range(3):
        dots = rng.integers(0, 2, (6, 6)).astype(np.complex128)
        pattern = TargetPattern(dots) if kind == "on/off" else levels(rng.integers(0, 5, (6, 6)) / 4)
        frames = list(plan_scene(Scene(GRID, [Frame(pattern, 1.2)]), LINKED).frames)
        for state, ramp in zip(frames[0].states, frames[0].ramps, strict=True):
            if ramp is not None:
                assert ramp.duration_s <= 0.3
                assert np.abs(known(ramp.epsilon)).max() <= 3 * abs(state.epsilon)
        write_waveform(Plan(LINKED, frames, {}), tmp_path / "shown.npz")
        (felt,) = verify(tmp_path / "shown.npz").frames
        assert felt.settled_s - felt.start_s <= 0.3
        assert felt.amplitude_error < 1e-3


def test_frame_changes_take_no_more_than_that(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    dots = rng.integers(0, 2, (6, 6, 6)).astype(np.complex128)
    frames = list(plan_scene(Scene(GRID, [Frame(TargetPattern(one), 0.8) for one in dots]), LINKED).frames)
    assert all(frame.settled_s - frame.start_s <= 0.35 for frame in frames)
    write_waveform(Plan(LINKED, frames, {}), tmp_path / "shown.npz")
    assert all(felt.amplitude_error < 1e-3 for felt in verify(tmp_path / "shown.npz").frames)
