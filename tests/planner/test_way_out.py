"""Ways out of waves and from wave to wave: stopped by the drive, and proven through the file."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Chain, Device, GridIntegrator, Outcome, load_device
from dotwave.verification import verify
from drivers import write_waveform
from encoders import Frame, GridShape, Scene, TargetPattern, plane_wave
from planner import Plan, Ramp, plan_scene
from planner.drive import smooth_step
from planner.operating_point import OperatingPoint
from planner.targets import WaveTarget, targets_of
from planner.transitions.check import SAMPLES_PER_PERIOD, Orbit, Way, travel
from planner.transitions.fall import CALM, find_fall
from planner.transitions.limits import WayLimits
from planner.transitions.rise import orbit_of
from planner.transitions.steering import LinkCourse, Steering, rest
from planner.waves.wave_state import wave_state

Floats = NDArray[np.float64]
PAPER, LINKED = load_device("paper-6x6"), load_device("linked-6x6")
GRID = GridShape(6, 6)
EFOLD_S = 2 / PAPER.delta / PAPER.tau_per_s
LIMITS = WayLimits(
    epsilon_max=PAPER.epsilon_max, lam_min=0.0, lam_max=0.05, lam_scope="chain",
    slew_per_s=PAPER.amplifier.slew_v_per_s * PAPER.epsilon_per_volt, well_share=0.8,
)  # fmt: skip


@cache
def standing(lag_deg: float, level: float) -> tuple[float, OperatingPoint]:
    (first, *_) = targets_of(plane_wave(GRID, lag_deg=lag_deg, level=level), PAPER)
    assert isinstance(first, WaveTarget)
    state = wave_state(PAPER, first)
    return state.omega, state


@cache
def fall(lag_deg: float, level: float) -> Ramp:
    omega, held = standing(lag_deg, level)
    return find_fall(
        PAPER.chain, epsilon=held.epsilon, lam=held.lam, omega=omega, phasor=held.phasor, limits=LIMITS,
        tau_per_s=PAPER.tau_per_s, budget=150,
    )  # fmt: skip


def way_of(ramp: Ramp) -> Way:
    assert ramp.epsilon is not None
    assert ramp.epsilon_slope is not None
    assert ramp.lam is not None
    assert ramp.lam_t_s is not None
    tau = PAPER.tau_per_s
    return Way(ramp.t_s * tau, ramp.epsilon, ramp.epsilon_slope / tau, ramp.lam_t_s * tau, ramp.lam)


@pytest.mark.parametrize(
    ("lag_deg", "level"), [(150, 0.6), *(pytest.param(*one, marks=pytest.mark.slow) for one in ((60, 0.2), (120, 0.5)))]
)
def test_a_stopped_wave_rests_at_any_phase_of_the_carrier(lag_deg: float, level: float) -> None:
    """Much sooner than seven e-folds, the time in which an open chain falls to 1/1000 by itself."""
    omega, held = standing(lag_deg, level)
    ramp = fall(lag_deg, level)
    assert ramp.lacking == ""
    assert ramp.duration_s < 3 * EFOLD_S
    orbit, amplitude = orbit_of(PAPER.chain, held)[0], float(np.abs(held.phasor).max())
    for phase in (0.0, 0.9, 2.3):
        passage = travel(PAPER.chain, omega, way_of(ramp), orbit, 200, (phase,))
        assert np.abs(passage.felt).max() <= 1e-3 * amplitude
        assert passage.peak <= 1.1 * CALM * amplitude


def test_a_fall_keeps_its_limits_and_begins_where_the_wave_stands() -> None:
    omega, held = standing(150, 0.6)
    way = way_of(fall(150, 0.6))
    assert way.epsilon[0] == pytest.approx(held.epsilon, rel=1e-12)
    assert way.epsilon[-1] == 0
    np.testing.assert_allclose(way.lam[0], held.lam)
    np.testing.assert_array_equal(way.lam[-1], 0.0)
    assert way.lam.min() >= 0
    assert way.lam.max() <= LIMITS.lam_max
    assert np.abs(way.epsilon).max() <= LIMITS.epsilon_max
    assert np.all(np.diff(way.tau) > 0)
    assert LIMITS.exceeded(way, omega, PAPER.tau_per_s) == ""


@pytest.mark.slow
def test_the_same_fall_twice() -> None:
    omega, held = standing(150, 0.6)
    again = find_fall(
        PAPER.chain, epsilon=held.epsilon, lam=held.lam, omega=omega, phasor=held.phasor, limits=LIMITS,
        tau_per_s=PAPER.tau_per_s, budget=150,
    )  # fmt: skip
    np.testing.assert_array_equal(again.epsilon, fall(150, 0.6).epsilon)


def test_without_slopes_a_wave_dies_away() -> None:
    omega, held = standing(120, 0.5)
    ramp = find_fall(
        PAPER.chain, epsilon=held.epsilon, lam=held.lam, omega=omega, phasor=held.phasor, limits=LIMITS,
        tau_per_s=PAPER.tau_per_s, budget=0,
    )  # fmt: skip
    assert ramp.lacking == ""
    assert ramp.duration_s == pytest.approx(math.log(1000) * EFOLD_S, rel=0.05)


@pytest.mark.slow
def test_no_volts_no_stop() -> None:
    omega, held = standing(120, 0.5)
    ramp = find_fall(
        PAPER.chain, epsilon=held.epsilon, lam=held.lam, omega=omega, phasor=held.phasor,
        limits=replace(LIMITS, epsilon_max=1.01 * abs(held.epsilon)), tau_per_s=PAPER.tau_per_s, budget=12,
    )  # fmt: skip
    assert ramp.epsilon is not None
    assert np.abs(ramp.epsilon).max() <= 1.01 * abs(held.epsilon)


def test_an_orbit_begins_at_its_own_frequency() -> None:
    """The forces before a way bring a linear chain onto a motion of another frequency than the carrier's."""
    chain, omega, own = Chain(n=2, delta=0.01, beta=0.0), 1.0, 1.03
    phasor, lam = np.array([0.02 + 0.01j, -0.01 + 0.02j]), np.array([0.05])
    orbit = Orbit(phasor[None, :], lam, own)
    dtau = 2 * math.pi / omega / SAMPLES_PER_PERIOD
    grid = GridIntegrator(shape=(1, 2), chain_length=2, delta=0.01, beta=0.0, ring=False, dtau=dtau)
    half = own * dtau / 2
    forces = orbit.prelude(chain, dtau, 0.7) * (half / math.sin(half)) ** 2
    z = grid.advance(forces[:, None, :], np.array([[0.0, 0.05]]))[:, 0]
    expected = (np.exp(0.7j - 1j * own * dtau) * phasor).real
    np.testing.assert_allclose(z[-2], (np.exp(0.7j - 2j * own * dtau) * phasor).real, atol=1e-4)
    np.testing.assert_allclose(z[-1], expected, atol=1e-4)


def test_steering_from_one_motion_to_another_begins_and_ends_with_their_drives_and_links() -> None:
    _, held = standing(120, 0.5)
    start = OperatingPoint(0.3j * held.epsilon, 2 * held.lam, 1.004, 0.5 * held.phasor)
    task = Steering(PAPER.chain, 1.0, start, held, LinkCourse(0.05, 0.25), 300.0)
    ends = np.array([0.0, 0.5, 1.0])
    drive, _ = task.drive(ends, np.zeros((1, task.size)))
    lam, _ = task.links.at(ends, start, held)
    np.testing.assert_allclose(drive[[0, 2], 0], [start.epsilon, held.epsilon])
    np.testing.assert_allclose(lam, [start.lam, np.full(5, 0.05), held.lam])
    lam, _ = task.links.at(ends, rest(held.lam, 1.0), held)
    np.testing.assert_allclose(lam, [np.full(5, 0.05), np.full(5, 0.05), held.lam])
    assert smooth_step(ends).value.tolist() == [0.0, 0.5, 1.0]


def shown(device: Device, patterns: list[TargetPattern], dwell_s: float, folder: Path) -> list[float]:
    """Plan, write, verify; how long each change takes."""
    frames = list(plan_scene(Scene(GRID, [Frame(one, dwell_s) for one in patterns]), device).frames)
    assert all(frame.outcome is Outcome.OK for frame in frames), [frame.note for frame in frames]
    write_waveform(Plan(device, frames, {}), folder / "shown.wav")
    assert max(felt.amplitude_error for felt in verify(folder / "shown.wav").frames) <= 1e-3
    return [frame.settled_s - frame.start_s for frame in frames]


@pytest.mark.slow
def test_from_wave_to_wave_and_to_dots_through_the_file(tmp_path: Path) -> None:
    """Lag, level and direction of a wave change, and dots follow."""
    patterns = [
        plane_wave(GRID, lag_deg=150, level=0.3),
        plane_wave(GRID, lag_deg=130, row_lag_deg=30, level=0.2),
        TargetPattern(np.eye(6, dtype=np.complex128)),
    ]
    took = shown(PAPER, patterns, 2.0, tmp_path)
    assert max(took) < 1.8


@pytest.mark.slow
@pytest.mark.parametrize("device", [PAPER, LINKED], ids=lambda device: device.name)
def test_random_waves_and_dots_one_after_another(device: Device, tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    patterns = []
    for _ in range(6):
        lag, row_lag, level = rng.uniform(20, 160), rng.uniform(-180, 180), rng.uniform(0.05, 0.4)
        patterns.append(plane_wave(GRID, lag_deg=lag, row_lag_deg=row_lag, level=level))
        if rng.integers(2):
            patterns.append(TargetPattern(rng.integers(0, 2, (6, 6)).astype(np.complex128)))
    took = shown(device, patterns, 12.0, tmp_path)
    # Rows of dots that magnify a disturbance a billion times take the longest.
    assert np.median(took) < 1.6
