"""Bars that walk at a rate that is asked for: the settings, the nearest rate, and the proof through the file."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from chainsim import Device, Outcome, load_device
from dotwave.verification import verify
from drivers import write_waveform
from encoders import Frame, GridShape, Scene, TextureError, walking_bars
from planner import OperatingPoint, Plan, plan_scene
from planner.targets import WalkingTarget, targets_of
from planner.transitions.slow import watched
from planner.transitions.waves import enter_tones
from planner.waves.two_tones import MAIN, apart
from planner.waves.walking import TONES_GOOD, walking_rate_hz, walking_state

PAPER, LINKED, SINGLE = (load_device(name) for name in ("paper-6x6", "linked-6x6", "independent-6x6"))
GRID = GridShape(6, 6)


def walk(device: Device, level: float = 0.3, **wish: float) -> OperatingPoint:
    (first, *_) = targets_of(walking_bars(GRID, level=level, **wish), device)
    assert isinstance(first, WalkingTarget)
    return walking_state(device, first)


@pytest.mark.parametrize("rate_hz", [0.4, 1.0, 3.0])
@pytest.mark.parametrize("device", [PAPER, LINKED, SINGLE], ids=lambda device: device.name)
def test_the_rate_is_the_one_asked_for(device: Device, rate_hz: float) -> None:
    state = walk(device, rate_hz=rate_hz)
    assert state.outcome is Outcome.OK
    assert walking_rate_hz(device, state) == pytest.approx(rate_hz, rel=1e-4)


def test_a_small_motion_has_the_width_of_the_formula() -> None:
    """rate = f0 delta tan(pi / 2 width) for equal unit gains (docs/theory.md section 2.5)."""
    state = walk(PAPER, level=0.01, rate_hz=PAPER.f0_hz * PAPER.delta * math.tan(math.pi / 6))
    (other,) = [tone for tone in state.tones if not tone.side]
    lags = [-np.angle(phasor[1] / phasor[0]) for phasor in (state.phasor, other.phasor)]
    assert math.pi / (lags[1] - lags[0]) == pytest.approx(3.0, rel=1e-3)


def test_what_lam_cannot_is_said_with_the_nearest_rate() -> None:
    state = walk(PAPER, rate_hz=20.0)
    assert state.outcome is Outcome.UNREACHABLE
    assert "range of lam" in state.lacking
    np.testing.assert_allclose(state.lam, PAPER.coupling.lam.max)
    assert f"{walking_rate_hz(PAPER, state):.3g} Hz" in state.lacking
    assert walk(LINKED, rate_hz=20.0).outcome is Outcome.OK


@pytest.mark.parametrize(("device", "low", "high"), [(PAPER, 0.2, 6.4), (LINKED, 0.1, 40.0)], ids=["paper", "linked"])
def test_rates_that_a_device_has(device: Device, low: float, high: float) -> None:
    assert walk(device, rate_hz=low).outcome is walk(device, rate_hz=high).outcome is Outcome.OK
    for beyond in (low / 2, 1.5 * high):
        assert walk(device, rate_hz=beyond).outcome is Outcome.UNREACHABLE


def test_width_and_rate_together_take_a_drive_for_every_actuator() -> None:
    state = walk(PAPER, width=2.0, rate_hz=1.5)
    assert state.outcome is Outcome.UNREACHABLE
    assert "0.707 Hz" in state.lacking
    assert walk(PAPER, width=2.0, rate_hz=0.707).outcome is Outcome.OK
    single = walk(SINGLE, width=2.0, rate_hz=1.5)
    assert single.outcome is Outcome.OK
    assert walking_rate_hz(SINGLE, single) == pytest.approx(1.5)


def test_tones_apart_solve_the_single_actuator() -> None:
    """In the time domain of the beat, with the cubic term written out there."""
    made = apart(SINGLE.chain, amplitude=0.02, width=2.0, spacing=0.01)
    turns = np.exp(1j * np.outer(np.arange(-2, 4), np.linspace(0, 2 * np.pi, 64, endpoint=False)))
    motion = made.phasor @ turns
    cubic = 0.75 * SINGLE.beta * (np.abs(motion) ** 2 * motion) @ turns.conj().T / 64
    asked = (1 - made.omega**2 + 1j * SINGLE.delta * made.omega) * made.phasor + cubic
    np.testing.assert_allclose(made.epsilon, asked, atol=1e-15)
    assert np.count_nonzero(made.phasor) == 2
    assert made.omega[MAIN] < 1 < made.omega[MAIN + 1]


def test_the_file_walks_at_both(tmp_path: Path) -> None:
    scene = Scene(GRID, [Frame(walking_bars(GRID, width=2.0, rate_hz=1.5, level=0.4), 3.0)])
    frames = list(plan_scene(scene, SINGLE).frames)
    assert frames[0].outcome is Outcome.OK
    write_waveform(Plan(SINGLE, frames, {}), tmp_path / "walk.wav")
    (felt,) = verify(tmp_path / "walk.wav").frames
    assert felt.amplitude_error <= 1e-3


def test_strong_links_bring_a_walk_sooner_to_stand(tmp_path: Path) -> None:
    """Than a drive that rises and is waited for; shown in the file at the place of the beat that falls to it."""
    state = walk(PAPER, level=0.1, width=2.0)
    quick, slow = (enter_tones(PAPER, state, moves, TONES_GOOD) for moves in (True, False))
    assert quick.lacking == ""
    assert quick.duration_s < 0.7 * slow.duration_s
    assert quick.lam is not None
    np.testing.assert_allclose(quick.lam[-1], state.lam)
    assert quick.lam.max() <= PAPER.coupling.lam.max
    scene = Scene(GRID, [Frame(walking_bars(GRID, width=2.0, level=0.1), 8.0)])
    write_waveform(plan_scene(scene, PAPER), tmp_path / "walk.wav")
    (felt,) = verify(tmp_path / "walk.wav").frames
    assert felt.amplitude_error <= 1e-2


@pytest.mark.parametrize("device", [PAPER, LINKED], ids=lambda device: device.name)
def test_a_walk_stands_at_every_place_of_the_beat_when_its_ramp_ends(device: Device) -> None:
    """Under the drive that is played, whose nodes no straight lines join."""
    state = walk(device, level=1.0 if device is LINKED else 0.1, width=3.0)
    ramp = enter_tones(device, state, True, TONES_GOOD)
    assert ramp.lam is not None
    whole = ramp.duration_s * device.tau_per_s * state.omega / (2 * math.pi)
    (other,) = [tone for tone in state.tones if not tone.side]
    for beat in (0.0, 0.25, 0.5, 0.75):
        start = beat * 2 * math.pi / abs(other.omega - state.omega)
        assert watched(device, state, ramp, math.ceil(whole) + 200, start).restless(TONES_GOOD) <= whole


@pytest.mark.parametrize("wish", [{}, {"rate_hz": 0.0}, {"rate_hz": math.inf}, {"width": 2.0, "rate_hz": -1.0}])
def test_a_walk_without_sense_is_refused(wish: dict[str, float]) -> None:
    with pytest.raises(TextureError, match="walking bars: expected a"):
        walking_bars(GRID, **wish)
