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
@pytest.mark.slow
def test_one_command_makes_every_figure(tmp_path):
    subprocess.run([sys.executable, "-m", "samples.paper", str(tmp_path)], cwd=ROOT, check=True, capture_output=True)
    report = (tmp_path / "report.md").read_text(encoding="utf-8")
    for name in FIGURES:
        assert (tmp_path / f"{name}.png").stat().st_size > 20_000
        assert f"]({name}.png)" in report
