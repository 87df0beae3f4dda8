"""The grid under sampled forces: against exact answers, other integrators, and itself cut into blocks."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp
from scipy.signal import lsim

from chainsim.time_domain.integrate import Escape, GridError, GridIntegrator


def grid(shape=(1, 3), chain_length=3, *, delta=0.02, beta=-1.0, ring=False, dtau=0.2):
    return GridIntegrator(shape=shape, chain_length=chain_length, delta=delta, beta=beta, ring=ring, dtau=dtau)


def smooth(samples, shape, *, seed=0, size=0.05):
    """Forces and links that vary in every sample."""
    rng = np.random.default_rng(seed)
    k = np.arange(samples)[:, None, None]
    force = size * rng.uniform(0.2, 1, shape) * np.cos(0.2 * k + rng.uniform(0, 6, shape))
    lam = 0.2 + 0.1 * np.sin(0.03 * k + rng.uniform(0, 6, shape))
    return force, lam


def by_dop853(force, lam, *, delta, beta, ring, dtau, own=1.0):
    """z at the samples of one chain, shape (S, n), an interval at a time."""
    n = force.shape[1]
    lam = lam.copy()
    if not ring:
        lam[:, 0] = 0.0
    y, found = np.zeros(2 * n), [np.zeros(n)]

    for k in range(len(force) - 1):

        def slope(tau, y, k=k):
            part = tau / dtau
            drive = (1 - part) * force[k] + part * force[k + 1]
            links = (1 - part) * lam[k] + part * lam[k + 1]
            z, v = y[:n], y[n:]
            return np.concatenate([v, drive - delta * v - own * z - beta * z**3 + links * (np.roll(z, 1) - z)])

        y = solve_ivp(slope, (0, dtau), y, method="DOP853", rtol=1e-12, atol=1e-16).y[:, -1]
        found.append(y[:n])
    return np.array(found)


@pytest.mark.parametrize("ring", [False, True])
@pytest.mark.parametrize("beta", [-1.0, 1.0])
def test_agrees_with_dop853(ring, beta):
    force, lam = smooth(250, (1, 3), size=0.02)
    z = grid(ring=ring, beta=beta).advance(force, lam)[:, 0]
    wanted = by_dop853(force[:, 0], lam[:, 0], delta=0.02, beta=beta, ring=ring, dtau=0.2)
    assert np.max(np.abs(wanted)) > 0.05
    assert np.max(np.abs(z - wanted)) < 1e-7 * np.max(np.abs(wanted))


@pytest.mark.parametrize("ring", [False, True])
def test_linear_grid_is_the_exact_convolution(ring):
    samples, dtau, delta = 20_000, 0.35, 0.06 if ring else 5e-3
    rng = np.random.default_rng(1)
    force, lam = rng.normal(size=(samples, 1, 3)), np.array([[0.05, 0.04, 0.03] if ring else [0.0, 0.3, 0.2]])
    z = grid(beta=0.0, delta=delta, ring=ring, dtau=dtau).advance(force, lam)[:, 0]
    links = np.diag(lam[0]) @ (np.roll(np.eye(3), -1, axis=1) - np.eye(3))
    if not ring:
        links[0] = 0.0
    matrix = np.block([[np.zeros((3, 3)), np.eye(3)], [links - np.eye(3), -delta * np.eye(3)]])
    inputs = np.vstack([np.zeros((3, 3)), np.eye(3)])
    outputs = np.hstack([np.eye(3), np.zeros((3, 3))])
    _, wanted, _ = lsim((matrix, inputs, outputs, np.zeros((3, 3))), force[:, 0], dtau * np.arange(samples))
    assert np.max(np.abs(z - wanted)) < 1e-6 * np.max(np.abs(wanted))


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(1, 60), min_size=1, max_size=8), st.booleans())
def test_blocks_do_not_matter(lengths, ring):
    force, lam = smooth(sum(lengths), (5, 8))
    whole = grid((5, 8), 2, ring=ring).advance(force, lam)
    parts, pieces = grid((5, 8), 2, ring=ring), np.cumsum(lengths)[:-1]
    cut = [parts.advance(f, x) for f, x in zip(np.split(force, pieces), np.split(lam, pieces), strict=True)]
    np.testing.assert_array_equal(np.concatenate(cut), whole)


@pytest.mark.parametrize("ring", [False, True])
def test_unequal_actuators_agree_with_dop853(ring):
    force, lam = smooth(200, (2, 6), size=0.02)
    rng = np.random.default_rng(6)
    delta, beta, own = (rng.uniform(low, high, (2, 6)) for low, high in ((0.01, 0.05), (-1.5, 1), (0.9, 1.2)))
    here = GridIntegrator(shape=(2, 6), chain_length=3, delta=delta, beta=beta, stiffness=own, ring=ring, dtau=0.2)
    z = here.advance(force, lam)
    for row, first in ((0, 0), (1, 3)):
        at = (row, slice(first, first + 3))
        wanted = by_dop853(force[:, *at], lam[:, *at], delta=delta[at], beta=beta[at], ring=ring, dtau=0.2, own=own[at])
        assert np.max(np.abs(z[:, *at] - wanted)) < 1e-7 * np.max(np.abs(wanted))


WIRED: dict[str, dict[str, Any]] = {
    "both ways": {"both_ways": True},
    "amplifier": {"kind": "amplifier"},
    "amplifier ring": {"kind": "amplifier", "ring": True},
    "down": {"down": True},
    "down, amplifier": {"down": True, "kind": "amplifier"},
}


def wired(shape, chain_length, *, ring=False, **rest):
    return GridIntegrator(shape=shape, chain_length=chain_length, beta=-1.0, ring=ring, dtau=0.2, **rest)


def pulled(z, lam, lam_y, *, ring=False, both_ways=False, down=False, kind="resistor"):
    """What the links do to a grid (rows, cols) of chains as long as its rows, an actuator at a time."""
    rows, cols = z.shape
    back, force = float(kind == "resistor"), np.zeros(z.shape)
    for r in range(rows):
        for c in range(cols):
            if c or ring:
                force[r, c] += lam[r, c] * (z[r, c - 1] - back * z[r, c])
            if both_ways and c + 1 < cols:
                force[r, c] += lam[r, c + 1] * (z[r, c + 1] - z[r, c])
            if down and r:
                force[r, c] += lam_y[r, c] * (z[r - 1, c] - back * z[r, c])
    return force


@pytest.mark.parametrize("name", WIRED)
def test_every_wiring_agrees_with_dop853(name):
    how, shape = WIRED[name], (2, 3)
    force, lam = smooth(150, shape, size=0.02)
    _, lam_y = smooth(150, shape, seed=1)
    rng = np.random.default_rng(3)
    delta, own = rng.uniform(0.02, 0.05, shape), rng.uniform(0.9, 1.2, shape)
    here = wired(shape, 3, delta=delta, stiffness=own, **how)
    z = here.advance(force, lam, lam_y) if how.get("down") else here.advance(force, lam)
    y, wanted = np.zeros(12), [np.zeros(shape)]
    for k in range(149):

        def slope(tau, y, k=k):
            part = tau / 0.2
            now = [(1 - part) * each[k] + part * each[k + 1] for each in (force, lam, lam_y)]
            q, v = y[:6].reshape(shape), y[6:].reshape(shape)
            push = now[0] + pulled(q, now[1], now[2], **how)
            return np.concatenate([v.ravel(), (push - delta * v - own * q + q**3).ravel()])

        y = solve_ivp(slope, (0, 0.2), y, method="DOP853", rtol=1e-11, atol=1e-15).y[:, -1]
        wanted.append(y[:6].reshape(shape))
    assert np.abs(wanted).max() > 0.05
    assert np.abs(z - wanted).max() < 1e-7 * np.abs(wanted).max()


@pytest.mark.parametrize("name", WIRED)
def test_blocks_do_not_matter_in_any_wiring(name):
    how, (force, lam), cut = WIRED[name], smooth(60, (3, 40)), [7, 8, 31]
    downs = (lam[:, ::-1],) if how.get("down") else ()
    whole, parts = (wired((3, 40), 4, delta=0.02, **how) for _ in range(2))
    pieces = zip(*(np.split(each, cut) for each in (force, lam, *downs)), strict=True)
    np.testing.assert_array_equal(
        np.concatenate([parts.advance(*one) for one in pieces]), whole.advance(force, lam, *downs)
    )


def test_a_grid_without_links_downwards_is_its_rows():
    force, lam = smooth(200, (4, 6), size=0.01)
    rows = grid((4, 6), 3).advance(force, lam)
    whole = wired((4, 6), 3, delta=0.02, down=True)
    np.testing.assert_allclose(whole.advance(force, lam, np.zeros((4, 6))), rows, rtol=0, atol=1e-12)


def test_links_downwards_are_links_along_in_a_turned_grid():
    force, lam = smooth(200, (3, 4), size=0.01)
    along, down = wired((3, 4), 4, delta=0.02, down=True), wired((4, 3), 3, delta=0.02, down=True)
    other = lam[:, ::-1]
    first = along.advance(force, lam, other)
    second = down.advance(force.swapaxes(1, 2), other.swapaxes(1, 2), lam.swapaxes(1, 2))
    np.testing.assert_allclose(second.swapaxes(1, 2), first, rtol=0, atol=1e-13)


def test_escape_in_a_grid_with_links_downwards():
    force = np.zeros((400, 2, 6))
    force[:, 1, 4] = 0.8
    here = wired((2, 6), 3, delta=0.02, down=True)
    z = here.advance(force, np.full((2, 6), 0.1), np.full((2, 6), 0.1))
    assert (here.escaped.row, here.escaped.col) == (1, 4)
    assert np.isfinite(z).all()
    assert not z[:, :, :3].any()


@pytest.mark.parametrize(
    ("how", "complaint"),
    [
        ({"ring": True, "down": True}, "down: a 2-D grid is open"),
        ({"ring": True, "both_ways": True}, "both_ways: an open chain"),
        ({"kind": "amplifier", "both_ways": True}, "both_ways: an open chain"),
    ],
)
def test_wirings_that_are_not(how, complaint):
    with pytest.raises(GridError, match=complaint):
        wired((2, 3), 3, delta=0.02, **how)
    with pytest.raises(GridError, match="lam_y: missing"):
        wired((2, 3), 3, delta=0.02, down=True).advance(np.zeros((2, 2, 3)), np.zeros((2, 3)))
    with pytest.raises(GridError, match="no links downwards"):
        grid().advance(np.zeros((2, 1, 3)), np.zeros((1, 3)), np.zeros((1, 3)))


def test_equal_actuators_may_be_given_one_by_one():
    force, lam = smooth(200, (2, 6))
    plain = grid((2, 6), 3).advance(force, lam)
    alike: dict[str, Any] = {
        "delta": np.full((2, 6), 0.02),
        "beta": np.full((2, 6), -1.0),
        "stiffness": np.ones((2, 6)),
    }
    each = GridIntegrator(shape=(2, 6), chain_length=3, ring=False, dtau=0.2, **alike)
    np.testing.assert_array_equal(each.advance(force, lam), plain)
    alike["stiffness"][1, 5] += 1e-12
    each = GridIntegrator(shape=(2, 6), chain_length=3, ring=False, dtau=0.2, **alike)
    np.testing.assert_allclose(each.advance(force, lam), plain, atol=1e-11)


def test_constant_links_are_links_that_stay():
    force, lam = smooth(300, (2, 6))
    short = grid((2, 6), 6).advance(force, lam[0])
    np.testing.assert_array_equal(short, grid((2, 6), 6).advance(force, np.broadcast_to(lam[0], force.shape)))


def test_equal_chains_move_alike_wherever_they_stand():
    force, lam = smooth(200, (1, 3))
    alone = grid().advance(force, lam)
    many = grid((19, 6), 3).advance(np.tile(force, (1, 19, 2)), np.tile(lam, (1, 19, 2)))
    np.testing.assert_array_equal(many, np.tile(alone, (1, 19, 2)))


def test_the_first_link_matters_in_a_ring_only():
    force, lam = smooth(200, (1, 3))
    changed = lam.copy()
    changed[..., 0] = 0.0
    np.testing.assert_array_equal(grid().advance(force, lam), grid().advance(force, changed))
    ring, opened = grid(ring=True).advance(force, lam), grid(ring=True).advance(force, changed)
    assert np.max(np.abs(ring - opened)) > 1e-3
    np.testing.assert_array_equal(opened, grid().advance(force, lam))


def test_the_first_sample_is_rest():
    force, lam = np.full((1, 1, 3), 0.3), np.full((1, 3), 0.1)
    here = grid()
    assert not here.advance(force, lam).any()
    later = here.advance(force, lam)[0, 0]
    # Under a constant force z = F tau^2/2 to leading order.
    assert later == pytest.approx(np.full(3, 0.3 * 0.2**2 / 2), rel=0.02)


@pytest.mark.parametrize("dtau", [0.05, 0.1046, 0.35])
def test_thousands_of_periods_at_a_resonance_of_every_stage(dtau):
    # omega^2 = 1 + lam: each stage resonates with what drives it, the hardest case for a frequency error.
    samples, omega, delta, lam = int(9000 / dtau), np.sqrt(1.5), 5.3006e-3, 0.5
    force = np.zeros((samples, 1, 3))
    force[:, 0, 0] = 1e-3 * np.cos(omega * dtau * np.arange(samples))
    z = grid(beta=0.0, delta=delta, dtau=dtau).advance(force, np.full((1, 3), lam))[:, 0]
    own = 1 - omega**2 + 1j * delta * omega
    # What a linear interpolation of a cosine keeps of it, as a force on a smooth response.
    kept = np.sinc(omega * dtau / (2 * np.pi)) ** 2
    phasor = kept * 1e-3 / own * (lam / (own + lam)) ** np.arange(3)
    at = np.arange(samples)[-2000:]
    wanted = (phasor * np.exp(1j * omega * dtau * at)[:, None]).real
    assert np.max(np.abs(z[-2000:] - wanted) / np.abs(phasor), axis=0)[1:] == pytest.approx([0, 0], abs=2e-6)


def test_error_falls_with_the_fourth_power_of_the_step():
    def middle(dtau):
        samples = round(60 / dtau) + 1
        ramp = np.linspace(0, 0.5, samples)[:, None, None] * np.ones((1, 1, 3))
        return grid(beta=1.0, dtau=dtau).advance(ramp, np.full((1, 3), 0.5))[-1, 0]

    fine = middle(0.05 / 8)
    errors = [np.max(np.abs(middle(dtau) - fine)) for dtau in (0.05, 0.025)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.4)


def test_escape_is_named_and_freezes_its_chain_only():
    force, lam = np.zeros((400, 2, 3)), np.full((2, 3), 0.1)
    force[:, 0], force[:, 1, 0] = 1e-3, 0.8
    together = grid((2, 3), 3)
    z = np.concatenate([together.advance(part, lam) for part in np.split(force, 4)])
    escape = together.escaped
    assert isinstance(escape, Escape)
    assert (escape.row, escape.col) == (1, 0)
    assert np.isfinite(z).all()
    assert np.max(np.abs(z)) <= 50
    assert (z[escape.sample :, 1] == z[escape.sample - 1, 1]).all()
    assert np.abs(z[escape.sample - 1, 1, 0]) > 1
    calm = grid((2, 3), 3)
    force[:, 1] = 0.0
    np.testing.assert_array_equal(calm.advance(force, lam)[:, 0], z[:, 0])
    assert calm.escaped is None


def test_bad_input_is_refused_by_name():
    force, lam = np.zeros((4, 1, 3)), np.zeros((1, 3))
    with pytest.raises(GridError, match="chain_length"):
        grid((1, 3), 2)
    with pytest.raises(GridError, match="dtau"):
        grid(dtau=0.0)
    with pytest.raises(GridError, match="beta"):
        grid(beta=np.nan)
    with pytest.raises(GridError, match=r"delta: .* numbers that fit the shape \(1, 3\), got \(2,\)"):
        grid(delta=np.full(2, 0.1))
    with pytest.raises(GridError, match="delta: expected numbers >= 0, got -1"):
        grid(delta=-1.0)
    with pytest.raises(GridError, match=r"force: expected shape \(4, 1, 3\)"):
        grid().advance(force[:, :, :2], lam)
    with pytest.raises(GridError, match=r"lam: expected shape"):
        grid().advance(force, lam[:, :2])
    force[2] = np.inf
    with pytest.raises(GridError, match="force: expected finite"):
        grid().advance(force, lam)
    assert grid().advance(np.zeros((0, 1, 3)), lam).shape == (0, 1, 3)
