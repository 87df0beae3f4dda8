"""Many drawn chains at once, against harmonic balance, polynomial roots and closed-form quantiles."""

from __future__ import annotations

from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from chainsim import Chain, Closure, GridIntegrator, Outcome, Setting, balance_near, load_device, solve
from planner.amplitudes.deflection import Deflection
from planner.amplitudes.vibration import Vibration
from planner.closed_forms.links import drive_for, links_for
from planner.errors import PlanError
from planner.operating_point import OperatingPoint, PointTone
from planner.robustness.batch_march import BatchParts, march
from planner.robustness.ring_march import march_ring
from planner.robustness.spread import FrameTarget, RelativeSpread, SpreadError, draw, judge, motion_of, spread_of
from planner.robustness.tone_march import march_tones
from planner.waves.two_tones import MAIN, two_tones

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

DEVICE = load_device("linked-6x6")
CHAIN = DEVICE.chain
PROFILE = np.array([1, 1, 0.1, 0.1, 1, 1])


def first(epsilon: complex, n: int = 6) -> Complexes:
    force = np.zeros((n, 1), dtype=np.complex128)
    force[0] = epsilon
    return force


def links(lam: Floats) -> Floats:
    return np.concatenate([[0.0], lam])[:, None]


@pytest.mark.parametrize("full_scale", [0.01, 0.05, 0.1, 0.2])
def test_drawn_chains_agree_with_harmonic_balance(full_scale: float) -> None:
    """What one harmonic leaves out goes with the square of the cubic term's share."""
    omega, count = 1.35, 8
    lam, epsilon = (
        links_for(CHAIN, full_scale * PROFILE, omega),
        float(drive_for(CHAIN, full_scale * PROFILE[:1], omega)[0]),
    )
    parts = draw(6, count=count, seed=3).parts(CHAIN, RelativeSpread(f0=0.01, delta=0.1, beta=0.2, lam=0.05))
    motion = march(parts, first(epsilon)[:, None], links(lam)[:, None], omega)
    for j in range(count):
        one = Chain.of(6, delta=parts.delta[:, 0, j], beta=parts.beta[:, 0, j], stiffness=parts.stiffness[:, 0, j])
        setting = Setting.of(one, epsilon=epsilon, lam=[lam * parts.lam_gain[1:, 0, j]], omega=omega)
        reference = solve(one, setting, tol=1e-9, rung="harmonic_balance", start="rest")
        assert reference.outcome[0] is Outcome.OK
        scale = np.abs(reference.phasor[0]).max()
        left_out = 0.4 * (np.abs(parts.beta[:, 0, j]).max() * scale**2) ** 2
        np.testing.assert_allclose(motion.phasor[:, 0, j], reference.phasor[0], rtol=0, atol=(left_out + 1e-8) * scale)


def roots_of(k: float, delta: float, cubic: float, push: float) -> Floats:
    """Every |A|^2 of one oscillator, ascending."""
    found = np.roots([cubic**2, 2 * cubic * k, k**2 + delta**2, -(push**2)])
    real = found[np.abs(found.imag) < 1e-7 * np.abs(found)].real
    return np.sort(real[real > 0])


@given(
    st.floats(-0.5, 0.5), st.floats(1e-4, 0.05), st.sampled_from([-1.0, 1.0]), st.floats(1e-3, 30.0),
    st.floats(1e-5, 0.1), st.booleans(),
)  # fmt: skip
def test_one_oscillator_has_the_roots_of_its_cubic(
    k: float, delta: float, sign: float, beta: float, push: float, high: bool
) -> None:
    expected = roots_of(k, delta, 0.75 * sign * beta, push)
    parts = BatchParts(np.array([[1 + k]]), np.array([[delta]]), np.array([[sign * beta]]), np.ones((1, 1)))
    wanted = expected[-1] if high else expected[0]
    near = push / (k + 0.75 * sign * beta * wanted + 1j * delta) if high else None
    motion = march(
        parts, np.full((1, 1), push + 0j), np.zeros((1, 1)), 1.0, None if near is None else np.array([[near]])
    )
    found = abs(motion.phasor[0, 0]) ** 2

    def balance(square: float) -> float:
        return square * ((k + 0.75 * sign * beta * square) ** 2 + delta**2) / push**2

    # Far up a branch the balance turns on a small difference: what a billionth of the answer changes is no error.
    rounding = abs(balance(found * (1 + 1e-9)) - balance(found * (1 - 1e-9)))
    assert balance(found) == pytest.approx(1, abs=1e-8 + rounding)
    # Close to a fold the roots of the polynomial and of the balance part at the square root of the rounding.
    apart = np.diff(expected).min() / expected[-1] if len(expected) == 3 else 1.0
    if apart > 1e-3:
        assert found == pytest.approx(wanted, rel=1e-6)


def test_a_static_deflection_solves_its_cubic() -> None:
    parts = draw(4, count=5, seed=1).parts(Chain(4, 0.01, -1.0), RelativeSpread(f0=0.02, beta=0.3, lam=0.1))
    bias, lam = np.array([0.2, -0.1, 0.05, 0.3]), np.array([0.0, 0.02, 0.05, 0.01])
    phasor = march(parts, (bias + 0j)[:, None, None], lam[:, None, None], 0.0).phasor
    assert np.all(phasor.imag == 0)
    z = phasor.real
    coupled = lam[:, None, None] * parts.lam_gain
    before = np.concatenate([np.zeros_like(z[:1]), z[:-1]])
    force = bias[:, None, None] + coupled * (before - z)
    np.testing.assert_allclose(parts.stiffness * z + parts.beta * z**3, force, atol=1e-14)
    assert np.abs(z).max() < 0.5


def test_tangents_are_finite_differences() -> None:
    rng = np.random.default_rng(0)
    parts = draw(6, count=3, seed=5).parts(CHAIN, RelativeSpread(f0=0.01))
    lam, omega = np.full(6, 0.3) * (np.arange(6) > 0), 1.3
    force = np.zeros((6, 1, 1), dtype=np.complex128)
    force[0] = 0.03
    motion = march(parts, force, lam[:, None, None], omega)
    before = np.concatenate([np.zeros_like(motion.phasor[:1]), motion.phasor[:-1]])
    directions = rng.standard_normal((2, 6, 1, 1))
    own = np.stack([directions[0] + 0 * before, directions[1] * (before - motion.phasor)], axis=1)
    own[0, 1] = 0
    found = motion.tangent(own)
    h = 1e-6
    dlam = directions[1] * (np.arange(6) > 0)[:, None, None]
    for d, (df, dl) in enumerate(((directions[0], 0.0), (0.0, dlam))):
        ends = [march(parts, force + s * h * df, lam[:, None, None] + s * h * dl, omega).phasor for s in (1, -1)]
        np.testing.assert_allclose(found[:, d], (ends[0] - ends[1]) / (2 * h), rtol=1e-6, atol=1e-8)


def test_quantiles_of_one_linear_actuator_are_those_of_the_normal_distribution() -> None:
    # Above resonance the amplitude falls as the natural frequency falls, so the draws that are made are an interval.
    chain, omega, sigma, epsilon = Chain(1, 5e-3, 0.0), 1.2, 0.01, 0.1
    nominal = epsilon / abs(1 - omega**2 + 1j * chain.delta * omega)
    wish = FrameTarget(np.array([[1.0 + 0j]]), nominal)
    parts = draw(1, count=200_000, seed=0).parts(chain, RelativeSpread(f0=sigma))
    report = judge(
        wish, march(parts, np.full((1, 1, 1), epsilon + 0j), np.zeros((1, 1, 1)), omega), tolerance=0.05, threshold=0.5
    )

    def error(x: float) -> float:
        return abs(epsilon / abs((1 + sigma * x) ** 2 - omega**2 + 1j * chain.delta * omega) / nominal - 1)

    made = [x for x in np.linspace(-5, 5, 100_001) if error(x) <= 0.05]
    normal = NormalDist()
    assert report.yield_ == pytest.approx(normal.cdf(max(made)) - normal.cdf(min(made)), abs=0.005)
    assert report.right.all()
    assert report.expected == pytest.approx(report.error.mean())
    assert report.quantile(1.0) == report.error.max()


def states(targets: Floats) -> list[OperatingPoint]:
    return Vibration(DEVICE, 20.0).states(np.maximum(targets, 0.1))


def test_a_frame_without_spread_is_at_its_target_and_with_spread_is_not() -> None:
    frame = states(np.random.default_rng(2).integers(0, 2, (6, 6)).astype(float))
    exact = spread_of(DEVICE, frame, RelativeSpread(), tolerance=0.01, threshold=0.5, count=3)
    assert exact.error.max() < 1e-4
    assert exact.yield_ == 1.0
    errors = [
        spread_of(DEVICE, frame, RelativeSpread(f0=s), tolerance=0.05, threshold=0.5, count=300).median
        for s in (1e-4, 1e-3, 1e-2)
    ]
    # To first order the error grows with the spread.
    assert errors[1] / errors[0] == pytest.approx(10, rel=0.1)
    assert errors[2] > 5 * errors[1]


def test_a_frame_held_by_biases_hardly_feels_the_spread() -> None:
    device = load_device("paper-6x6")
    frame = Deflection(device).states(np.random.default_rng(2).integers(0, 2, (6, 6)).astype(float))
    assert spread_of(device, frame, RelativeSpread(), tolerance=0.01, threshold=0.5, count=1).error.max() < 1e-6
    # z = b/k to first order, and k is the square of the natural frequency.
    small = spread_of(device, frame, RelativeSpread(f0=0.01), tolerance=0.2, threshold=0.5)
    assert small.yield_ == 1.0
    assert 0.01 < small.median < 0.1


def test_the_same_seed_gives_the_same_draws_and_more_spread_the_same_directions() -> None:
    frame = states(np.eye(6))
    again = [
        spread_of(DEVICE, frame, RelativeSpread(f0=0.003, lam=0.01), tolerance=0.1, threshold=0.5, seed=9).error
        for _ in "ab"
    ]
    np.testing.assert_array_equal(again[0], again[1])
    other = spread_of(DEVICE, frame, RelativeSpread(f0=0.003, lam=0.01), tolerance=0.1, threshold=0.5, seed=8).error
    assert not np.array_equal(again[0], other)


def test_draws_have_the_deviations_asked_for() -> None:
    parts = draw(6, count=4000, seed=0, chains=6).parts(CHAIN, RelativeSpread(f0=0.01, delta=0.05, beta=0.1, lam=0.02))
    assert np.sqrt(parts.stiffness).std() == pytest.approx(0.01, rel=0.02)
    assert parts.delta.std() / CHAIN.delta == pytest.approx(0.05, rel=0.02)
    assert parts.beta.mean() == pytest.approx(-1, abs=0.002)
    assert parts.lam_gain.std() == pytest.approx(0.02, rel=0.02)
    wild = draw(6, count=1000, seed=0).parts(CHAIN, RelativeSpread(f0=3.0, delta=3.0, lam=3.0))
    assert min(wild.stiffness.min(), wild.delta.min(), wild.lam_gain.min()) > 0


@settings(max_examples=20)
@given(st.floats(-7, 7), st.booleans())
def test_a_common_phase_changes_no_error(turn: float, phase_matters: bool) -> None:
    rng = np.random.default_rng(1)
    wanted = np.exp(1j * rng.uniform(0, 6, (2, 6))) * rng.uniform(0.1, 1, (2, 6))
    phasor = wanted.T[:, :, None] * rng.normal(1, 0.1, (6, 2, 5)) * 0.05
    wish = FrameTarget(wanted, 0.05, phase_matters=phase_matters)
    np.testing.assert_allclose(
        np.abs(wish.deviation(phasor)), np.abs(wish.deviation(phasor * np.exp(1j * turn))), atol=1e-12
    )


def test_a_frame_shares_its_phase_over_chains_of_one_group() -> None:
    wanted = np.exp(1j * np.array([[0.0, 0.3], [1.0, 1.3]]))
    off = np.array([1.0, np.exp(0.2j)])[None, :, None]
    phasor = wanted.T[:, :, None] * off
    together = FrameTarget(wanted, 1.0, phase_matters=True).deviation(phasor)
    # One turn by 0.1 radians leaves each chain 0.1 radians off.
    np.testing.assert_allclose(together, 2 * np.sin(0.05), rtol=1e-12)
    apart = FrameTarget(wanted, 1.0, phase_matters=True, group=np.array([0, 1])).deviation(phasor)
    assert np.abs(apart).max() < 1e-12
    some = FrameTarget(wanted, 1.0, phase_matters=np.array([[True, True], [False, False]])).deviation(phasor)
    assert np.abs(some).max() < 1e-12


def test_planned_phases_and_tones_are_known() -> None:
    state = states(np.eye(6))[0]
    phases = np.angle(state.phasor)
    frame = [replace(state, phase=phases), replace(state, phase=np.where(np.arange(6) < 3, phases + 0.4, np.nan))]
    report = spread_of(DEVICE, frame, RelativeSpread(), tolerance=0.1, threshold=0.5, count=1)
    assert 0.2 < report.error.max() < 0.4
    alone = spread_of(DEVICE, frame[1:], RelativeSpread(), tolerance=0.1, threshold=0.5, count=1)
    assert alone.error.max() < 1e-4
    tone = PointTone(1.1, 1e-3 + 0j, state.phasor)
    with pytest.raises(SpreadError, match="expected states of one tone, got more"):
        spread_of(DEVICE, [replace(state, tones=(tone,))], RelativeSpread(), tolerance=0.1, threshold=0.5)


def test_phase_matters_only_when_it_does_and_weights_forgive() -> None:
    wanted = np.ones((1, 3), dtype=np.complex128)
    phasor = np.array([1.0, 1j, -1.0]).reshape(3, 1, 1)
    assert np.abs(FrameTarget(wanted, 1.0).deviation(phasor)).max() == 0
    assert np.abs(FrameTarget(wanted, 1.0, phase_matters=True).deviation(phasor)).max() > 1
    wish = FrameTarget(wanted, 1.0, weight=np.array([[1.0, 0.0, 1.0]]))
    off = wish.deviation(np.array([1.0, 5.0, 1.0]).reshape(3, 1, 1) + 0j)
    assert np.abs(off).max() == 0


@pytest.mark.parametrize("phase_matters", [False, True, np.arange(12).reshape(2, 6) % 3 > 0])
@pytest.mark.parametrize("group", [None, np.array([0, 1])])
def test_slopes_are_finite_differences(phase_matters: bool | NDArray[np.bool_], group: NDArray[np.intp] | None) -> None:
    rng = np.random.default_rng(4)

    def noise(*shape: int) -> Complexes:
        return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)

    wish = FrameTarget(noise(2, 6), 0.5, phase_matters=phase_matters, weight=rng.uniform(0, 1, (2, 6)), group=group)
    phasor, change, h = noise(6, 2, 4), noise(6, 3, 2, 4), 1e-6
    slopes = wish.slope(phasor, change)
    for d in range(3):
        ends = [wish.deviation(phasor + s * h * change[:, d]) for s in (1, -1)]
        np.testing.assert_allclose(slopes[:, d], (ends[0] - ends[1]) / (2 * h), atol=1e-6)


def test_an_actuator_beyond_its_hilltop_is_not_made() -> None:
    chain = Chain(1, 5e-3, -1.0)
    parts = draw(1, count=1, seed=0).parts(chain, RelativeSpread())
    motion = march(parts, np.full((1, 1, 1), 2.0 + 0j), np.zeros((1, 1, 1)), 1.05)
    assert motion.escaped.all()
    report = judge(
        FrameTarget(np.ones((1, 1), complex), abs(motion.phasor[0, 0, 0])), motion, tolerance=1.0, threshold=0.5
    )
    assert report.error.max() < 1e-12
    assert report.yield_ == 0.0


def test_bad_input_names_the_value() -> None:
    with pytest.raises(SpreadError, match=r"spread.delta: expected a relative standard deviation >= 0, got -0.1"):
        RelativeSpread(delta=-0.1)
    with pytest.raises(SpreadError, match="got nan"):
        RelativeSpread(f0=float("nan"))
    for chain in (Chain(6, 5e-3, -1.0, Closure.BIDIRECTIONAL), Chain(6, 5e-3, -1.0, rows=2)):
        with pytest.raises(PlanError, match=r"spread: not judged in (bidirectional chain|grid)s"):
            draw(6, count=1, seed=0).parts(chain, RelativeSpread())
    driven, biased = states(np.eye(6))[0], Deflection(load_device("paper-6x6")).states(np.eye(6))[0]
    with pytest.raises(SpreadError, match="both in one frame"):
        motion_of([driven, biased], draw(6, count=1, seed=0, chains=2).parts(CHAIN, RelativeSpread()))


RING = load_device("paper-6x6-ring")


def test_drawn_rings_agree_with_harmonic_balance() -> None:
    """The branch of the ring they are drawn around, followed to each of them."""
    chain, omega, lam, count = RING.chain, 1.002, np.full(6, 3e-3), 12
    near = solve(
        chain, Setting.of(chain, epsilon=2e-4, lam=[lam], omega=omega), tol=1e-10, rung="harmonic_balance", start="rest"
    )
    assert near.outcome[0] is Outcome.OK
    parts, centre = (
        draw(6, count=k, seed=1).parts(chain, s)
        for k, s in ((count, RelativeSpread(f0=3e-4, delta=0.02, lam=0.02)), (1, RelativeSpread()))
    )
    motion = march_ring(
        parts, centre, first(2e-4)[:, None], lam[:, None, None], np.full((1, 1), omega), near.phasor.T[:, :, None]
    )
    assert not motion.escaped.any()
    for j in range(count):
        one = Chain.of(6, delta=parts.delta[:, 0, j], beta=-1.0, stiffness=parts.stiffness[:, 0, j], closure="ring")
        setting = Setting.of(one, epsilon=2e-4, lam=[lam * parts.lam_gain[:, 0, j]], omega=omega)
        real = balance_near(one, setting, motion.phasor[:, 0, j][None], tol=1e-10)
        np.testing.assert_allclose(
            motion.phasor[:, 0, j], real.phasor[0], rtol=0, atol=1e-4 * np.abs(near.phasor).max()
        )
        assert np.abs(motion.phasor[:, 0, j] - near.phasor[0]).max() > 1e-3 * np.abs(near.phasor).max()


def test_rings_whose_branch_ends_are_not_felt() -> None:
    """At an amplitude of a few widths of the resonance a small detuning is beyond the fold."""
    chain, omega, lam = RING.chain, 0.99, np.full(6, 3e-3)
    setting = Setting.of(chain, epsilon=2e-3, lam=[lam], omega=omega)
    near = solve(chain, setting, tol=1e-10, rung="harmonic_balance", start="rest").phasor.T[:, :, None]
    assert np.isfinite(near).all()
    parts, centre = (draw(6, count=k, seed=0).parts(chain, RelativeSpread(f0=s)) for k, s in ((300, 0.01), (1, 0.0)))
    motion = march_ring(parts, centre, first(2e-3)[:, None], lam[:, None, None], np.full((1, 1), omega), near)
    lost = motion.escaped[0]
    assert 0 < np.count_nonzero(lost) < 300
    assert not motion.phasor[:, 0, lost].any()
    z, links = motion.phasor, lam[:, None, None] * parts.lam_gain
    stage = parts.stiffness + links - omega**2 + 1j * parts.delta * omega - 0.75 * np.abs(z) ** 2
    left = stage * z - links * np.roll(z, 1, axis=0)
    left[0] -= 2e-3
    assert np.abs(left[:, 0, ~lost]).max() < 1e-9


def walking(lam: float = 0.02, amplitude: float = 0.01, n: int = 6) -> OperatingPoint:
    """Two tones under one lam, as a device without spread holds them."""
    chain = Chain(n, 5.3e-3, -1.0)
    found = two_tones(chain, amplitude=amplitude, width=2.0, lam=lam)
    assert found is not None
    phasors = found.phasor[:, None] * np.exp(-1j * np.outer(found.lag, np.arange(n)))
    tones = [
        PointTone(float(w), complex(e), z, k not in (MAIN, MAIN + 1))
        for k, (w, e, z) in enumerate(zip(found.omega, found.epsilon, phasors, strict=True))
    ]
    head, *others = sorted(tones, key=lambda tone: tone.side)
    return replace(
        states(np.eye(6))[0], target=np.ones(n), epsilon=head.epsilon, omega=head.omega, phasor=head.phasor,
        lam=np.full(n - 1, found.lam), tones=tuple(others),
    )  # fmt: skip


def flat(parts: BatchParts) -> BatchParts:
    return BatchParts(parts.stiffness[:, 0], parts.delta[:, 0], parts.beta[:, 0], parts.lam_gain[:, 0])


def test_tones_without_spread_are_those_planned() -> None:
    state = walking()
    motion = march_tones(state, flat(draw(6, count=1, seed=0).parts(Chain(6, 5.3e-3, -1.0), RelativeSpread())))
    planned = [state.phasor, next(tone.phasor for tone in state.tones if not tone.side)]
    assert not motion.lost.any()
    np.testing.assert_allclose(motion.phasor[motion.wanted, :, 0], planned, rtol=1e-6)


def test_drawn_tones_are_those_of_the_full_equations() -> None:
    state, n = walking(n=2, amplitude=0.02), 2
    parts = flat(draw(n, count=1, seed=2).parts(Chain(n, 5.3e-3, -1.0), RelativeSpread(f0=1e-3, delta=0.05, lam=0.05)))
    motion = march_tones(state, parts)
    every = [(state.omega, state.epsilon), *((tone.omega, tone.epsilon) for tone in state.tones)]
    dtau, last = 2 * np.pi / 64, 25_000
    tau = np.arange(64 * 1200) * dtau
    force = np.zeros((len(tau), 1, n))
    force[:, 0, 0] = sum((epsilon * np.exp(1j * omega * tau)).real for omega, epsilon in every)
    grid = GridIntegrator(
        shape=(1, n), chain_length=n, delta=parts.delta.T, beta=parts.beta.T, stiffness=parts.stiffness.T, ring=False,
        dtau=dtau,
    )  # fmt: skip
    z = grid.advance(force, np.append(0.0, state.lam * parts.lam_gain[1:, 0])[None])[-last:, 0]
    omega = np.array(sorted(omega for omega, _ in every))
    basis = np.concatenate(
        [np.exp(1j * np.outer(tau[-last:], omega)), np.exp(-1j * np.outer(tau[-last:], omega))], axis=1
    )
    seen = 2 * np.linalg.lstsq(basis, z.astype(np.complex128))[0][: len(omega)]
    np.testing.assert_allclose(motion.phasor[..., 0], seen, rtol=0, atol=3e-3 * 0.02)
    assert np.abs(np.abs(motion.phasor[motion.wanted, :, 0]) - 0.02).max() > 0.02 * 0.02


def test_tones_that_are_not_equally_spaced_are_refused() -> None:
    state = walking()
    odd = replace(state, tones=(replace(state.tones[0], omega=state.tones[0].omega + 1e-4), *state.tones[1:]))
    with pytest.raises(ValueError, match="expected equal spacings"):
        march_tones(odd, flat(draw(6, count=1, seed=0).parts(Chain(6, 5e-3, -1.0), RelativeSpread())))
