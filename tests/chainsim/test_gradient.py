"""Derivatives of the phasors against finite differences of the solved chain."""

import numpy as np
import pytest

from chainsim import Chain, Closure, RungError, Setting, gradient, solve

LINKS = np.array([0.3, 0.31, 0.2, 0.6, 0.3])
STEP = 1e-6


def solved(rung, beta, epsilon=0.02, lam=LINKS, omega=1.22, **more):
    chain = Chain(6, 5.3006e-3, beta)
    setting = Setting.of(chain, epsilon=epsilon, lam=lam, omega=omega, **more)
    return chain, setting, solve(chain, setting, tol=1e-11, rung=rung)


@pytest.mark.parametrize("rung", ["one_harmonic", "harmonic_balance"])
@pytest.mark.parametrize("beta", [-1.0, 1.0, -25.0])
@pytest.mark.parametrize("more", [{}, {"phase": 0.7}, {"preload": 0.02, "bias": 0.01}])
def test_against_central_differences(rung, beta, more):
    found = gradient(*solved(rung, beta, **more))

    def phasor(**changed):
        return solved(rung, beta, **changed, **more)[2].phasor[0]

    def close(derivative, wanted):
        assert np.abs(derivative - wanted).max() <= 1e-6 * np.abs(wanted).max()

    close(found.epsilon[0], (phasor(epsilon=0.02 + STEP) - phasor(epsilon=0.02 - STEP)) / (2 * STEP))
    close(found.omega[0], (phasor(omega=1.22 + STEP) - phasor(omega=1.22 - STEP)) / (2 * STEP))
    for link in range(5):
        by = STEP * np.eye(5)[link]
        close(found.lam[0, :, link], (phasor(lam=LINKS + by) - phasor(lam=LINKS - by)) / (2 * STEP))
        assert (found.lam[0, : link + 1, link] == 0).all()


def test_linear_gradient_is_exact():
    chain, setting, response = solved("linear", -1.0)
    found = gradient(chain, setting, response)
    assert found.epsilon == pytest.approx(response.phasor / 0.02, rel=1e-10)
    impedance = 1 + LINKS - 1.22**2 + 1j * chain.delta * 1.22
    for link in range(5):
        wanted = response.phasor[0, link + 1 :] * (1 / LINKS[link] - 1 / impedance[link])
        assert found.lam[0, link + 1 :, link] == pytest.approx(wanted, rel=1e-9)


def test_batch_shapes_and_unanswered_settings():
    chain = Chain(3, 0.01, -1.0)
    setting = Setting.of(chain, epsilon=[1e-3, 1e150], lam=0.1, omega=1.3)
    response = solve(chain, setting, tol=1e-9, rung="harmonic_balance")
    found = gradient(chain, setting, response)
    assert found.epsilon.shape == found.omega.shape == (2, 3)
    assert found.lam.shape == (2, 3, 2)
    assert np.isfinite(found.epsilon[0]).all()
    if not response.locked[1]:
        assert np.isnan(found.epsilon[1]).all()


def test_rings_are_refused():
    chain = Chain(3, 0.05, 0.0, Closure.RING)
    setting = Setting.of(chain, epsilon=1e-3, lam=0.01, omega=1.0)
    with pytest.raises(RungError, match="open chains only"):
        gradient(chain, setting, solve(chain, setting, tol=1e-6))
