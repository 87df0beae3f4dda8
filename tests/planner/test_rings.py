"""Rings: which waves they hold, and that these stand within a second."""

from __future__ import annotations

import numpy as np
import pytest
from _pytest.mark import ParameterSet

from chainsim import Outcome, load_device
from planner.operating_point import OperatingPoint
from planner.targets import WaveTarget
from planner.transitions.waves import enter_wave, leave_wave
from planner.waves.wave_fit import GOOD
from planner.waves.wave_state import wave_state
from tests.support.joint_motion import Step, felt_after

RING = load_device("paper-6x6-ring")


def slow(*values: float) -> ParameterSet:
    return pytest.param(*values, marks=pytest.mark.slow)


def wave(lag_deg: float, level: float) -> OperatingPoint:
    phase = np.angle(np.exp(-1j * np.radians(lag_deg) * np.arange(6)))
    return wave_state(RING, WaveTarget.of(np.full(6, level), phase, np.ones(6)))


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
