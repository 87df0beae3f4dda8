"""A drive evaluated, sampled and played: against other formulas, and against the file that is written."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from chainsim import Amplifier, Chain, Closure, Device, GridIntegrator, load_device
from drivers import Waveform
from drivers.waveform.coupling import CouplingWriter, LamTrack
from encoders import Frame, TargetPattern
from planner import FirstOrderHold, FramePlan, OperatingPoint, Plan, PointTone, Ramp, ToneRamp, links_at
from planner.drive import cubic, cubic_slope, curve, felt, full_motion, play, samples, smooth_step

# Without a converter, whose steps would cover what is compared.
FREE = Amplifier(volts=100.0, slew_v_per_s=3e5, rate_hz=8000)
THREE = load_device("linked-6x6").model_copy(update={"rows": 1, "cols": 3, "chain_length": 3, "amplifier": FREE})
PATTERN = TargetPattern(np.zeros((1, 1), dtype=np.complex128))

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def nodes(seed: int, count: int, shape: tuple[int, ...] = ()) -> tuple[Floats, Complexes, Complexes]:
    rng = np.random.default_rng(seed)
    at = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 2.0, count - 1))])
    values, slopes = (rng.normal(size=(count, *shape)) + 1j * rng.normal(size=(count, *shape)) for _ in range(2))
    return at, values.astype(np.complex128), slopes.astype(np.complex128)


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
        z = full_motion(chain, dtau / every, (envelope * np.exp(1j * omega * tau)).real[:, None], still)[::every, 0]
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
    both = full_motion(chain, 0.1, force, links, before=(ahead, links))
    for place in range(2):
        alone = full_motion(chain, 0.1, force[:, [place]], links, before=(ahead[:, [place]], links))
        np.testing.assert_allclose(both[:, [place]], alone, rtol=1e-12, atol=1e-15)
    moving = np.broadcast_to(links, (200, 1, 3))
    np.testing.assert_allclose(
        full_motion(chain, 0.1, force, moving, before=(ahead, links)), both, rtol=1e-12, atol=1e-15
    )


def written(device: Device, point: OperatingPoint, ramp: Ramp, end_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Forces of the drive and links of every sample, from what the driver writes for one chain."""
    shown = FramePlan(Frame(PATTERN, end_s), 0.0, ramp.duration_s, end_s, (point,), (ramp,))
    volts = np.concatenate(list(Waveform.of(Plan(device, [shown], {})).blocks(100)))[:, 0]
    time_s = np.arange(len(volts)) / device.amplifier.rate_hz
    lam = LamTrack(CouplingWriter(device).events(shown), device.rows, device.cols).at(time_s)
    return volts * device.epsilon_per_volt, lam[:, 0, 1:]


def steps_of(device: Device, count: int) -> np.ndarray:
    return np.arange(count) / device.amplifier.rate_hz * device.tau_per_s


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.95, 1.3))
def test_what_is_written_are_the_samples_of_the_ramp(seed: int, omega: float) -> None:
    """Drives of several tones, links that jump behind their way, and what a ramp leaves out."""
    rng, (at, values, slopes) = np.random.default_rng(seed), nodes(seed, 4, (3,))
    t_s = at / at[-1] * 0.03
    own, other, fading = (
        ToneRamp(omega + 0.01 * k, 1e-3 * values[:, k], None if straight else 1e-3 * slopes[:, k] * at[-1] / 0.03)
        for k, straight in enumerate([False, rng.integers(2), False])
    )
    lam_t_s, lam = np.sort(rng.uniform(0.0, 0.03, 3)), rng.uniform(0.0, 0.01, (3, 2))
    lam_t_s[0] = 0.0
    ramp = Ramp(t_s, own.epsilon, own.epsilon_slope, lam_t_s=lam_t_s, lam=lam, tones=(other, fading))
    tone = PointTone(other.omega, 1e-3 * complex(values[-1, 1]), np.zeros(3, complex))
    point = OperatingPoint(
        1e-3 * complex(values[-1, 0]), rng.uniform(0.0, 0.01, 2), omega, np.zeros(3, complex),
        mean=np.zeros(3), bias=np.zeros(3), target=np.ones(3), tones=(tone,),
    )  # fmt: skip
    force, links = written(THREE, point, ramp, 0.05)
    tau = steps_of(THREE, len(force))
    np.testing.assert_allclose(samples(THREE, point, ramp, tau), force, atol=1e-12)
    np.testing.assert_allclose(links_at(point, ramp, tau / THREE.tau_per_s), links, atol=1e-11)


@pytest.mark.parametrize("start", [0.0, 1.3])
def test_what_is_played_is_the_motion_of_what_is_written(start: float) -> None:
    """From a motion, too; `start` turns every tone by its own frequency."""
    at, values, slopes = nodes(1, 4)
    t_s, lam = at / at[-1] * 0.03, np.array([[0.0, 0.004], [0.01, 0.0]])
    ramp = Ramp(t_s, 1e-3 * values, 1e-3 * slopes * at[-1] / 0.03, lam_t_s=np.array([0.0, 0.02]), lam=lam)
    point = OperatingPoint(
        1e-3 * complex(values[-1]), np.array([0.003, 0.005]), 1.02, np.zeros(3, complex),
        mean=np.zeros(3), bias=np.zeros(3), target=np.ones(3),
    )  # fmt: skip
    turn = np.exp(1j * point.omega * start)
    turned = replace(ramp, epsilon=turn * ramp.epsilon, epsilon_slope=turn * ramp.epsilon_slope)
    force, links = written(THREE, replace(point, epsilon=turn * point.epsilon), turned, 0.05)
    tau, ahead = steps_of(THREE, len(force)), 0.01 * np.random.default_rng(0).normal(size=(50, 3))
    grid = GridIntegrator(
        shape=(1, 3), chain_length=3, delta=THREE.delta, beta=THREE.beta, ring=False, dtau=tau[1]
    )  # fmt: skip
    grid.advance(ahead[:, None], np.array([[0.0, 0.01, 0.02]]))
    pushed = np.zeros((len(tau), 1, 3))
    pushed[:, 0, 0] = force
    z = grid.advance(pushed, np.pad(links, ((0, 0), (1, 0)))[:, None])[:, 0]
    played = play(THREE, point, ramp, tau, start=start, ahead=(ahead, np.array([0.01, 0.02])))
    np.testing.assert_allclose(played, z, atol=1e-11)
