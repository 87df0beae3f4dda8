"""Chains whose links act both ways: closed forms, what they hold, the ways in and out, and the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from chainsim import Chain, Closure, Device, DrawnDevices, Outcome, ProfileError, Surroundings, load_device
from dotwave.verification import verify
from drivers import write_waveform
from drivers.protocol.plant import TruePlant
from drivers.protocol.plant_file import PlantError, PlantFile
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import plan_scene
from planner.closed_forms.joint import driven, growth, sensitivity
from planner.closed_forms.joint_links import links_between, links_both_ways
from planner.drive import closed
from planner.operating_point import OperatingPoint
from planner.planner import Planner
from planner.targets import AmplitudeTarget, WalkingTarget, WaveTarget
from planner.transitions.waves import enter_wave, leave_wave
from planner.waves.wave_fit import GOOD
from tests.support.joint_motion import Step, felt_after

LINKED, ONE_LAM = load_device("linked-both-ways-6x6"), load_device("both-ways-6x6")
CHAIN = Chain(n=6, delta=5.3e-3, beta=-1.0, closure=Closure.BIDIRECTIONAL)


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path))


def balance(lam: np.ndarray, phasor: np.ndarray, omega: float) -> np.ndarray:
    """Force on each oscillator that its equation asks for, in one harmonic."""
    kappa = 1 - omega**2 + 0.75 * CHAIN.beta * np.abs(phasor) ** 2 + 1j * CHAIN.delta * omega
    carried = np.concatenate([[0], lam * (phasor[:-1] - phasor[1:]), [0]])
    return np.asarray(kappa * phasor - carried[:-1] + carried[1:])


def of(device: Device, row: str) -> OperatingPoint:
    planner = Planner(device, 20.0)
    target = AmplitudeTarget.of(np.array(list(row), dtype=np.float64))
    return planner.points([planner.held(target, False)])[0]


def test_the_links_hold_the_amplitudes_they_are_for() -> None:
    rng = np.random.default_rng(3)
    amplitude = 0.05 * rng.uniform(0.03, 1, (400, 6))
    exact = 0
    for omega in (0.97, 1.02, 1.2):
        held = links_both_ways(CHAIN, amplitude, omega, 1.0)
        for profile, lam, phasor, epsilon in zip(*held, strict=True):
            if np.allclose(np.abs(phasor), amplitude[profile], rtol=1e-9):
                exact += 1
                assert lam.min() > 0
                np.testing.assert_allclose(balance(lam, phasor, omega), [epsilon, 0, 0, 0, 0, 0], atol=1e-13)
    assert exact > 20


def test_phasors_give_back_the_links_they_were_made_with() -> None:
    amplitude = 0.05 * np.array([[1.0, 0.8, 0.6, 0.4, 0.3, 0.2]])
    held = links_both_ways(CHAIN, amplitude, 0.96, 2.0)
    lam, left = links_between(CHAIN, held.phasor[0], 0.96, 0.0, 2.0)
    np.testing.assert_allclose(lam, held.lam[0], rtol=1e-9)
    assert left < 1e-9
    # Against its own direction nothing is carried: no real link passes a wave of 90 degrees on.
    wave = 0.05 * np.exp(-1j * np.pi / 2 * np.arange(6))
    assert links_between(CHAIN, wave, 1.0, 0.0, 2.0)[1] > 0.3


def test_small_deviations_are_those_of_the_balance() -> None:
    held = links_both_ways(CHAIN, 0.05 * np.array([[1.0, 0.8, 0.6, 0.4, 0.3, 0.2]]), 0.96, 2.0)
    lam, phasor = closed(CHAIN, held.lam[:1]), held.phasor[:1]
    # At rest a chain dies away with its own damping, whatever its links, but for what the slow flow leaves out.
    assert growth(CHAIN, lam, 0 * phasor, 0.96)[0] == pytest.approx(-CHAIN.delta / 2, rel=0.1)
    answer = driven(CHAIN, lam[0], np.array([0.96]))[0]
    linear = balance(lam[0, 1:], 1e-9 * answer, 0.96) / 1e-9
    np.testing.assert_allclose(linear, [1, 0, 0, 0, 0, 0], atol=1e-9)
    assert np.isfinite(sensitivity(CHAIN, lam, phasor, 0.96)[0])


@pytest.mark.parametrize(
    ("device", "row"),
    [
        (LINKED, "100100"),
        (ONE_LAM, "111111"),
        *(pytest.param(LINKED, row, marks=pytest.mark.slow) for row in ("010000", "110000", "101010", "111110")),
    ],
    ids=lambda one: one if isinstance(one, str) else one.name,
)
def test_what_is_held_is_felt(device: Device, row: str) -> None:
    held = of(device, row)
    assert (held.outcome, held.lacking) == (Outcome.OK, "")
    assert 0 < held.margins.multiplier < 1
    way_in, way_out = enter_wave(device, held, True, GOOD), leave_wave(device, held, True)
    assert max(way_in.duration_s, way_out.duration_s) < 1.0
    rest = OperatingPoint(0j, held.lam, held.omega)
    standing, gone = felt_after(device, [Step(way_in, held, 0.2), Step(way_out, rest, 0.1)])
    felt = np.abs(standing) / device.full_scale
    assert np.abs(felt - held.target).max() < 1.5e-3
    wanted = np.array(list(row)) == "1"
    assert 20 * np.log10(felt[:, wanted].min() / felt[:, ~wanted].max(initial=0.0999)) > 19.9
    assert np.abs(gone).max() < 1.1e-3 * device.full_scale


@pytest.mark.slow
def test_what_no_links_hold_is_refused_with_the_nearest() -> None:
    held = of(LINKED, "000101")
    assert held.outcome is Outcome.UNREACHABLE
    assert "no links of this chain hold it" in held.lacking
    assert 0.02 < held.error < 1


def test_waves_are_refused_with_the_nearest() -> None:
    wave = WaveTarget.of(np.full(6, 0.5), np.angle(np.exp(-1j * np.pi / 2 * np.arange(6))), np.ones(6))
    (point,) = Planner(ONE_LAM, 20.0).points([wave])
    assert point.outcome is Outcome.UNREACHABLE
    assert point.lacking
    assert 0.02 < point.error < 0.5
    (walk,) = Planner(ONE_LAM, 20.0).points([WalkingTarget((0.3,) * 6, weight=(1.0,) * 6, width=2.0)])
    assert walk.lacking.endswith("it lacks links that act one way")


def test_what_does_not_know_such_links_says_so() -> None:
    with pytest.raises(ProfileError, match="links act one way"):
        DrawnDevices(LINKED, Surroundings(), first=0, count=8, seed=0, rate_hz=24000, frames=1, weights=1)
    with pytest.raises(PlantError, match="links that act one way"):
        TruePlant(PlantFile.model_validate({}), LINKED, 24000)


def test_through_the_file(tmp_path: Path) -> None:
    rows = ["100000", "000000", "110000", "101010", "100100", "111110"]
    pattern = TargetPattern(np.array([list(row) for row in rows], dtype=np.complex128))
    plan = plan_scene(Scene(GridShape(6, 6), (Frame(pattern, 1.5),)), LINKED)
    write_waveform(plan, tmp_path / "rows.wav")
    (check,) = verify(tmp_path / "rows.wav").frames
    assert (check.outcome, check.wrong_dots) == ("ok", 0)
    assert check.amplitude_error < 1e-3
    assert check.contrast_db is not None
    assert check.contrast_db > 19.9
