"""The error that a plan states holds what is felt: what changes leave rings on, and amplifiers are not silent."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Device, Outcome, load_device
from chainsim.compiled import compiled
from dotwave.verification import verify
from drivers import read_waveform, write_waveform
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import FramePlan, Plan, plan_scene

Floats = NDArray[np.float64]

LINKED = load_device("linked-6x6")
# Of the error, in units of full scale: below it the numbers in the file round more than changes leave.
SMALL = 2e-3


@pytest.fixture(autouse=True)
def _cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path_factory.getbasetemp() / "plans"))


def planned(patterns: list[Floats], device: Device = LINKED, dwell_s: float = 0.7) -> list[FramePlan]:
    frames = tuple(Frame(TargetPattern(dots.astype(np.complex128)), dwell_s) for dots in patterns)
    return list(plan_scene(Scene(GridShape(6, 6), frames), device).frames)


def mixed_and_raised(seed: int) -> list[Floats]:
    """Mixed rows, all raised, mixed, all raised."""
    rng = np.random.default_rng(seed)
    raised = np.ones((6, 6))
    return [rng.integers(0, 2, (6, 6)).astype(float), raised, rng.integers(0, 2, (6, 6)).astype(float), raised]


def written(frames: list[FramePlan], path: Path, device: Device = LINKED) -> Path:
    """The file of frames whether or not they were refused."""
    write_waveform(Plan(device, [replace(frame, outcome=Outcome.OK, note="") for frame in frames], {}), path)
    return path


@compiled
def row_by_runge_kutta(push: Floats, lam: Floats, delta: float, beta: float, dtau: float) -> Floats:
    """Positions of a chain from rest, by the fourth order, two steps from sample to sample, all straight between."""
    count, n = lam.shape
    z, v, out = np.zeros((5, n)), np.zeros((5, n)), np.zeros((count, n))
    slope_z, slope_v = np.zeros((4, n)), np.zeros((4, n))
    h = dtau / 2
    for half in range(2 * (count - 1)):
        k = half // 2
        for part in range(4):
            ahead = 0.0 if part == 0 else 1.0 if part == 3 else 0.5
            at = (half % 2 + ahead) / 2
            for m in range(n):
                z[part, m] = z[4, m] + ahead * h * slope_z[part - 1, m]
                v[part, m] = v[4, m] + ahead * h * slope_v[part - 1, m]
            for m in range(n):
                x = z[part, m]
                pull = push[k] + at * (push[k + 1] - push[k])
                if m:
                    pull = (lam[k, m] + at * (lam[k + 1, m] - lam[k, m])) * (z[part, m - 1] - x)
                slope_z[part, m] = v[part, m]
                slope_v[part, m] = pull - delta * v[part, m] - x - beta * x * x * x
        for m in range(n):
            z[4, m] += h / 6 * (slope_z[0, m] + 2 * slope_z[1, m] + 2 * slope_z[2, m] + slope_z[3, m])
            v[4, m] += h / 6 * (slope_v[0, m] + 2 * slope_v[1, m] + 2 * slope_v[2, m] + slope_v[3, m])
            out[k + 1, m] = z[4, m]
    return out


def felt_by_another(path: Path) -> list[float]:
    """Worst deviation in every frame, by nothing but the file and the equations."""
    manifest, reader = read_waveform(path)
    device, rate = manifest.device, manifest.rate_hz
    force = np.concatenate(list(reader.blocks(4096))) * device.epsilon_per_volt
    links, dtau = manifest.lam_at(np.arange(len(force)) / rate), device.tau_per_s / rate
    given = device.delta, device.beta, dtau
    z = np.stack([row_by_runge_kutta(force[:, r].copy(), links[:, r].copy(), *given) for r in range(6)], axis=1)
    worst = []
    for mark in manifest.frames:
        at = np.arange(round(mark.settled_s * rate), round(mark.end_s * rate))
        turn = mark.omega[0] * at * dtau
        basis = np.stack([np.ones(len(at)), np.cos(turn), np.sin(turn)], axis=1)
        parts = np.linalg.lstsq(basis, z[at].reshape(len(at), -1))[0]
        amplitude = np.hypot(parts[1], parts[2]).reshape(6, 6) / device.full_scale
        worst.append(float(np.abs(amplitude - mark.target).max()))
    return worst


@pytest.mark.parametrize("seed", range(6))
def test_what_is_planned_holds_what_is_felt(seed: int, tmp_path: Path) -> None:
    frames = planned(mixed_and_raised(seed))
    felt = [check.amplitude_error for check in verify(written(frames, tmp_path / "dots.wav")).frames]
    for frame, error in zip(frames, felt, strict=False):
        assert frame.error >= 0.5 * error or error < SMALL
        assert frame.error <= 20 * error + SMALL


def test_what_changes_leave_is_in_the_error_and_refused(tmp_path: Path) -> None:
    """By two integrations of the file: without the residue of changes the third frame's error was 8e-13."""
    frames = planned(mixed_and_raised(1))
    path = written(frames, tmp_path / "dots.wav")
    for felt in (verify(path).frames[2].amplitude_error, felt_by_another(path)[2]):
        assert felt > 0.03
        assert 0.5 * felt <= frames[2].error <= 5 * felt
    assert [frame.outcome for frame in frames[:4]] == [Outcome.OK, Outcome.OK, Outcome.UNREACHABLE, Outcome.OK]
    assert "rings on" in frames[2].note
    assert all(state.error < 1e-9 for frame in frames for state in frame.states)


def test_actuators_that_were_measured_ring_with_their_own_numbers(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    places = [(row, col, LINKED.f0_hz * (1 + 0.01 * rng.standard_normal())) for row in range(6) for col in range(6)]
    actuators = [{"row": row, "col": col, "f0_hz": f0_hz} for row, col, f0_hz in places]
    device = Device.model_validate(LINKED.as_dict() | {"actuators": actuators})
    frames = planned([rng.integers(0, 2, (6, 6)).astype(float) for _ in range(2)], device)
    felt = [check.amplitude_error for check in verify(written(frames, tmp_path / "dots.wav", device)).frames]
    for frame, error in zip(frames, felt, strict=False):
        assert 0.5 * error <= frame.error <= 20 * error + 1e-4


def test_rows_that_ring_on_are_told_from_those_that_do_not() -> None:
    """Equal neighbours magnify, so what is left of a change depends on the row."""
    calm, other, raised = (np.tile(row, (6, 1)) for row in ([1.0, 0, 1, 0, 1, 0], [0, 1.0, 1, 1, 0, 0], np.ones(6)))
    assert planned([other, calm])[1].residue < 1e-3 < planned([other, raised])[1].residue
    assert planned([0 * raised])[0].residue == 0.0


def test_a_row_that_magnifies_the_amplifiers_noise_beyond_what_is_right_is_refused() -> None:
    device = Device.model_validate(LINKED.as_dict() | {"surroundings": {"amplifier_noise": 1e-6}})
    raised, calm = np.ones((6, 6)), np.tile([1.0, 0, 1, 0, 1, 0], (6, 1))
    (refused, *_), (made, *_) = planned([raised], device), planned([calm], device)
    assert refused.outcome is Outcome.UNREACHABLE
    assert "quieter amplifier" in refused.note
    assert refused.error > 0.02
    assert made.outcome is Outcome.OK
    assert 0 < made.error < 0.02


def test_a_profile_without_surroundings_is_written_as_before() -> None:
    assert "surroundings" not in LINKED.model_copy(update={"surroundings": None}).as_dict()
    stated = Device.model_validate(LINKED.as_dict() | {"surroundings": {"amplifier_noise": 1e-5}})
    written = json.loads(json.dumps(stated.as_dict()))
    assert written["surroundings"]["amplifier_noise"] == 1e-5
    assert Device.model_validate(written) == stated


def test_what_rings_after_the_way_out_is_no_error() -> None:
    raised = np.zeros((6, 6))
    raised[1:3] = 1.0
    mixed = np.random.default_rng(3).integers(0, 2, (6, 6)).astype(float)
    *_, out = planned([raised, mixed], dwell_s=1.0)
    assert out.frame is None
    assert out.error == 0.0
