"""The short cuts of planning: each gives what the long way gives, and the work it saves is counted."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from chainsim import Chain, load_device, solve
from planner.amplitudes import refine
from planner.amplitudes.vibration import Vibration
from planner.cache import PlanCache
from planner.cache_file import ASKED_AT_ONCE
from planner.closed_forms.links import links_for
from planner.plan import Ramp
from planner.transitions import jets
from planner.transitions.blending import _kinds, blended
from planner.transitions.envelopes import POINTS, change
from planner.transitions.resample import chebyshev_points, converged, resampled
from tests.support.known import known

LINKED = load_device("linked-6x6")
CHAIN, OMEGA = LINKED.chain, 1.35
DURATION = 0.344 * LINKED.tau_per_s
ROWS = np.array([np.where(np.array(dots), 1.0, 0.1) for dots in product((0, 1), repeat=6)]) * LINKED.full_scale


@given(arrays(np.float64, (7, 3), elements=st.floats(-2, 2)))
def test_a_square_is_a_product(jet):
    assert jets.square(jet) == pytest.approx(jets.multiply(jet, jet), rel=1e-13, abs=1e-13)


@given(
    arrays(np.float64, (2, 6, 4), elements=st.floats(-2, 2)), arrays(np.float64, (2, 6, 4), elements=st.floats(-2, 2))
)
def test_products_of_complex_jets(one, other):
    a, b = one[0] + 1j * one[1], other[0] + 1j * other[1]
    whole = jets.multiply(a, b)
    for k in range(6):
        assert whole[k] == pytest.approx(sum(a[j] * b[k - j] for j in range(k + 1)), abs=1e-12)


def test_polynomials_pass_through_chebyshevs_points():
    x, nodes = chebyshev_points(33), np.linspace(0.0, 1.0, 101)
    curves = [lambda t: t**20, lambda t: np.exp(-3 * t) * np.cos(9 * t), lambda t: np.ones_like(t)]
    values = np.stack([curve(x) for curve in curves], axis=-1)[None]
    assert converged(values).all()
    for at, curve in enumerate(curves):
        assert resampled(values, 101)[0, :, at] == pytest.approx(curve(nodes), abs=1e-12)
    rough = np.abs(x - 0.4)[None, :, None]
    assert not converged(rough).any()
    assert not converged(np.concatenate([values, np.broadcast_to(rough, (1, 33, 1))], axis=2)).any()


def test_few_points_say_what_every_node_would():
    rng = np.random.default_rng(3)
    before, after = ROWS[rng.integers(0, 64, 40)], ROWS[rng.integers(0, 64, 40)]
    quick = change(CHAIN, before, after, OMEGA, DURATION, 251)
    scale = DURATION ** -np.arange(14.0)[:, None]
    every = blended(CHAIN, before, after, OMEGA, jets.smoothstep(9, 251, 14) * scale)
    assert np.array_equal(quick.possible, every.possible)
    assert quick.possible.all()
    drive = every.drive[:, :, 0] + 1j * every.drive[:, :, 1]
    assert np.abs(quick.epsilon - drive).max() < 1e-8 * np.abs(drive).max()
    assert np.abs(quick.lam - every.lam).max() < 1e-8
    assert np.abs(quick.lam_slope - every.slope).max() < 1e-6 * np.abs(every.slope).max()


def test_a_way_does_not_depend_on_those_beside_it():
    """Plans that are partly known, from the cache, would otherwise differ in their last digits."""
    rng = np.random.default_rng(5)
    rows = rng.uniform(0.1, 1.0, (30, 6)) * LINKED.full_scale
    before, after = np.concatenate([rows[:15], ROWS[:40]]), np.concatenate([rows[15:], ROWS[24:]])
    together = change(CHAIN, before, after, OMEGA, DURATION, 251)
    for i in (0, 7, 20, 54):
        alone = change(CHAIN, before[[i]], after[[i]], OMEGA, DURATION, 251)
        for name in ("epsilon", "epsilon_slope", "lam", "lam_slope"):
            assert np.array_equal(getattr(alone, name)[0], getattr(together, name)[i])
    family = Vibration(LINKED, 20.0)
    states = family.states(np.concatenate([ROWS[1:20], rows[:5]]) / LINKED.full_scale)
    ways = family.ramps(states[:-1], states[1:])
    beside, own = known(ways[3]), known(family.ramps(states[3:4], states[4:5])[0])
    assert np.array_equal(known(own.epsilon), known(beside.epsilon))
    assert np.array_equal(known(own.lam), known(beside.lam))


def test_what_cannot_be_changed_to_is_told_at_every_node():
    """Too fast for the links: their discriminant passes through 0 between the points."""
    before, after = np.full((1, 6), 1.0), np.full((1, 6), 0.1)
    hasty = 0.05 * LINKED.tau_per_s
    quick = change(CHAIN, before * 0.05, after * 0.05, 1.1, hasty, 4 * POINTS)
    assert not quick.possible.any()


def test_ways_with_the_same_end_share_its_work():
    first, second = np.divmod(np.arange(64 * 64), 64)
    kinds = _kinds(ROWS[first], ROWS[second])
    # Two levels before and two after, so four kinds at the last actuator, and four times as many with each before it.
    assert [len(one.first) for one in kinds] == [4**k for k in range(6, 0, -1)]
    for m, one in enumerate(kinds):
        for rows in (ROWS[first], ROWS[second]):
            assert np.array_equal(rows[one.first][one.kind][:, m:], rows[:, m:])


@pytest.mark.parametrize("beta", [-1.0, 0.5])
def test_the_closed_form_with_its_third_harmonic_needs_no_step(beta, monkeypatch):
    chain = Chain(6, LINKED.delta, beta)
    solved = []

    def counting(*arguments, **options):
        solved.append(solve(*arguments, **options))
        return solved[-1]

    monkeypatch.setattr(refine, "solve", counting)
    amplitude = np.random.default_rng(2).uniform(0.1, 1.0, (500, 6)) * 0.1
    amplitude = amplitude[np.isfinite(links_for(chain, amplitude, OMEGA)).all(axis=1)]
    assert len(amplitude) > 400
    found = refine.refine(chain, amplitude, OMEGA)
    assert len(solved) == 1
    assert found.error.max() < 1e-9
    assert np.abs(np.abs(found.phasor) - amplitude).max() < 1e-9


def test_many_plans_are_asked_for_at_once(tmp_path, monkeypatch):
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path))
    cache = PlanCache(LINKED, 20.0)
    items = [b"%d" % k for k in range(ASKED_AT_ONCE + 10)]
    cache.keep((item, Ramp(t_s=np.arange(float(k)))) for k, item in enumerate(items))
    asked: list[str] = []
    known(cache._file._connection).set_trace_callback(asked.append)
    found = cache.find([*items, b"none"])
    assert len(asked) == 2
    assert found.pop() is None
    assert [len(ramp.t_s) for ramp in found] == list(range(len(items)))
