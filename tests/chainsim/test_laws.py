"""Every coupling law is one system, whichever way it is asked, and every rung solves that system."""

from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import numpy as np
import pytest

from chainsim import Chain, Setting, follow, rest_eigenvalues, solve, sweep
from chainsim.averaging.envelope import EnvelopeError
from chainsim.equations.coupling import CouplingLaw
from chainsim.equations.scaled_chain import ScaledChain

N, SETTINGS, DELTA = 6, 3, 0.12


@dataclass(frozen=True)
class Ladder(CouplingLaw):
    """The example of docs/architecture.md: each oscillator is also fed by the one two before it."""

    name: ClassVar[str] = "ladder"

    @property
    def stride(self):
        return -2

    def second(self, lam, lam_y):
        return np.where(np.arange(lam.shape[-1]) >= 2, lam, 0.0)


LAWS = ["open", "ring", "bidirectional", "grid", "ladder"]
KINDS = ("resistor", "amplifier")
each_law = pytest.mark.parametrize(
    ("law", "kind"), [pair for pair in product(LAWS, KINDS) if pair != ("bidirectional", "amplifier")]
)


def built(law, kind, beta=-1.0):
    closure, rows = (law, 1) if law in ("ring", "bidirectional") else ("open", 2 if law == "grid" else 1)
    chain = Chain.of(N, delta=DELTA, beta=beta, closure=closure, rows=rows, kind=kind)
    if law == "ladder":
        object.__setattr__(chain, "law", Ladder(chain.kind))
    return chain


def chosen(chain, strength=0.02):
    rng = np.random.default_rng(3)
    drive = {"epsilon": rng.uniform(0.5, 1, SETTINGS) * strength, "omega": rng.uniform(1.1, 1.2, SETTINGS)}
    drive["phase"] = 0.4
    if chain.rows == 1:
        return Setting.of(chain, lam=rng.uniform(0.02, 0.08, (SETTINGS, chain.law.count(N))), **drive)
    right, down = (rng.uniform(0.02, 0.08, (SETTINGS, *shape)) for shape in ((2, 2), (1, 3)))
    return Setting.of(chain, lam=right, lam_y=down, **drive)


def stiffness_matrix(chain, setting):
    """K of K z = forces at rest, (N, n, n), written out from the paper's equation for each law."""
    lam, back = setting.lam, chain.law.back
    found = np.zeros((SETTINGS, N, N))
    for m in range(N):
        inputs = [(m - 1, lam[:, m])]
        if chain.closure == "bidirectional" and m + 1 < N:
            inputs.append((m + 1, lam[:, m + 1]))
        if chain.rows > 1 and m >= chain.cols:
            inputs.append((m - chain.cols, setting.lam_y[:, m]))
        if isinstance(chain.law, Ladder) and m >= 2:
            inputs.append((m - 2, lam[:, m]))
        found[:, m, m] += 1
        for source, link in inputs:
            found[:, m, source % N] -= link
            found[:, m, m] += back * link
    return found


@each_law
def test_a_law_is_the_same_system_whichever_way_it_is_asked(law, kind):
    chain = built(law, kind)
    setting = chosen(chain)
    wanted, scaled = stiffness_matrix(chain, setting), ScaledChain.of(chain, setting)
    own = np.eye(N)
    assert np.allclose(chain.law.matrix(setting.lam, setting.lam_y) + own, wanted, atol=1e-15)

    def system(links):
        found = scaled.k.T[:, :, None] * own
        for fed, source, link in links:
            found[:, fed, source] -= link.T
        return found

    each = np.arange(N)
    inputs = [(np.array([m]), np.array([source]), link[None]) for m in each for source, link in scaled.inputs(int(m))]
    first, second = chain.law.sources(N)
    other = np.zeros_like(scaled.lam) if scaled.other is None else scaled.other
    assert np.allclose(system(scaled.links()), wanted, atol=1e-15)
    assert np.allclose(system(inputs), wanted, atol=1e-15)
    assert np.allclose(system([(each, first, scaled.lam), (each, second, other)]), wanted, atol=1e-15)
    z, push = np.random.default_rng(1).normal(size=(SETTINGS, N)), np.zeros((SETTINGS, N))
    if chain.rows == 1:
        chain.law.pull(push, z, setting.lam)
        assert np.allclose(push, z - np.einsum("kmj,kj->km", wanted, z), atol=1e-15)


@each_law
def test_an_order_of_solution_respects_who_feeds_whom(law, kind):
    chain = built(law, kind)
    scaled = ScaledChain.of(chain, chosen(chain))
    place = chain.law.places(N)
    assert sorted(place) == list(range(N))
    if scaled.joint:
        assert max(np.abs(place[fed] - place[source]).max() for fed, source, _ in scaled.links()) <= 2
        scaled = scaled.forward()
    assert sorted(np.concatenate(scaled.layers)) == list(range(N))
    seen: list[int] = []
    for layer in scaled.layers:
        for links, source in scaled.feeds(layer):
            assert set(source[(source >= 0) & (links != 0).any(axis=1)]) <= set(seen)
        seen += list(layer)


@each_law
def test_the_linear_rung_solves_the_system(law, kind):
    chain = built(law, kind, beta=0.0)
    setting = chosen(chain)
    omega = setting.omega[:, None, None]
    impedance = stiffness_matrix(chain, setting) + np.eye(N) * (1j * DELTA * omega - omega**2)
    force = np.zeros((SETTINGS, N), dtype=complex)
    force[:, 0] = setting.epsilon * np.exp(0.4j)
    wanted = np.linalg.solve(impedance, force[..., None])[..., 0]
    for rung in ("linear", "harmonic_balance", "ode"):
        found = solve(chain, setting, tol=1e-9, rung=rung)
        assert (np.abs(found.phasor - wanted) <= 1e-8 * np.abs(wanted).max(axis=1, keepdims=True)).all()


@each_law
def test_eigenvalues_at_rest_are_those_of_the_system(law, kind):
    chain = built(law, kind)
    setting = chosen(chain)
    stiffness = stiffness_matrix(chain, setting)
    zero, one = np.zeros_like(stiffness), np.broadcast_to(np.eye(N), stiffness.shape)
    matrix = np.block([[zero, one], [-stiffness, -DELTA * one]])
    # Coefficients of the characteristic polynomial: the eigenvalues of a defective matrix are known to few digits.
    for values, system in zip(rest_eigenvalues(chain, setting), matrix, strict=True):
        assert np.allclose(np.poly(values), np.poly(system), atol=1e-9)


def test_eigenvalues_at_rest_know_how_oscillators_differ():
    chain = Chain.of(3, delta=[0.1, 0.2, 0.3], beta=-1.0, stiffness=[1.0, 1.2, 0.9])
    found = rest_eigenvalues(chain, Setting.of(chain, epsilon=0.0, lam=[0.3, 0.4], omega=2.0))[0]
    wanted = np.concatenate([np.roots([1, delta, k]) for delta, k in ((0.1, 1.0), (0.2, 1.5), (0.3, 1.3))])
    assert np.allclose(np.sort_complex(found), np.sort_complex(wanted), atol=1e-12)


def test_an_open_end_takes_no_link_under_any_law():
    for law in LAWS:
        chain = built(law, "resistor")
        links = np.full((2, N), 0.05)
        if chain.law.closed:
            follow(chain, chosen(chain), [0.0, 1.0], tol=1e-3, lam=links)
            continue
        with pytest.raises(EnvelopeError, match="the first oscillator of an open chain has no link"):
            follow(chain, chosen(chain), [0.0, 1.0], tol=1e-3, lam=links)


@each_law
def test_rungs_agree_on_every_law(law, kind):
    chain = built(law, kind)
    setting = chosen(chain)
    exact = solve(chain, setting, tol=1e-9, rung="ode")
    size = np.abs(exact.phasor).max(axis=1, keepdims=True)
    assert set(exact.outcome) == {"ok"}
    for rung, within in (("one_harmonic", 1e-4), ("harmonic_balance", 1e-7), ("envelope", 1e-4), ("auto", 1e-7)):
        found = solve(chain, setting, tol=1e-3 if rung == "envelope" else 1e-8, rung=rung)
        assert (np.abs(found.phasor - exact.phasor) <= within * size).all(), rung
    swept = sweep(chain, setting, tol=1e-8, from_rest=False)
    assert (np.abs(swept.phasor - exact.phasor) <= 1e-7 * size).all()
    ours, theirs = (np.sort(np.abs(each.multipliers.reshape(SETTINGS, -1))) for each in (swept, exact))
    assert np.allclose(ours, theirs, atol=1e-5)


def test_what_a_law_cannot_do_is_refused_in_one_sentence():
    with pytest.raises(ValueError, match="a grid is open, got ring"):
        Chain.of(6, delta=0.1, beta=0.0, rows=2, closure="ring")
    with pytest.raises(ValueError, match="an amplifier acts one way"):
        Chain.of(3, delta=0.1, beta=0.0, closure="bidirectional", kind="amplifier")
