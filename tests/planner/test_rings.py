"""Rings: which waves they hold, and that these stand within a second."""

from __future__ import annotations

import numpy as np
import pytest
from _pytest.mark import ParameterSet

from chainsim import Outcome, balance_near, load_device
from planner.closed_forms.joint_links import links_round
from planner.operating_point import OperatingPoint, setting_of
from planner.planner import Planner
from planner.targets import AmplitudeTarget, WaveTarget
from planner.transitions.waves import enter_wave, leave_wave
from planner.waves.wave_fit import GOOD
from planner.waves.wave_forms import wave_for
from planner.waves.wave_state import wave_state
from tests.support.joint_motion import Step, felt_after

RING, LINKED = load_device("paper-6x6-ring"), load_device("linked-ring-6x6")


def slow(*values: float) -> ParameterSet:
    return pytest.param(*values, marks=pytest.mark.slow)


def wave(lag_deg: float, level: float) -> OperatingPoint:
    phase = np.angle(np.exp(-1j * np.radians(lag_deg) * np.arange(6)))
    return wave_state(RING, WaveTarget.of(np.full(6, level), phase, np.ones(6)))


# Of docs/theory.md section 3: lags, and the largest level at which each is stable.
MAP = {65: 0.78, 70: 0.88, 80: 0.64, 100: 0.94, 110: 0.56, 115: 0.38}


def stable(lag_deg: float, level: float) -> bool:
    """Whether a ring's wave is an orbit of the full equations whose multipliers lie within the circle."""
    chain, amplitude = RING.chain, level * RING.full_scale
    point = wave_for(chain, amplitude=amplitude, lag=np.radians(lag_deg))
    phasor = amplitude * np.exp(-1j * np.radians(lag_deg) * np.arange(6))
    found = balance_near(chain, setting_of(chain, [point]), phasor[None], tol=1e-9)
    assert np.abs(found.phasor[0] - phasor).max() < 0.02 * amplitude
    return bool(found.stable[0])


@pytest.mark.parametrize(("lag_deg", "level"), MAP.items())
def test_the_map_of_stable_waves(lag_deg: float, level: float) -> None:
    assert stable(lag_deg, 0.9 * level)
    assert not stable(lag_deg, 1.1 * level)


def test_what_the_map_leaves_out() -> None:
    # 90 degrees are stable far above full scale, and nothing is below 60 or above 120 degrees.
    assert stable(90, 1.0)
    assert not stable(55, 0.05)
    assert not stable(125, 0.05)
    # A mode of the ring itself takes no drive.
    for lag in (60, 120):
        assert abs(wave_for(RING.chain, amplitude=0.02, lag=np.radians(lag)).epsilon) < 1e-15


@pytest.mark.slow
@pytest.mark.parametrize(("lag_deg", "level"), MAP.items())
def test_every_wave_of_the_map_stands_within_a_second(lag_deg: float, level: float) -> None:
    held = wave(lag_deg, 0.8 * level)
    assert held.outcome is Outcome.OK
    way_in = enter_wave(RING, held, True, GOOD)
    assert way_in.lacking == ""
    assert way_in.duration_s < 1.0


@pytest.mark.parametrize(("lag_deg", "level"), [(90, 1.0), slow(75, 0.3), slow(105, 0.3)])
def test_a_wave_stands_within_a_second_and_is_gone_in_two(lag_deg: float, level: float) -> None:
    held = wave(lag_deg, level)
    assert held.outcome is Outcome.OK
    way_in, way_out = enter_wave(RING, held, True, GOOD), leave_wave(RING, held, True)
    assert (way_in.lacking, way_out.lacking) == ("", "")
    assert way_in.duration_s < 1.0
    assert way_out.duration_s < 2.0
    rest = OperatingPoint(0j, held.lam * 0 + RING.coupling.lam.min, held.omega)
    standing, gone = felt_after(RING, [Step(way_in, held, 0.3), Step(way_out, rest, 0.1)])
    scale = float(np.abs(held.phasor).max())
    # From the first period on: amplitudes and lags alike.
    assert np.abs(standing - held.phasor).max() < 1e-3 * scale
    assert np.abs(gone).max() < 1.1e-3 * scale


@pytest.mark.slow
def test_programmable_links_hold_dots_on_a_ring_where_it_stays_stable() -> None:
    family = Planner(LINKED, 20.0)
    targets = [AmplitudeTarget.of(np.array(list(row), dtype=np.float64)) for row in ("100100", "000100")]
    held, refused = (family.points([family.held(target, False)])[0] for target in targets)
    assert (held.outcome, refused.outcome) == (Outcome.OK, Outcome.UNREACHABLE)
    assert 0 < held.margins.multiplier < 1
    assert refused.lacking
    way_in = enter_wave(LINKED, held, True, GOOD)
    assert way_in.lacking == ""
    assert way_in.duration_s < 1.0
    (standing,) = felt_after(LINKED, [Step(way_in, held, 0.2)])
    felt = np.abs(standing) / LINKED.full_scale
    assert np.abs(felt - held.target).max() < 1.5e-3
    assert np.abs(felt[:, [0, 3]] - 1).max() < 1.5e-3
    assert felt[:, [1, 2, 4, 5]].max() < 0.102


def test_links_round_a_ring_are_those_of_its_balance() -> None:
    chain, omega = LINKED.chain, 1.03
    held = links_round(chain, 0.05 * np.array([[1.0, 0.1, 0.1, 1.0, 0.05, 0.05]]), omega, 1.0)
    (lam,), (phasor,), (epsilon,) = held.lam, held.phasor, held.epsilon
    stage = 1 - omega**2 + 0.75 * chain.beta * np.abs(phasor) ** 2 + 1j * chain.delta * omega
    whole = np.concatenate([lam[:1], lam])
    asked = stage * phasor - whole * (np.roll(phasor, 1) - phasor)
    np.testing.assert_allclose(asked, [epsilon, 0, 0, 0, 0, 0], atol=1e-13)
