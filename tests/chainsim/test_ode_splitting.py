"""The composition: its coefficients, its order, and its flow, against independent answers."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from chainsim.equations.composition import FLOWS, KICK_TIMES, KICKS
from chainsim.equations.views import PlainNetwork
from chainsim.time_domain.splitting import advance_block, flow, forcing_table


def transient(
    *, steps: int, periods: int, epsilon=2e-2, lam=0.0, beta=-1.0, delta=0.02, omega=1.1, n=1, ring=False, lanes=1
):
    """State (z, v) of `lanes` equal chains after whole periods from rest; shape (lanes, 2n)."""
    links = np.full((lanes, n), lam)
    if not ring:
        links[:, 0] = 0.0
    state, peak = np.zeros((lanes, 2 * n)), np.zeros(lanes)
    drive, period = np.tile([epsilon, 0.0], (lanes, 1)), np.full(lanes, 2 * np.pi / omega)
    system = PlainNetwork(links, np.zeros((lanes, n)), drive, period, delta, beta, ring)
    advance_block(state, np.arange(lanes), system, forcing_table(steps), 0, steps * periods, peak)
    state[:, n:] -= 0.5 * delta * state[:, :n]
    return state


def dop853(*, periods, epsilon=2e-2, lam=0.0, beta=-1.0, delta=0.02, omega=1.1, n=1, ring=False):
    links = np.full(n, lam)
    if not ring:
        links[0] = 0.0

    def slope(tau, y):
        z, v = y[:n], y[n:]
        a = -delta * v - z - beta * z**3 + links * (np.roll(z, 1) - z)
        a[0] += epsilon * np.cos(omega * tau)
        return np.concatenate([v, a])

    span = (0.0, periods * 2 * np.pi / omega)
    return solve_ivp(slope, span, np.zeros(2 * n), method="DOP853", rtol=1e-12, atol=1e-16).y[:, -1]


def test_lengths_and_weights_are_consistent():
    assert FLOWS.sum() == pytest.approx(1.0, abs=1e-15)
    assert KICKS.sum() == pytest.approx(1.0, abs=1e-15)
    assert np.array_equal(FLOWS, FLOWS[::-1])
    assert np.array_equal(KICKS, KICKS[::-1])
    # Order 8 in the part of the error that is linear in the kicks: quadrature of every power below 8.
    for power in range(8):
        assert np.sum(KICKS * KICK_TIMES**power) == pytest.approx(1 / (power + 1), abs=1e-14)
    assert abs(np.sum(KICKS * KICK_TIMES**8) - 1 / 9) > 1e-6


@given(delta=st.floats(0, 5), stiffness=st.floats(-2, 4), t=st.floats(0.001, 3), x=st.floats(-1, 1), v=st.floats(-1, 1))
def test_flow_is_the_matrix_exponential(delta, stiffness, t, x, v):
    c, s, d = flow(delta, stiffness, t)
    p = v + 0.5 * delta * x
    q, p = c * x + s * p, c * p - d * x
    wanted = expm(np.array([[0.0, 1.0], [-stiffness, -delta]]) * t) @ [x, v]
    assert np.allclose([q, p - 0.5 * delta * q], wanted, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("delta", [2.0, 0.0])
def test_flow_without_oscillation(delta):
    c, s, d = flow(delta, 0.25 * delta**2, 0.7)
    decay = np.exp(-0.35 * delta)
    assert (c, s, d) == pytest.approx((decay, 0.7 * decay, 0.0))


def fitted_order(errors):
    return np.log2(errors[0] / errors[1])


def test_order_is_four_when_kicks_are_large():
    settings: dict[str, Any] = {"periods": 3, "epsilon": 0.3, "beta": 1.0}
    reference = transient(steps=1024, **settings)[0]
    errors = [np.max(np.abs(transient(steps=s, **settings)[0] - reference)) for s in (32, 64)]
    assert fitted_order(errors) == pytest.approx(4, abs=0.3)


def test_order_is_eight_for_a_weak_force_alone():
    settings: dict[str, Any] = {"periods": 3, "epsilon": 1e-3, "beta": 0.0}
    reference = transient(steps=256, **settings)[0]
    errors = [np.max(np.abs(transient(steps=s, **settings)[0] - reference)) for s in (4, 8)]
    assert fitted_order(errors) == pytest.approx(8, abs=0.5)


@pytest.mark.parametrize("ring", [False, True])
@pytest.mark.parametrize("beta", [-1.0, 0.0, 1.0])
def test_agrees_with_dop853(ring, beta):
    # Damped enough for the ring to be stable.
    settings: dict[str, Any] = {
        "periods": 20,
        "epsilon": 3e-2,
        "lam": 0.15,
        "beta": beta,
        "delta": 0.3,
        "n": 3,
        "ring": ring,
    }
    wanted = dop853(**settings)
    assert np.max(np.abs(transient(steps=512, **settings)[0] - wanted)) < 5e-10 * np.max(np.abs(wanted))


def test_eight_steps_reach_a_millionth():
    settings: dict[str, Any] = {"periods": 300, "epsilon": 4e-4, "lam": 6.131e-3, "delta": 6.1e-3, "omega": 1.0, "n": 6}
    coarse, fine = transient(steps=8, **settings)[0], transient(steps=64, **settings)[0]
    apart = np.hypot(*(coarse - fine).reshape(2, 6)) / np.hypot(*fine.reshape(2, 6))
    assert np.max(apart) < 1e-6


def test_a_lane_does_not_depend_on_its_neighbours():
    settings: dict[str, Any] = {"steps": 8, "periods": 50, "lam": 0.1, "n": 4}
    alone = transient(**settings)
    many = transient(lanes=37, **settings)
    assert np.array_equal(many, np.tile(alone, (37, 1)))
