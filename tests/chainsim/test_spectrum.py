"""The spectrum at rest: thresholds in closed form against eigenvalues, and the paper's one number."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from chainsim import Chain, Closure, Setting
from chainsim.continuation.spectrum import (
    SpectrumError,
    critical_lam,
    delta_from_critical_lam,
    gain_per_stage,
    peak_gain,
    rest_eigenvalues,
    spectrum_curve,
)

DELTA = 5.3006e-3


def growth(n, delta, lam):
    chain = Chain(n, delta, -1.0, Closure.RING)
    return rest_eigenvalues(chain, Setting.of(chain, epsilon=0, lam=lam, omega=1))[:, 0].real


def test_the_papers_critical_value():
    assert critical_lam(DELTA, 6) == pytest.approx(6.13e-3, abs=5e-7)
    assert delta_from_critical_lam(6.13e-3, 6) == pytest.approx(DELTA, abs=5e-8)


@given(st.integers(3, 24), st.floats(1e-4, 0.5))
def test_a_ring_starts_to_grow_at_its_critical_lam(n, delta):
    critical = critical_lam(delta, n)
    below, above = growth(n, delta, np.array([[critical * (1 - 1e-4)], [critical * (1 + 1e-4)]]))
    assert below < 0 < above


@given(st.floats(1e-5, 2.0))
def test_the_continuous_spectrum_is_the_limit_of_large_rings(delta):
    limit = critical_lam(delta)
    rings = [critical_lam(delta, n) for n in (6, 60, 600)]
    assert all(limit <= ring * (1 + 1e-12) for ring in rings)
    assert rings[-1] == pytest.approx(limit, rel=1e-4)


@given(st.floats(1e-4, 0.5), st.floats(0.5, 2.0))
def test_gain_per_stage_passes_one_where_the_curve_crosses(delta, ratio):
    lam = ratio * critical_lam(delta)
    curve = spectrum_curve(delta, lam, np.linspace(0, 2 * np.pi, 20001)).real.max()
    if abs(ratio - 1) > 1e-3:
        assert (peak_gain(delta, lam) > 1) == (ratio > 1)
        # The wave phi = 0 is damped like a free oscillator; only the others can cross.
        assert (curve > 0) == (ratio > 1)


@given(st.integers(3, 12), st.floats(1e-3, 0.3), st.floats(1e-3, 1.0))
def test_a_uniform_ring_lies_on_the_curve(n, delta, lam):
    chain = Chain(n, delta, -1.0, Closure.RING)
    found = rest_eigenvalues(chain, Setting.of(chain, epsilon=0, lam=lam, omega=1))[0]
    wanted = spectrum_curve(delta, lam, 2 * np.pi * np.arange(n) / n).ravel()
    apart = np.abs(found[:, None] - wanted).min(axis=1)
    assert apart.max() < 1e-9
    assert np.abs(found[:, None] - wanted).min(axis=0).max() < 1e-9


def test_an_open_chain_rests_whatever_its_links():
    chain = Chain(3, 0.1, -1.0)
    found = rest_eigenvalues(chain, Setting.of(chain, epsilon=1, lam=np.array([[0.0, 3.0], [50.0, 9.0]]), omega=1))
    assert found.real == pytest.approx(-0.05)
    assert np.abs(found[0].imag).max() == pytest.approx(math.sqrt(4 - 0.0025))


def test_gain_at_resonance_of_the_link():
    assert gain_per_stage(0.1, 0.5, math.sqrt(1.5)) == pytest.approx(0.5 / (0.1 * math.sqrt(1.5)))


def test_small_rings_never_start():
    assert critical_lam(0.1, 1) == critical_lam(0.1, 2) == math.inf


@pytest.mark.parametrize(
    "call", [lambda: critical_lam(-1.0), lambda: critical_lam(math.nan, 6), lambda: critical_lam(0.1, 0),
             lambda: delta_from_critical_lam(0.0, 6), lambda: delta_from_critical_lam(0.1, 2)],
)  # fmt: skip
def test_bad_input_is_named(call):
    with pytest.raises(SpectrumError, match="expected"):
        call()
