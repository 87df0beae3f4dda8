"""What never settles: its beats are those asked for, in the file and under an integrator of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from chainsim import Outcome, load_device
from dotwave.verification import verify
from drivers import write_waveform
from encoders import Frame, GridShape, Region, Scene, TextureError, regions, unlocked
from planner import plan_scene
from planner.planner import Planner
from planner.targets import UnlockedTarget
from planner.waves import unlocked as module
from planner.waves.beats import beats_of, beats_off
from planner.waves.unlocked import Unlocked
from tests.support.joint_motion import Step, felt_after

RING = load_device("paper-6x6-ring")
GRID = GridShape(6, 6)


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path))


@pytest.fixture
def _one_setting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "DRIVES", (1.05,))
    monkeypatch.setattr(module, "DETUNINGS", np.array([0.5]))
    monkeypatch.setattr(module, "LINKS", np.array([1.1425]))


def target(depth: float, period_s: float) -> UnlockedTarget:
    return UnlockedTarget((1.0,) * 6, depth, period_s)


def test_statistics_of_beats_that_are_known() -> None:
    t_s = np.arange(0, 30, 0.03)
    amplitude = 1 + 0.5 * np.sin(2 * np.pi * t_s[:, None] / 1.7 + np.arange(6))
    found = beats_of(amplitude, 0.03)
    assert found.period_s == pytest.approx(1.7, rel=0.01)
    assert found.depth == pytest.approx(0.5, abs=0.01)
    np.testing.assert_allclose(found.loud, 1.5, atol=0.02)
    assert found.share > 0.99


@pytest.mark.usefixtures("_one_setting")
def test_beats_are_felt_in_the_file(tmp_path: Path) -> None:
    plan = plan_scene(Scene(GRID, (Frame(unlocked(GRID, depth=0.35, period_s=1.6), 33.0),)), RING)
    write_waveform(plan, tmp_path / "beats.wav")
    (check,) = verify(tmp_path / "beats.wav").frames
    assert (check.outcome, check.wrong_dots) == ("ok", 0)
    assert check.amplitude_error <= 0.02
    # The limit is what depth and period may be off: beats of another period are not those.
    manifest = tmp_path / "beats.json"
    manifest.write_text(manifest.read_text("utf-8").replace("1.6]", "2.1]"), "utf-8")
    (other,) = verify(tmp_path / "beats.wav").frames
    assert other.amplitude_error > 0.03


@pytest.mark.usefixtures("_one_setting")
def test_what_cannot_beat_so_is_refused_with_the_nearest() -> None:
    (far,) = Unlocked(RING).points([target(0.8, 9.0)])
    assert far.outcome is Outcome.UNREACHABLE
    assert far.lacking.startswith("the nearest found beats 0.3")
    (point,) = Planner(load_device("paper-6x6"), 20.0).points([target(0.3, 1.6)])
    assert point.lacking.endswith("it lacks a closing link")


@pytest.mark.slow
@pytest.mark.parametrize(("depth", "period_s"), [(0.3, 1.6), (0.5, 4.8), (0.55, 2.9), (0.7, 6.0)])
def test_beats_under_an_integrator_of_its_own(depth: float, period_s: float) -> None:
    family = Unlocked(RING)
    (point,) = family.points([target(depth, period_s)])
    assert (point.outcome, point.lacking) == (Outcome.OK, "")
    (felt,) = felt_after(RING, [Step(family.enter(point, True), point, 30.0)], rtol=1e-8)
    found = beats_of(np.abs(felt), 1 / (point.omega * RING.f0_hz))
    assert beats_off(found, depth, period_s) <= 1


@pytest.mark.parametrize(("depth", "period_s"), [(0.0, 1.0), (1.1, 1.0), (0.5, 0.0), (0.5, float("inf"))])
def test_what_is_no_beat_is_refused(depth: float, period_s: float) -> None:
    with pytest.raises(TextureError, match="unlocked: expected"):
        unlocked(GRID, depth=depth, period_s=period_s)
    with pytest.raises(TextureError, match="never settles"):
        regions(GRID, [Region(0, 2, 0, 6, unlocked(GRID, depth=0.5, period_s=1.0))])
