"""samples/paper: its numbers beside the paper's, and the one command."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from chainsim import Chain, Closure, Setting, solve
from chainsim.continuation.locking import locking
from chainsim.continuation.spectrum import delta_from_critical_lam

ROOT = Path(__file__).parents[2]
FIGURES = ["fig2", "fig4", "fig5", "ranges", "control"]
LAM = 6.131e-3
plotting = pytest.mark.skipif(importlib.util.find_spec("matplotlib") is None, reason="needs matplotlib")


@pytest.fixture(scope="module")
def delta():
    return delta_from_critical_lam(6.13e-3, 6)


@pytest.fixture
def paper(monkeypatch):
    """The folder's modules, by the name the command gives them."""
    monkeypatch.syspath_prepend(str(ROOT))
    return lambda name: importlib.import_module(f"samples.paper.{name}")


@pytest.mark.parametrize(("epsilon", "lag", "tolerance"), [(3.91e-4, 60, 4), (1.175e-3, 120, 0.5)])
def test_states_a_and_b_of_the_open_chain(delta, epsilon, lag, tolerance):
    chain = Chain(6, delta, -1.0)
    found = solve(chain, Setting.of(chain, epsilon=epsilon, lam=LAM, omega=1.0), tol=1e-9)
    assert -np.degrees(found.phase_step[0]) == pytest.approx(lag, abs=tolerance)
    assert np.abs(found.multipliers).max() < 1


def test_state_c_belongs_to_the_ring(delta, paper):
    orbit = paper("states").ring_orbit(6e-4, delta)
    assert int((np.abs(orbit.multipliers) > 1).sum()) >= 2
    ring = Chain(6, delta, -1.0, Closure.RING)
    assert not locking(ring, Setting.of(ring, epsilon=6e-4, lam=LAM, omega=1.0), start="rest").locked[0]


def test_the_soft_spring_jumps_at_its_folds_in_both_directions(delta, paper):
    single = paper("single")
    chain = Chain(1, delta, -1.0)
    path = single.branch(2e-3, chain)
    up, down = single.swept(2e-3, 0.93, 1.03, chain), single.swept(2e-3, 1.03, 0.93, chain)
    # A sweep passes a fold by a little before it falls off.
    assert 0 < single._jump(*up) - path.jump_up < 4e-3
    assert 0 < path.jump_down - single._jump(*down) < 4e-3


@pytest.mark.parametrize("profile", [(1, 1, 0.1, 0.1, 1, 1), (0.1, 1, 0.1, 1, 0.1, 1)])
def test_chosen_links_make_the_profile(delta, paper, profile):
    assert paper("control").chosen_links(delta, profile) == pytest.approx(profile, abs=2e-3)


def test_random_starts_end_alike_at_resonance(delta, paper):
    control = paper("control")
    trial = control.starts(delta, np.random.default_rng(1), {"epsilon": 1.175e-3, "lam": LAM, "omega": 1.0}, "x")
    assert len(trial.profiles) == control.DRAWS
    assert trial.distinct == 1


@plotting
def test_a_figure_says_what_is_inferred(tmp_path, paper):
    page = paper("equilibrium").figure(tmp_path)
    assert (tmp_path / "fig4.png").stat().st_size > 20_000
    assert "inference" in page.verdict
    assert "6.1300e-03 | 6.13e-3" in page.text()


@plotting
def test_the_layers_imply_a_beam_whose_linear_peak_comes_near_its_length(delta, paper):
    beam = paper("beam").beam_of(133.13, 100.0)
    # Rayleigh's quotient of the clamped beam's mode, integrated here, gives the frequency back.
    x, k, s = np.linspace(0, beam.length_m, 20001), 1.8751 / beam.length_m, 0.734096
    bend = k**2 * (np.cosh(k * x) + np.cos(k * x) - s * (np.sinh(k * x) + np.sin(k * x)))
    move = np.cosh(k * x) - np.cos(k * x) - s * (np.sinh(k * x) - np.sin(k * x))
    z = np.linspace(0, 260.35e-6, 200001)
    kapton = (z < 19.05e-6) | (z > 222.25e-6)
    stiffness = 2 * np.trapezoid(np.where(kapton, 2.5e9, 61e9) * z**2, z)
    mass = 2 * np.trapezoid(np.where(kapton, 1420.0, 7750.0), z)
    omega2 = stiffness * np.trapezoid(bend**2, x) / (mass * np.trapezoid(move**2, x))
    assert np.sqrt(omega2) / (2 * np.pi) == pytest.approx(133.13, rel=1e-3)
    # The first mode's share of what the piezo's moment bends, integrated the same way.
    moment = 2 * np.trapezoid(np.where(kapton, 0.0, 61e9 * 171e-12 * 100 / (2 * 203.2e-6)) * z, z)
    tip = move[-1] * moment * np.trapezoid(bend, x) / (mass * omega2 * np.trapezoid(move**2, x))
    assert beam.tip_m == pytest.approx(tip, rel=2e-3)
    assert 0.5 * beam.length_m < beam.tip_m / delta < beam.length_m


def test_three_digits_of_the_critical_value_leave_a_band_of_damping(paper):
    low, high = (delta_from_critical_lam(end, 6) for end in paper("equilibrium").ROUNDED)
    assert (low, high) == pytest.approx((5.2963e-3, 5.3049e-3), rel=1e-4)


@pytest.mark.slow
def test_one_command_makes_every_figure(tmp_path):
    subprocess.run([sys.executable, "-m", "samples.paper", str(tmp_path)], cwd=ROOT, check=True, capture_output=True)
    report = (tmp_path / "report.md").read_text(encoding="utf-8")
    for name in FIGURES:
        assert (tmp_path / f"{name}.png").stat().st_size > 20_000
        assert f"]({name}.png)" in report
