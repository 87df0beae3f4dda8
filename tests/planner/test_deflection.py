"""Patterns held by a DC bias: the static balance, its limits, and ramps under the full equations."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from chainsim import Closure, Device, Outcome, Span, load_device
from planner import Ramp
from planner.amplitudes.deflection import Deflection
from planner.families import family_of, row_of
from planner.targets import AmplitudeTarget
from tests.support.known import known

PAPER = load_device("paper-6x6")
ROWS = np.array(list(product((0.0, 1.0), repeat=6)))
Floats = NDArray[np.float64]


def altered(*, lam_min: float = 0.0, closure: Closure = Closure.OPEN, volts: float = 100.0, **fields: object) -> Device:
    coupling = PAPER.coupling.model_copy(update={"closure": closure, "lam": Span(min=lam_min, max=0.05)})
    amplifier = PAPER.amplifier.model_copy(update={"volts": volts})
    return PAPER.model_copy(update={"coupling": coupling, "amplifier": amplifier, **fields})


def force_at_rest(device: Device, z: Floats, bias: Floats) -> Floats:
    """What is left of the static equations of docs/theory.md section 2.4; zero at an equilibrium."""
    before = np.roll(z, 1, axis=-1)
    lam = np.full(6, device.coupling.lam.min)
    if device.coupling.closure is Closure.OPEN:
        lam[0] = 0.0
    return lam * (before - z) + bias - z - device.beta * z**3


def test_it_is_the_family_of_a_device_with_biases() -> None:
    assert isinstance(family_of(row_of(AmplitudeTarget, PAPER), PAPER, 20.0), Deflection)


@pytest.mark.parametrize("lam_min", [0.0, 0.01, 0.05])
def test_every_row_is_held(lam_min: float) -> None:
    device = altered(lam_min=lam_min)
    states = Deflection(device).states(ROWS)
    for target, state in zip(ROWS, states, strict=True):
        assert state.outcome is Outcome.OK
        assert state.error < 1e-12
        np.testing.assert_allclose(state.mean, target * device.full_scale, atol=1e-13)
        np.testing.assert_allclose(force_at_rest(device, target * device.full_scale, state.bias), 0.0, atol=1e-15)
        np.testing.assert_array_equal(state.lam, np.full(5, lam_min))
        assert state.epsilon == 0
        assert not state.phasor.any()


def test_amplitudes_between_nothing_and_all() -> None:
    targets = np.random.default_rng(2).uniform(0.0, 1.0, (50, 6))
    for target, state in zip(targets, Deflection(altered(lam_min=0.02)).states(targets), strict=True):
        np.testing.assert_allclose(state.mean / PAPER.full_scale, target, atol=1e-12)


def test_an_open_link_costs_an_unraised_dot_nothing() -> None:
    (state,) = Deflection(PAPER).states(np.array([[1.0, 0, 0, 1, 0, 1]]))
    np.testing.assert_array_equal(state.bias[[1, 2, 4]], 0.0)
    assert state.bias[0] == pytest.approx(0.15 - 0.15**3, rel=1e-14)


def test_margins_in_closed_form() -> None:
    (state,) = Deflection(PAPER).states(np.ones((1, 6)))
    bias = 0.15 - 0.15**3
    assert state.margins.volts == pytest.approx(bias / 0.2, rel=1e-12)
    assert state.margins.well == pytest.approx(bias / (2 / (3 * math.sqrt(3))), rel=1e-12)
    (hardening,) = Deflection(altered(beta=0.5)).states(np.ones((1, 6)))
    assert hardening.margins.well == 0.0


@pytest.mark.parametrize("beta", [-1.0, -4.0])
@pytest.mark.parametrize(
    ("share", "outcome"), [(0.55, Outcome.OK), (0.99, Outcome.UNREACHABLE), (1.6, Outcome.UNREACHABLE)]
)
def test_beyond_the_fold_nothing_stands(beta: float, share: float, outcome: Outcome) -> None:
    """Beyond the fold the bias that balances is below the static limit but unstable; near it there is no margin."""
    device = altered(full_scale=share / math.sqrt(-3 * beta), beta=beta, bias_per_volt=0.01)
    family = Deflection(device)
    states = family.states(np.array([[0.0] * 6, [1.0] * 6, [0, 0, 0, 0, 0, 1.0]]))
    assert [state.outcome for state in states] == [Outcome.OK, outcome, outcome]
    if outcome is Outcome.UNREACHABLE:
        assert "lacks depth of the well" in states[1].lacking
        assert "softening well" in family.note()


def test_without_volts_it_is_unreachable() -> None:
    needed = (0.15 - 0.15**3) / PAPER.bias_per_volt
    for factor, outcome in ((1.01, Outcome.OK), (0.99, Outcome.UNREACHABLE)):
        (state,) = Deflection(altered(volts=factor * needed)).states(np.array([[0, 1.0, 0, 0, 0, 0]]))
        assert state.outcome is outcome
    assert "lacks volts" in Deflection(PAPER).note()


def test_a_ring_of_separate_actuators() -> None:
    (state,) = Deflection(altered(closure=Closure.RING)).states(np.array([[1.0, 0, 1, 1, 0, 1]]))
    assert state.outcome is Outcome.OK
    assert state.error < 1e-9


@pytest.mark.slow
def test_a_ring_that_howls_is_not_called_ok() -> None:
    """Above its critical lam a ring has no rest, whatever the bias (docs/theory.md section 3)."""
    (state,) = Deflection(altered(closure=Closure.RING, lam_min=0.02)).states(np.array([[1.0, 0, 1, 1, 0, 1]]))
    assert state.outcome is not Outcome.OK


def ramp_between(device: Device, before: Floats, after: Floats) -> Ramp:
    family = Deflection(device)
    one, other = family.states(np.array([before, after], dtype=np.float64))
    (ramp,) = family.ramps([one], [other])
    assert ramp is not None
    assert ramp.duration_s == family.ramp_s
    np.testing.assert_allclose(known(ramp.bias)[[0, -1]], [one.bias, other.bias], atol=1e-15)
    return ramp


def ringing(device: Device, ramp: Ramp, start: Floats, end: Floats, off: float = 1.0) -> Floats:
    """Largest distance of each actuator from `end`, as a share of full scale, in 20 periods after the ramp.

    `off` detunes all actuators: their stiffness is off^2.
    """
    curve = CubicHermiteSpline(ramp.t_s * device.tau_per_s, ramp.bias, ramp.bias_slope)
    duration = ramp.duration_s * device.tau_per_s
    lam = np.full(6, device.coupling.lam.min)
    lam[0] = 0.0

    def slope(tau: float, state: Floats) -> Floats:
        z, v = state[:6], state[6:]
        force = lam * (np.roll(z, 1) - z) + curve(min(tau, duration))
        return np.concatenate([v, force - device.delta * v - off**2 * z - device.beta * z**3])

    points = duration + np.linspace(0.0, 40 * np.pi, 800)
    state = np.concatenate([start, np.zeros(6)])
    ran = solve_ivp(slope, (0.0, points[-1]), state, "DOP853", t_eval=points, rtol=1e-9, atol=1e-12)
    away: Floats = np.abs(ran.y[:6] - end[:, None]).max(axis=1) / device.full_scale
    return away


@pytest.mark.parametrize("lam_min", [0.0, 0.05])
@pytest.mark.parametrize(
    ("before", "after"), [([0, 0, 0, 0, 0, 0], [1, 0, 1, 1, 0, 1]), ([1, 0, 1, 0, 1, 1], [0, 1, 1, 0, 0.3, 0])]
)
def test_nothing_rings_after_a_ramp(lam_min: float, before: list[float], after: list[float]) -> None:
    device = altered(lam_min=lam_min)
    one, other = np.array(before, dtype=np.float64), np.array(after, dtype=np.float64)
    ramp = ramp_between(device, one, other)
    assert ringing(device, ramp, one * device.full_scale, other * device.full_scale).max() < 1e-3


def test_an_actuator_off_by_three_per_cent_hardly_rings() -> None:
    ramp = ramp_between(PAPER, np.zeros(6), np.ones(6))
    off, full_scale = 1.03, PAPER.full_scale
    bias = full_scale + PAPER.beta * full_scale**3
    stands = min(root.real for root in np.roots([PAPER.beta, 0.0, off**2, -bias]) if root.real > 0)
    assert ringing(PAPER, ramp, np.zeros(6), np.full(6, stands), off).max() < 1e-3


@pytest.mark.parametrize("lam_min", [0.0, 0.05])
def test_bias_and_slope_are_what_the_motion_asks_for(lam_min: float) -> None:
    """bias = z'' + delta z' + z + beta z^3 - lam (z_before - z), and its derivative, for z a polynomial of time."""
    device = altered(lam_min=lam_min, full_scale=0.5, bias_per_volt=0.01)
    before, after = np.array([1.0, 0, 0, 1, 0.5, 0]), np.array([0.0, 1, 0, 1, 1, 0.2])
    ramp = ramp_between(device, before, after)
    duration = ramp.duration_s * device.tau_per_s
    rate = Polynomial([0.0, 1.0, -1.0]) ** 5
    blend = rate.integ() / rate.integ()(1.0)
    x = ramp.t_s[:, None] / ramp.duration_s
    z, v, push, jerk = (
        device.full_scale * (after - before) * (blend.deriv(k) if k else blend)(x) / duration**k for k in range(4)
    )
    z = z + device.full_scale * before
    lam = np.array([0.0, *[lam_min] * 5])
    bias = push + device.delta * v + z + device.beta * z**3 - lam * (np.roll(z, 1, axis=1) - z)
    slope = jerk + device.delta * push + v + 3 * device.beta * z**2 * v - lam * (np.roll(v, 1, axis=1) - v)
    np.testing.assert_allclose(known(ramp.bias), bias, atol=1e-11)
    np.testing.assert_allclose(known(ramp.bias_slope) / device.tau_per_s, slope, atol=1e-11)
    np.testing.assert_array_equal(known(ramp.bias_slope)[[0, -1]], 0.0)


def test_what_stands_needs_no_ramp() -> None:
    family = Deflection(PAPER)
    states = family.states(ROWS[:4])
    ramps = family.ramps(states, [states[0], states[2], states[2], states[1]])
    assert [ramp is None for ramp in ramps] == [True, False, True, False]
    assert family.ramp_s < 0.1
