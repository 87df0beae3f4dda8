"""A drive evaluated, sampled and played: against other formulas, and against the file that is written."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from chainsim import Amplifier, Chain, Closure, load_device
from drivers import Waveform
from encoders import Frame, TargetPattern
from planner import FirstOrderHold, FramePlan, OperatingPoint, Plan, Ramp
from planner.drive import cubic, cubic_slope, curve, felt, play, smooth_step

# Without a converter, whose steps would cover what is compared.
FREE = Amplifier(volts=100.0, slew_v_per_s=3e5, rate_hz=8000)
SINGLE = load_device("independent-6x6").model_copy(update={"rows": 1, "cols": 1, "amplifier": FREE})
PATTERN = TargetPattern(np.zeros((1, 1), dtype=np.complex128))


def nodes(seed: int, count: int, shape: tuple[int, ...] = ()) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    at = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 2.0, count - 1))])
    values, slopes = (rng.normal(size=(count, *shape)) + 1j * rng.normal(size=(count, *shape)) for _ in range(2))
    return at, values, slopes


@given(st.integers(0, 1000), st.integers(2, 9))
def test_a_cubic_is_the_hermite_spline_and_still_outside(seed: int, count: int) -> None:
    at, values, slopes = nodes(seed, count)
    inside = np.linspace(0.0, at[-1], 57)
    spline = CubicHermiteSpline(at, values, slopes)
    np.testing.assert_allclose(cubic(inside, at, values, slopes), spline(inside), atol=1e-12)
    np.testing.assert_allclose(cubic_slope(inside[:-1], at, values, slopes), spline(inside[:-1], 1), atol=1e-11)
    outside = np.array([-1.0, at[-1] + 1.0])
    np.testing.assert_allclose(cubic(outside, at, values, slopes), values[[0, -1]], atol=1e-14)
    assert cubic_slope(outside[1:], at, values, slopes).tolist() == [0.0]


def test_curves_side_by_side_are_each_its_own() -> None:
    at, values, slopes = nodes(3, 5, (2, 3))
    inside = np.linspace(0.0, at[-1], 11)
    together = cubic(inside, at, values, slopes)
    for place in np.ndindex(2, 3):
        alone = cubic(inside, at, values[:, *place], slopes[:, *place])
        assert np.array_equal(together[:, *place], alone)


def test_two_nodes_at_one_time_are_a_jump() -> None:
    at, values, slopes = np.array([0.0, 1.0, 1.0, 2.0]), np.array([0.0, 0.0, 3.0, 3.0]), np.zeros(4)
    assert cubic(np.array([0.5, 1.0, 1.5]), at, values, slopes).tolist() == [0.0, 3.0, 3.0]
    assert cubic_slope(np.array([0.5, 1.0, 1.5]), at, values, slopes).tolist() == [0.0, 0.0, 0.0]


def test_without_slopes_lines_are_straight() -> None:
    at, values = np.array([0.0, 1.0, 3.0]), np.array([0.0, 1.0, 0.0])
    assert curve(np.array([-1.0, 0.5, 2.0, 9.0]), at, values, None).tolist() == [0.0, 0.5, 0.5, 0.0]
    assert curve(np.array([0.0, 7.0]), at[:1], values[1:2], np.ones(1)).tolist() == [1.0, 1.0]


def test_the_smooth_step_and_its_derivatives() -> None:
    x, h = np.linspace(0.05, 0.95, 19), 1e-5
    before, here, after = (smooth_step(x + move) for move in (-h, 0.0, h))
    np.testing.assert_allclose((after.value - before.value) / (2 * h), here.slope, atol=1e-8)
    np.testing.assert_allclose((after.slope - before.slope) / (2 * h), here.bend, atol=1e-7)
    for ends in smooth_step(np.array([-1.0, 0.0, 1.0, 2.0]))[1:]:
        assert ends.tolist() == [0.0] * 4
    assert smooth_step(np.array([-1.0, 0.5, 2.0])).value.tolist() == [0.0, 0.5, 1.0]


def test_a_drive_that_rises_comes_in_time_only_with_both_parts_of_the_inverse() -> None:
    """Far from resonance an actuator follows its drive: what coarse samples miss of fine ones is the hold's doing."""
    chain, omega, samples, fine, periods = Chain(n=1, delta=0.02, beta=0.0), 2.0, 16, 16, 60
    dtau = 2 * math.pi / omega / samples
    length, still = periods * samples * dtau, np.zeros(1)

    def motion(every: int, both: bool) -> np.ndarray:
        tau = np.arange(periods * samples * every) * dtau / every
        step, hold = smooth_step(tau / length), FirstOrderHold.of(omega, dtau / every)
        envelope = hold.raised(step.value + 0j, both * step.slope / length + 0j)
        z = play(chain, dtau / every, (envelope * np.exp(1j * omega * tau)).real[:, None], still)[::every, 0]
        return felt(z, np.exp(1j * omega * tau[::every])[:, None], samples)

    truth = motion(fine, True)
    late, in_time = (float(np.abs(motion(1, both) - truth).max()) for both in (False, True))
    assert in_time < 0.25 * late


@pytest.mark.parametrize("closure", [Closure.OPEN, Closure.RING])
def test_what_is_played_side_by_side_is_what_each_does_alone(closure: Closure) -> None:
    chain = Chain(n=3, delta=0.01, beta=-1.0, closure=closure)
    rng = np.random.default_rng(0)
    force, ahead = 0.01 * rng.normal(size=(200, 2)), 0.01 * rng.normal(size=(50, 2, 3))
    links = np.array([0.02 if closure is Closure.RING else 0.0, 0.01, 0.03])
    both = play(chain, 0.1, force, links, before=(ahead, links))
    for place in range(2):
        alone = play(chain, 0.1, force[:, [place]], links, before=(ahead[:, [place]], links))
        np.testing.assert_allclose(both[:, [place]], alone, rtol=1e-12, atol=1e-15)
    moving = np.broadcast_to(links, (200, 1, 3))
    np.testing.assert_allclose(play(chain, 0.1, force, moving, before=(ahead, links)), both, rtol=1e-12, atol=1e-15)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.95, 1.3))
def test_what_is_written_are_the_samples_of_the_ramp(seed: int, omega: float) -> None:
    """Every written sample is the raised envelope on its carrier, but for slopes that the file takes straight."""
    device, rate = SINGLE, SINGLE.amplifier.rate_hz
    at, values, slopes = nodes(seed, 4)
    t_s, end = at / at[-1] * 0.03, 0.05
    scale = 1e-3
    ramp = Ramp(t_s, scale * values, scale * slopes * at[-1] / 0.03)
    last = scale * complex(values[-1])
    none = np.zeros(1)
    point = OperatingPoint(last, none[:0], omega, none + 0j, mean=none, bias=none, target=none + 1)
    plan = Plan(device, [FramePlan(Frame(PATTERN, end), 0.0, 0.03, end, (point,), (ramp,))], {})
    volts = np.concatenate(list(Waveform.of(plan).blocks(100)))[:, 0]
    time_s = np.arange(len(volts)) / rate
    on_way = time_s < t_s[-1]
    envelope = np.where(on_way, cubic(time_s, t_s, ramp.epsilon, ramp.epsilon_slope), last)
    slope = np.where(on_way, np.interp(time_s, t_s, ramp.epsilon_slope), 0.0) / device.tau_per_s
    hold = FirstOrderHold.of(omega, device.tau_per_s / rate)
    force = (hold.raised(envelope, slope) * np.exp(1j * omega * device.tau_per_s * time_s)).real
    np.testing.assert_allclose(volts, force / device.epsilon_per_volt, atol=1e-9)
