"""Carriers at 40 kHz that are felt in how they swell: planned, written, and tried by integrators of other make."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from chainsim import Device, Modulation, Outcome, Span, felt_modulation, load_device, sideband_gain, skin_gain
from dotwave.verification import verify
from drivers import Waveform, read_waveform, write_waveform
from encoders import Frame, GridShape, Scene, TargetPattern, levels
from planner import FramePlan, OperatingPoint, Plan, YieldError, plan_scene

GRID = GridShape(6, 6)
LINKED, ONE_LAM = "linked-ultrasonic-6x6", "ultrasonic-6x6"
# What the first cell of a row can show, and what the last can, over one lam.
CELLS = [[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [1, 1, 0, 0, 0, 0], [0, 0, 0, 0, 0, 1], [0, 0, 0, 0, 1, 1]]


def plan_of(*rows: list[float], device: Device, dwell_s: float = 0.06) -> Plan:
    """A frame whose first rows are given; the others are flat."""
    grid = np.zeros((6, 6))
    grid[: len(rows)] = rows
    return plan_scene(Scene(GRID, (Frame(levels(grid), dwell_s),)), device)


def first_of(plan: Plan) -> tuple[FramePlan, OperatingPoint]:
    frame = next(iter(plan.frames))
    return frame, frame.states[0]


def test_the_skin_is_deaf_by_twelve_decibels_an_octave_below_its_best() -> None:
    gain = skin_gain([20.0, 40.0, 125.0, 250.0, 500.0])
    assert gain[3] == 1
    assert 20 * np.log10(gain[2]) == pytest.approx(-12)
    assert gain[0] == gain[1] == pytest.approx(10 ** (-12 * np.log2(250 / 40) / 20))
    assert gain[4] == gain[2]


@pytest.mark.parametrize("depth", [1.0, 0.4])
def test_an_envelope_of_full_scale_and_the_asked_depth_is_level_one(depth: float) -> None:
    phase = 2 * np.pi * np.arange(64) / 64
    for peak, level in ((0.05, 1.0), (0.025, 0.25), (0.0, 0.0)):
        square = (peak * (1 + depth * np.cos(phase)) / (1 + depth)) ** 2
        beats = 2 * np.fft.fft(square)[1:6] / 64
        assert felt_modulation(beats, Modulation(hz=200, depth=depth), 0.05) == pytest.approx(level, abs=1e-12)


@numba.njit
def runge_kutta(
    force: np.ndarray, lam: np.ndarray, delta: float, beta: float, step: float, parts: int, v: np.ndarray
) -> np.ndarray:
    """Displacements of a chain from rest at samples of its drive, straight lines between them; RK4 of our own."""
    n = len(lam)
    out = np.zeros((len(force), n))
    z, h = np.zeros(n), step / parts
    slope_z, slope_v = np.zeros((4, n)), np.zeros((4, n))
    for sample in range(1, len(force)):
        for part in range(parts):
            for k, share in enumerate((0.0, 0.5, 0.5, 1.0)):
                at = (part + share) / parts
                for m in range(n):
                    back = share * h if k else 0.0
                    x = z[m] + back * slope_z[k - 1, m]
                    w = v[m] + back * slope_v[k - 1, m]
                    if m:
                        pull = lam[m] * (z[m - 1] + back * slope_z[k - 1, m - 1] - x)
                    else:
                        pull = force[sample - 1] + at * (force[sample] - force[sample - 1])
                    slope_z[k, m] = w
                    slope_v[k, m] = pull - delta * w - x - beta * x**3
            z += h / 6 * (slope_z[0] + 2 * slope_z[1] + 2 * slope_z[2] + slope_z[3])
            v += h / 6 * (slope_v[0] + 2 * slope_v[1] + 2 * slope_v[2] + slope_v[3])
        out[sample] = z
    return out


def envelope(plan: Plan, row: int) -> np.ndarray:
    """Envelopes of a row's actuators over one beat once they stand, under the plan's own samples.

    Each period of the carrier is demodulated by itself; nothing of the planner's is used but its samples and links.
    """
    device = plan.device
    assert device.modulation is not None
    frame = next(iter(plan.frames))
    waveform = Waveform.of(plan)
    volts = waveform.samples(0.0, frame.settled_s + 1.05 / device.modulation.hz)[:, row]
    tau = np.arange(len(volts)) / waveform.rate_hz * device.tau_per_s
    omega, lam = frame.states[row].omega, np.append(0.0, frame.states[row].lam)
    force, rest = device.epsilon_per_volt * volts, np.zeros(device.chain_length)
    z = runge_kutta(force, lam, device.delta, device.beta, float(tau[1]), 8, rest)
    period = 2 * np.pi / omega
    first = np.ceil(frame.settled_s * device.tau_per_s / period)
    count, each = int(device.f0_hz * omega / device.modulation.hz), 16
    at = (first + np.arange(count * each) / each) * period
    turned = CubicSpline(tau, z)(at).T * np.exp(-1j * omega * at)
    return np.asarray(2 * turned.reshape(len(lam), count, each).mean(axis=2))


def felt_by(motion: np.ndarray, device: Device) -> np.ndarray:
    """The felt levels of envelopes over one beat, shape (n, periods)."""
    assert device.modulation is not None
    beats = 2 * np.fft.fft(np.abs(motion) ** 2, axis=1)[:, 1:6].T / motion.shape[1]
    return felt_modulation(beats, device.modulation, device.full_scale)


def test_over_links_every_actuator_swells_as_it_was_asked_to() -> None:
    device = load_device(LINKED)
    plan = plan_of([1.0, 0.1, 0.1, 1.0, 0.5, 1.0], device=device)
    _, state = first_of(plan)
    motion = envelope(plan, 0)
    assert felt_by(motion, device) == pytest.approx(state.target, abs=3e-3)
    # Of full depth: between two beats nothing is left, at every actuator.
    size = np.abs(motion)
    assert np.all(size.min(axis=1) < 0.03 * size.max(axis=1))


@pytest.mark.slow
def test_one_lam_lets_the_last_cell_beat_and_no_other() -> None:
    device = load_device(ONE_LAM)
    plan = plan_of([0, 0, 0, 0, 1, 1], device=device)
    frame, state = first_of(plan)
    assert frame.outcome is Outcome.OK
    assert len(set(state.lam.tolist())) == 1
    motion = envelope(plan, 0)
    felt = felt_by(motion, device)
    assert felt == pytest.approx(state.target, abs=0.02)
    assert felt[4:].min() > 4 * felt[:4].max()
    # The carrier is there all the same: it stands.
    assert np.abs(motion).mean(axis=1)[:4].max() > 0.15 * device.full_scale


def test_a_drive_makes_up_for_what_a_resonance_leaves() -> None:
    device = load_device(LINKED).model_copy(update={"cols": 1, "chain_length": 1, "omega": Span(min=0.99, max=1.0)})
    scene = Scene(GridShape(6, 1), (Frame(levels(np.ones((6, 1))), 0.5),))
    _, state = first_of(plan_scene(scene, device))
    assert state.outcome is Outcome.OK
    sides = {round((tone.omega - state.omega) * device.f0_hz): tone for tone in state.tones}
    for hz in (200, -200):
        assert abs(sides[hz].phasor[0] / state.phasor[0]) == pytest.approx(0.5, rel=1e-3)
    # Side tones of the drive are stronger by what the resonance takes (the well is soft, so not to the last digit).
    raised = abs(sides[200].epsilon) + abs(sides[-200].epsilon)
    assert raised / abs(state.epsilon) == pytest.approx(1 / sideband_gain(device, 200), rel=0.2)


def test_random_rows_over_links_through_the_file(tmp_path: Path) -> None:
    rng, device = np.random.default_rng(4), load_device(LINKED)
    patterns = [rng.integers(0, 2, (6, 6)).astype(float), rng.integers(0, 5, (6, 6)) / 4]
    scene = Scene(GRID, tuple(Frame(levels(grid), 0.07) for grid in patterns))
    write_waveform(plan_scene(scene, device), tmp_path / "x.wav")
    report = verify(tmp_path / "x.wav")
    assert report.ok
    assert max(frame.amplitude_error for frame in report.frames) < 2e-3
    manifest, _ = read_waveform(tmp_path / "x.wav")
    assert all(all(mark.modulated) for mark in manifest.frames)


@pytest.mark.slow
def test_a_letter_over_one_lam_through_the_file(tmp_path: Path) -> None:
    # f: both dots of the cell, then the left one.
    plan = plan_of([1, 1, 0, 0, 0, 0], [1, 0, 0, 0, 0, 0], device=load_device(ONE_LAM))
    write_waveform(plan, tmp_path / "x.wav")
    report = verify(tmp_path / "x.wav")
    assert report.ok
    assert report.frames[0].contrast_db is not None
    assert report.frames[0].contrast_db >= 12


@pytest.mark.slow
@pytest.mark.parametrize("row", CELLS, ids=str)
def test_every_row_of_one_cell_is_made_over_one_lam(row: list[float]) -> None:
    frame, state = first_of(plan_of(row, device=load_device(ONE_LAM)))
    assert frame.outcome is Outcome.OK
    assert state.error < 0.02


def test_what_no_tones_make_is_refused_with_what_is_lacking() -> None:
    frame, _ = first_of(plan_of([0, 1, 0, 1, 0, 1], device=load_device(ONE_LAM)))
    assert frame.outcome is Outcome.UNREACHABLE
    assert "it lacks a lam per link" in frame.note


def test_a_pattern_that_is_not_felt_is_not_called_felt(tmp_path: Path) -> None:
    """The same carriers without their side tones move as much, and are judged as nothing."""
    device = load_device(LINKED)
    plan = plan_of([1, 1, 1, 1, 1, 1], device=device)
    frames = [
        replace(
            frame,
            states=tuple(replace(state, tones=()) for state in frame.states),
            ramps=tuple(ramp and replace(ramp, tones=()) for ramp in frame.ramps),
        )
        for frame in plan.frames
    ]
    write_waveform(replace(plan, frames=frames), tmp_path / "x.wav")
    report = verify(tmp_path / "x.wav")
    assert report.frames[0].wrong_dots == 6
    assert report.frames[0].felt.max() < 0.05


def test_waves_stay_those_of_carriers() -> None:
    device = load_device(ONE_LAM)
    wave = TargetPattern(np.exp(-1j * np.pi / 2 * np.arange(6)) * np.ones((6, 6)), phase_matters=True)
    frame = next(iter(plan_scene(Scene(GRID, (Frame(wave, 1.0),)), device).frames))
    assert frame.outcome is Outcome.OK
    assert not any(state.modulated for state in frame.states)


def test_a_yield_of_modulation_is_refused() -> None:
    device = load_device(LINKED)
    spread = Device.model_validate(device.as_dict() | {"spread": {"frequency": 0.001}})
    with pytest.raises(YieldError, match="modulation"):
        plan_scene(Scene(GRID, ()), spread, yield_=0.9)


def test_a_device_says_which_modulation_is_too_fast() -> None:
    with pytest.raises(ValueError, match=r"modulation\.hz 200 is too fast for a carrier of 133\.13 Hz"):
        Device.model_validate(load_device("paper-6x6").as_dict() | {"modulation": {"hz": 200}})
