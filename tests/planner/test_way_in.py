"""Ways into waves: followed under the full equations by code of their own, from rest, at any phase of the carrier."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from chainsim import Chain, GridIntegrator, Outcome, Setting, balance_near, load_device
from planner.amplitudes.refine import refine
from planner.operating_point import OperatingPoint
from planner.plan import Ramp
from planner.transitions.fall import find_fall
from planner.transitions.limits import WayError, WayLimits
from planner.transitions.rise import find_way
from planner.transitions.search import RampSearch
from planner.transitions.steering import LinkCourse, Steering, rest
from tests.support.known import known

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

PAPER = load_device("paper-6x6")
TAU_PER_S = PAPER.tau_per_s
LIMITS = WayLimits(
    epsilon_max=PAPER.epsilon_max,
    lam_min=PAPER.coupling.lam.min,
    lam_max=PAPER.coupling.lam.max,
    lam_scope="chain",
    slew_per_s=PAPER.amplifier.slew_v_per_s * PAPER.epsilon_per_volt,
    well_share=0.8,
)
BUDGET = 150
WAVES = [(lag, amplitude) for lag in (60, 90, 120, 150) for amplitude in (0.03, 0.07)] + [(120, 0.11)]
# Samples a period: straight lines between them are then the carrier to 4e-5.
FINE = 300


@cache
def wave(lag: float, amplitude: float, n: int = 6, beta: float = -1.0) -> tuple[float, OperatingPoint]:
    """omega and the uniform wave of docs/theory.md section 2.2, its phasors from harmonic balance."""
    phi, omega = math.radians(lag), 1.0
    for _ in range(100):
        lam = PAPER.delta * omega / math.sin(phi)
        omega = math.sqrt(1 + 0.75 * beta * amplitude**2 + lam * (1 - math.cos(phi)))
    chain = Chain(n=n, delta=PAPER.delta, beta=beta)
    epsilon = amplitude * (1 - omega**2 + 0.75 * beta * amplitude**2 + 1j * PAPER.delta * omega)
    setting = Setting.of(chain, epsilon=abs(epsilon), phase=np.angle(epsilon), lam=lam, omega=omega)
    answer = balance_near(chain, setting, amplitude * np.exp(-1j * phi * np.arange(n))[None, :], tol=1e-10)
    assert answer.outcome[0] in (Outcome.OK, Outcome.UNSTABLE)
    return omega, OperatingPoint(complex(epsilon), np.full(n - 1, lam), omega, answer.phasor[0])


def way(chain: Chain, omega: float, held: OperatingPoint, limits: WayLimits = LIMITS, budget: int = BUDGET) -> Ramp:
    return find_way(
        chain, epsilon=held.epsilon, lam=held.lam, omega=omega, phasor=held.phasor, limits=limits,
        tau_per_s=TAU_PER_S, budget=budget,
    )  # fmt: skip


@cache
def paper_way(lag: float, amplitude: float) -> Ramp:
    return way(PAPER.chain, *wave(lag, amplitude))


def controls(ramps: list[tuple[float, Ramp]], held: OperatingPoint, tau: Floats) -> tuple[Complexes, Floats]:
    """Drive envelope and links at `tau` of ramps that begin at given seconds, each holding its end."""
    epsilon, lam = np.zeros(len(tau), dtype=np.complex128), np.repeat(held.lam[None, :], len(tau), axis=0)
    for start_s, ramp in ramps:
        assert ramp.epsilon is not None
        assert ramp.epsilon_slope is not None
        here = tau >= start_s * TAU_PER_S
        t = np.minimum(tau[here] / TAU_PER_S - start_s, ramp.duration_s)
        epsilon[here] = CubicHermiteSpline(ramp.t_s, ramp.epsilon, ramp.epsilon_slope)(t)
        if ramp.lam is not None and ramp.lam_t_s is not None:
            for m, link in enumerate(ramp.lam.T):
                lam[here, m] = np.interp(t, ramp.lam_t_s, link)
    return epsilon, lam


def integrated(
    chain: Chain,
    omega: float,
    ramps: list[tuple[float, Ramp]],
    held: OperatingPoint,
    until_s: float,
    phase: float = 0.0,
) -> tuple[Floats, Complexes, Floats]:
    """Middle of each period in seconds, first harmonics in it, shape (periods, n), and the largest |z| in it."""
    dtau = 2 * np.pi / omega / FINE
    periods = math.ceil(until_s * TAU_PER_S * omega / (2 * np.pi))
    tau = dtau * np.arange(periods * FINE, dtype=np.float64)
    epsilon, links = controls(ramps, held, tau)
    carrier = np.exp(1j * (omega * tau + phase))
    force, lam = np.zeros((2, len(tau), 1, chain.n))
    force[:, 0, 0], lam[:, 0, 1:] = (epsilon * carrier).real, links
    grid = GridIntegrator(
        shape=(1, chain.n), chain_length=chain.n, delta=chain.delta, beta=chain.beta, ring=False, dtau=dtau
    )
    z = grid.advance(force, lam)[:, 0].reshape(periods, FINE, chain.n)
    felt = 2 * (z * carrier.conj().reshape(periods, FINE, 1)).mean(axis=1)
    return tau[FINE // 2 :: FINE] / TAU_PER_S, felt, np.abs(z).max(axis=(1, 2))


@pytest.mark.parametrize(("lag", "amplitude"), WAVES)
def test_every_actuator_stands_from_the_end_of_the_way_on(lag: float, amplitude: float) -> None:
    omega, held = wave(lag, amplitude)
    ramp = paper_way(lag, amplitude)
    assert not ramp.lacking
    for phase in (0.0, 2.0):
        middle, felt, peak = integrated(PAPER.chain, omega, [(0.0, ramp)], held, ramp.duration_s + 2.5, phase)
        after = middle > ramp.duration_s + np.pi / omega / TAU_PER_S
        away = np.abs(felt[after] - held.phasor) / np.abs(held.phasor)
        assert away.max() <= 1e-3
        assert peak.max() <= 0.8 * PAPER.escape_amplitude


@pytest.mark.parametrize(("lag", "amplitude"), [(60, 0.07), (90, 0.03), (150, 0.07)])
def test_a_constant_drive_takes_at_least_twice_as_long(lag: float, amplitude: float) -> None:
    omega, held = wave(lag, amplitude)
    sudden = Ramp(t_s=np.array([0.0, 1e-6]), epsilon=np.full(2, held.epsilon), epsilon_slope=np.zeros(2, complex))
    middle, felt, _ = integrated(PAPER.chain, omega, [(0.0, sudden)], held, 2.0)
    away = np.abs(np.abs(felt) - np.abs(held.phasor)) > 0.05 * np.abs(held.phasor)
    settled_s = middle[np.flatnonzero(away.any(axis=1))[-1]]
    assert settled_s >= 2 * paper_way(lag, amplitude).duration_s


def test_dop853_agrees() -> None:
    """Another integrator, under the ramp's own curves instead of samples."""
    omega, held = wave(120, 0.11)
    ramp, n = paper_way(120, 0.11), 6
    assert ramp.epsilon is not None
    assert ramp.epsilon_slope is not None
    assert ramp.lam is not None
    drive = CubicHermiteSpline(ramp.t_s, ramp.epsilon, ramp.epsilon_slope)
    one, lam_t_s = ramp.lam[:, 0], known(ramp.lam_t_s)

    def slope(tau: float, state: Floats) -> Floats:
        t = min(tau / TAU_PER_S, ramp.duration_s)
        z, v = state[:n], state[n:]
        out = np.concatenate([v, -PAPER.delta * v - z - PAPER.beta * z**3])
        out[n] += (complex(drive(t)) * np.exp(1j * omega * tau)).real
        out[n + 1 :] += float(np.interp(t, lam_t_s, one)) * (z[:-1] - z[1:])
        return out

    period = 2 * np.pi / omega
    points = ramp.duration_s * TAU_PER_S + period * np.arange(40 * 32) / 32
    ran = solve_ivp(slope, (0.0, points[-1]), np.zeros(2 * n), "DOP853", t_eval=points, rtol=1e-9, atol=1e-12)
    turned = ran.y[:n] * np.exp(-1j * omega * points)
    felt = 2 * turned.reshape(n, 40, 32).mean(axis=2).T
    assert (np.abs(felt - held.phasor) / np.abs(held.phasor)).max() <= 1e-4


@pytest.mark.parametrize(("lag", "amplitude"), WAVES)
def test_limits_are_kept_and_ends_are_joined(lag: float, amplitude: float) -> None:
    omega, held = wave(lag, amplitude)
    ramp = paper_way(lag, amplitude)
    fine = np.linspace(0.0, ramp.duration_s, 4001)
    epsilon, lam = controls([(0.0, ramp)], held, fine * TAU_PER_S)
    assert np.abs(epsilon).max() <= LIMITS.epsilon_max
    force = (epsilon * np.exp(1j * omega * fine * TAU_PER_S)).real
    assert np.abs(np.diff(force) / np.diff(fine)).max() <= LIMITS.slew_per_s
    assert lam.min() >= LIMITS.lam_min
    assert lam.max() <= LIMITS.lam_max
    np.testing.assert_array_equal(lam, np.repeat(lam[:, :1], 5, axis=1))
    np.testing.assert_allclose(lam[-1], held.lam, rtol=1e-9)
    assert epsilon[0] == 0
    assert epsilon[-1] == pytest.approx(held.epsilon, rel=1e-12)
    assert ramp.epsilon_slope is not None
    np.testing.assert_allclose(ramp.epsilon_slope[[0, -1]], 0.0, atol=1e-12)


def test_the_same_question_has_the_same_answer() -> None:
    first, second = paper_way(120, 0.07), way(PAPER.chain, *wave(120, 0.07))
    for name in ("t_s", "epsilon", "epsilon_slope", "lam_t_s", "lam"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


@pytest.mark.parametrize(
    ("limits", "budget", "lacks"),
    [
        (replace(LIMITS, epsilon_max=1e-4), 12, "volts"),
        (replace(LIMITS, slew_per_s=0.1), 12, "slew"),
        (replace(LIMITS, well_share=0.05), 12, "well"),
        (replace(LIMITS, lam_max=5e-3), 12, "range of lam"),
        (LIMITS, 1, "budget"),
    ],
)
def test_an_impossible_way_says_what_is_lacking(limits: WayLimits, budget: int, lacks: str) -> None:
    ramp = way(PAPER.chain, *wave(120, 0.07), limits, budget)
    assert ramp.lacking
    assert lacks in ramp.lacking
    assert ramp.epsilon is not None
    assert np.isfinite(ramp.epsilon).all()


def test_a_motion_that_is_not_stable_is_no_goal() -> None:
    """Beyond 1.5 |beta| a^2 sin(phi) cos(phi) = delta omega, a = 0.09 at 60 degrees, the wave is the middle branch."""
    omega, held = wave(60, 0.11)
    assert "not stable" in way(PAPER.chain, omega, held).lacking


@pytest.mark.slow
def test_weak_links_that_may_not_move_take_longer() -> None:
    omega, held = wave(150, 0.02)
    ramp = way(PAPER.chain, omega, held, replace(LIMITS, lam_scope="fixed"))
    assert not ramp.lacking
    assert ramp.lam is None
    middle, felt, _ = integrated(PAPER.chain, omega, [(0.0, ramp)], held, ramp.duration_s + 1.0)
    after = middle > ramp.duration_s + np.pi / omega / TAU_PER_S
    assert (np.abs(felt[after] - held.phasor) / np.abs(held.phasor)).max() <= 1e-3
    assert ramp.duration_s > way(PAPER.chain, omega, held).duration_s


def test_every_link_may_have_its_own_course() -> None:
    chain, omega = PAPER.chain, math.sqrt(1.06)
    amplitude = 0.03 * np.array([1.0, 0.6, 1.0, 0.6, 0.8, 1.0])
    found = refine(chain, amplitude[None, :], omega)
    held = OperatingPoint(complex(found.epsilon[0]), found.lam[0], omega, found.phasor[0])
    ramp = way(chain, omega, held, replace(LIMITS, lam_scope="link", lam_max=0.2))
    assert not ramp.lacking
    assert ramp.lam is not None
    np.testing.assert_allclose(ramp.lam[-1], held.lam, rtol=1e-9)
    middle, felt, _ = integrated(chain, omega, [(0.0, ramp)], held, ramp.duration_s + 1.0)
    after = middle > ramp.duration_s + np.pi / omega / TAU_PER_S
    assert (np.abs(felt[after] - held.phasor) / np.abs(held.phasor)).max() <= 1e-3


def test_the_budget_is_kept() -> None:
    omega, held = wave(120, 0.07)
    search = RampSearch(PAPER.chain, rest(held.lam, omega), held, omega, LIMITS, TAU_PER_S, 9)
    assert search.shorter_and_shorter()
    assert search.spent <= 9


@pytest.mark.parametrize(("n", "beta"), [(1, -1.0), (2, -1.0), (3, 0.0), (4, 1.0), (7, -1.0)])
def test_chains_of_other_lengths_and_kinds(n: int, beta: float) -> None:
    omega, held = wave(100, 0.04, n, beta)
    chain = Chain(n=n, delta=PAPER.delta, beta=beta)
    ramp = way(chain, omega, held)
    assert not ramp.lacking
    middle, felt, _ = integrated(chain, omega, [(0.0, ramp)], held, ramp.duration_s + 1.0)
    after = middle > ramp.duration_s + np.pi / omega / TAU_PER_S
    assert (np.abs(felt[after] - held.phasor) / np.abs(held.phasor)).max() <= 1e-3


def test_the_scale_of_z_does_not_matter() -> None:
    """z -> z / sqrt|beta| takes one chain into the other (docs/theory.md section 1.2)."""
    omega, held = wave(120, 0.07)
    strong = Chain(n=6, delta=PAPER.delta, beta=-1e4)
    small = OperatingPoint(held.epsilon / 100, held.lam, omega, held.phasor / 100)
    ramp, big = way(strong, omega, small), paper_way(120, 0.07)
    assert ramp.epsilon is not None
    assert big.epsilon is not None
    np.testing.assert_allclose(ramp.t_s, big.t_s)
    np.testing.assert_allclose(100 * ramp.epsilon, big.epsilon, atol=1e-6 * np.abs(big.epsilon).max())


@pytest.mark.parametrize(("lag", "scope"), [(120, "chain"), (90, "fixed")])
def test_a_fall_leaves_a_thousandth(lag: float, scope: Literal["chain", "fixed"]) -> None:
    omega, held = wave(lag, 0.07)
    limits = replace(LIMITS, lam_scope=scope)
    ramp = paper_way(lag, 0.07)
    fall = find_fall(
        PAPER.chain, epsilon=held.epsilon, lam=held.lam, omega=omega, phasor=held.phasor, limits=limits,
        tau_per_s=TAU_PER_S, budget=BUDGET,
    )  # fmt: skip
    assert not fall.lacking
    begins_s = ramp.duration_s + 0.3
    ramps = [(0.0, ramp), (begins_s, fall)]
    middle, felt, _ = integrated(PAPER.chain, omega, ramps, held, begins_s + fall.duration_s + 1.0)
    share = (np.abs(felt) / np.abs(held.phasor)).max(axis=1)
    assert share[middle > begins_s + fall.duration_s].max() <= 1.02e-3
    assert share[middle < begins_s + 0.9 * fall.duration_s][-1] > 1e-3


def test_what_makes_no_sense_is_refused() -> None:
    omega, held = wave(120, 0.07)
    grid = Chain(n=6, delta=PAPER.delta, beta=-1.0, rows=2)
    for chain, other in [
        (grid, held),
        (PAPER.chain, replace(held, lam=held.lam[:3])),
        (PAPER.chain, replace(held, lam=np.linspace(1, 2, 5) * 1e-3)),
        (PAPER.chain, replace(held, phasor=np.zeros(6, complex))),
        (PAPER.chain, replace(held, phasor=held.phasor * np.nan)),
        (PAPER.chain, replace(held, epsilon=0j)),
    ]:
        with pytest.raises(WayError):
            way(chain, omega, other)
    with pytest.raises(WayError, match="lam_min"):
        replace(LIMITS, lam_min=0.1)
    with pytest.raises(WayError, match="epsilon_max"):
        replace(LIMITS, epsilon_max=math.nan)


def test_slopes_of_drive_and_links_belong_to_them() -> None:
    _, held = wave(120, 0.07)
    start = OperatingPoint(0.7j * held.epsilon, 2 * held.lam, 1.01, 1.3 * held.phasor)
    task = Steering(PAPER.chain, 1.0, start, held, LinkCourse(0.05, 0.25), 300.0)
    x, h = np.linspace(0.0, 1.0, 997), 1e-6
    unknowns = np.random.default_rng(3).normal(size=(2, task.size))
    for curve in (lambda at: task.drive(at, unknowns), lambda at: task.links.at(at, start, held)):
        slope = (curve(x + h)[0] - curve(x - h)[0]) / (2 * h)
        np.testing.assert_allclose(curve(x)[1][1:-1], slope[1:-1], atol=1e-4 * np.abs(slope).max())
