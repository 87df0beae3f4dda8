"""A grid with hysteresis and creep under samples, against the plain grid, the chain with terms, and closed forms."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from chainsim import Chain, Creep, GridIntegrator, Play, SampledGrid, Setting, Terms, integrate_terms
from chainsim.effects.effects import TermsError

DTAU = 2 * np.pi * 133.13 / 24000
PLAY, CREEP = Play((1e-4, 4e-4), (0.1, 0.2), 0.7), Creep(0.05, 1.0, 1e3)


def grid(shape: tuple[int, int] = (2, 6), **changes: Any) -> SampledGrid:
    given: dict[str, Any] = {"chain_length": 3, "beta": -1.0, "ring": False, "dtau": DTAU, "stiffest": 1.5}
    return SampledGrid(shape=shape, **{"hysteresis": None, "creep": None} | given | changes)


def swinging(samples: int, omega: float = 1.0) -> np.ndarray:
    """The drive of each chain's first actuator, raised slowly, and a bias on another."""
    tau = np.arange(samples) * DTAU
    force = np.zeros((samples, 2, 6))
    force[:, :, ::3] = (2e-4 * np.minimum(1, tau / 50) * np.cos(omega * tau))[:, None, None]
    force[:, 1, 4] = 1e-3 * np.minimum(1, tau / 20)
    return force


def unequal() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    return 1 + 0.02 * rng.normal(size=(2, 6)), 5e-3 * (1 + 0.1 * rng.normal(size=(2, 6)))


@pytest.mark.parametrize("ring", [False, True])
def test_without_terms_it_is_the_grid_of_the_integrator(ring: bool) -> None:
    stiffness, delta = unequal()
    force = swinging(12_000)
    lam = np.full((len(force), 2, 6), 0.004) * (1 + 0.3 * np.sin(np.arange(len(force)) * DTAU / 30))[:, None, None]
    plain = GridIntegrator(
        shape=(2, 6), chain_length=3, delta=delta, beta=-1.0, stiffness=stiffness, ring=ring, dtau=DTAU
    )
    wanted = plain.advance(force, lam)
    found = grid(ring=ring).advance(force, lam, stiffness=stiffness, delta=delta)
    assert np.abs(wanted).max() > 0.005
    np.testing.assert_allclose(found, wanted, atol=2e-5 * np.abs(wanted).max())


def test_terms_are_those_of_the_chain_with_terms() -> None:
    chain, dtau, samples = Chain(3, 0.05, -1.0), 0.01, 20_000
    setting = Setting.of(chain, epsilon=2e-3, lam=0.04, omega=1.1, phase=-np.pi / 2)
    terms = Terms(hysteresis=PLAY, creep=CREEP)
    wanted = integrate_terms(chain, setting, terms, duration=samples * dtau, step=dtau, every=1).tip
    force = np.zeros((samples + 1, 1, 3))
    force[:, 0, 0] = 2e-3 * np.sin(1.1 * dtau * np.arange(samples + 1))
    sampled = grid((1, 3), hysteresis=PLAY, creep=CREEP, dtau=dtau)
    found = sampled.advance(
        force, np.full_like(force, 0.04), stiffness=np.ones((1, 3)), delta=np.full((1, 3), 0.05)
    )  # fmt: skip
    np.testing.assert_allclose(found[1:, 0], wanted, atol=1e-4 * np.abs(wanted).max())
    plain = integrate_terms(chain, setting, Terms(), duration=samples * dtau, step=dtau, every=1).tip
    assert np.abs(plain - wanted).max() > 0.05 * np.abs(wanted).max()


def test_blocks_do_not_matter() -> None:
    stiffness, delta = unequal()
    force, lam = swinging(900), np.full((900, 2, 6), 0.01)
    one, other = (grid(hysteresis=PLAY, creep=CREEP) for _ in range(2))
    wanted = one.advance(force, lam, stiffness=stiffness, delta=delta)
    cuts = [0, 1, 2, 100, 100, 777, 900]
    parts = [other.advance(force[a:b], lam[a:b], stiffness=stiffness, delta=delta) for a, b in pairwise(cuts)]
    np.testing.assert_array_equal(np.concatenate(parts), wanted)


def test_stiffness_and_damping_may_change_on_the_way() -> None:
    still = grid((1, 2), chain_length=1, beta=0.0, stiffest=4.0)
    force = np.full((3000, 1, 2), 0.01)
    for stiffness in ([1.0, 2.0], [4.0, 2.0]):
        z = still.advance(
            force, np.zeros_like(force), stiffness=np.array([stiffness]), delta=np.array([[0.9, 0.6]])
        )  # fmt: skip
        np.testing.assert_allclose(z[-1, 0], 0.01 / np.array(stiffness), rtol=1e-9)


def test_an_actuator_that_leaves_its_well_falls_back_and_the_others_move_on() -> None:
    stiffness, delta = np.ones((2, 6)), np.full((2, 6), 0.01)
    force = swinging(4000)
    alone = grid().advance(force, np.zeros_like(force), stiffness=stiffness, delta=delta)
    force[1000:1400, 0, 3] = 5.0
    found = grid().advance(force, np.zeros_like(force), stiffness=stiffness, delta=delta)
    assert np.isfinite(found).all()
    assert np.abs(found[:, 0, 3]).max() > 1
    assert np.abs(found[-1, 0, 3]) < 1
    found[:, 0, 3] = alone[:, 0, 3]
    np.testing.assert_array_equal(found, alone)


def test_a_creep_too_fast_for_the_samples_is_refused() -> None:
    with pytest.raises(
        TermsError, match=r"creep\.first: expected at least 0\.0349, the step of the samples, got 0\.01"
    ):
        grid(creep=Creep(0.1, 0.01, 1.0))
