"""Rings, two-way chains, grids, amplifiers and unequal oscillators, each against DOP853 of the equations as written."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from chainsim import (
    Chain,
    Closure,
    CouplingKind,
    Outcome,
    RungError,
    Setting,
    Start,
    load_rung,
    solve,
    steady_from_rest,
)

DELTAS, BETAS = [0.10, 0.14, 0.08, 0.12, 0.11, 0.09], [-1.0, -0.5, 0.0, 0.8, -1.5, -1.0]
OWN = [1, 1.02, 0.97, 1.1, 1, 0.9]
SYSTEMS: dict[str, dict[str, Any]] = {
    "open": {},
    "ring": {"closure": "ring"},
    "bidirectional": {"closure": "bidirectional"},
    "amplifier": {"kind": "amplifier"},
    "amplifier ring": {"kind": "amplifier", "closure": "ring"},
    "unequal": {"delta": DELTAS, "beta": BETAS, "stiffness": OWN},
    "unequal ring": {"delta": DELTAS, "beta": BETAS, "stiffness": OWN, "closure": "ring"},
    "unequal two-way": {"delta": DELTAS, "beta": BETAS, "stiffness": OWN, "closure": "bidirectional"},
    "grid": {"rows": 2},
    "tall grid": {"rows": 6},
    "unequal grid": {"rows": 3, "delta": DELTAS, "beta": BETAS, "stiffness": OWN},
    "amplifier grid": {"rows": 2, "kind": "amplifier"},
}
OMEGA, EPSILON = 1.08, 0.03
each_system = pytest.mark.parametrize("name", list(SYSTEMS))


def built(name, **more):
    given: dict[str, Any] = {"delta": 0.1, "beta": -1.0, **SYSTEMS[name]}
    chain = Chain.of(6, **given)
    rng = np.random.default_rng(5)
    count = (chain.rows, chain.cols - 1) if chain.rows > 1 else 5 + (chain.closure == "ring")
    links = {"lam": rng.uniform(0.04, 0.08, count)}
    if chain.rows > 1:
        links["lam_y"] = rng.uniform(0.04, 0.08, (chain.rows - 1, chain.cols))
    return chain, Setting.of(chain, **{"epsilon": EPSILON, "omega": OMEGA, "phase": 0.4, **links, **more})


def slope_of(name, chain, setting):
    """The equations of motion, a link at a time, straight from their definition."""
    given: dict[str, Any] = {"delta": 0.1, "beta": -1.0, "stiffness": 1.0, **SYSTEMS[name]}
    delta, beta, own = (np.broadcast_to(np.array(given[key], float), 6) for key in ("delta", "beta", "stiffness"))
    back = given.get("kind") != "amplifier"
    links = []
    for m in range(6):
        if chain.rows > 1:
            row, col = divmod(m, chain.cols)
            links += [(m, m - 1, setting.lam[0, m])] if col else []
            links += [(m, m - chain.cols, setting.lam_y[0, m])] if row else []
        elif m or chain.closure is Closure.RING:
            links.append((m, (m - 1) % 6, setting.lam[0, m]))
            if chain.closure is Closure.BIDIRECTIONAL:
                links.append((m - 1, m, setting.lam[0, m]))

    def slope(tau, y):
        z, v = y[:6], y[6:12]
        a = -delta * v - own * z - beta * z**3 + setting.bias[0]
        a[0] += setting.epsilon[0] * np.cos(setting.omega[0] * tau + setting.phase[0]) + setting.preload[0]
        for to, source, lam in links:
            a[to] += lam * (z[source] - back * z[to])
        return np.concatenate([v, a])

    return slope


def start_of(response, omega):
    order = np.arange(1, response.harmonics.shape[1] + 1)[:, None]
    still = response.mean[0] + response.harmonics[0].real.sum(axis=0)
    return np.concatenate([still, (1j * omega * order * response.harmonics[0]).real.sum(axis=0)])


def integrated(slope, start, periods, rtol=1e-12):
    return solve_ivp(slope, (0, periods * 2 * np.pi / OMEGA), start, method="DOP853", rtol=rtol, atol=1e-15).y[:, -1]


@each_system
@pytest.mark.parametrize("more", [{}, {"preload": 0.03, "bias": 0.02}], ids=["odd", "biased"])
def test_the_orbit_of_harmonic_balance_closes(name, more):
    chain, setting = built(name, **more)
    response = solve(chain, setting, tol=1e-11, rung="harmonic_balance")
    assert response.outcome[0] is Outcome.OK
    start = start_of(response, OMEGA)
    assert np.abs(integrated(slope_of(name, chain, setting), start, 1) - start).max() <= 1e-8


@each_system
def test_integration_reaches_what_dop853_reaches(name):
    chain, setting = built(name, preload=0.02)
    response = steady_from_rest(chain, setting, tol=1e-10, max_periods=5000)
    assert response.outcome[0] is Outcome.OK
    reached = integrated(slope_of(name, chain, setting), np.zeros(12), 120, 1e-10)
    assert np.abs(start_of(response, OMEGA) - reached).max() <= 1e-7
    assert np.abs(start_of(solve(chain, setting, tol=1e-10), OMEGA) - reached).max() <= 1e-7


@each_system
def test_multipliers_are_those_of_the_variational_equations(name):
    chain, setting = built(name)
    response = solve(chain, setting, tol=1e-11, rung="harmonic_balance")
    slope, start = slope_of(name, chain, setting), start_of(response, OMEGA)
    steps = 1e-5 * np.eye(12)
    columns = [
        (integrated(slope, start + step, 1, 1e-13) - integrated(slope, start - step, 1, 1e-13)) / 2e-5 for step in steps
    ]
    wanted = np.linalg.eigvals(np.array(columns).T)
    found = response.multipliers[0].reshape(-1)
    # Equal stages in cascade make the whole matrix defective, so its eigenvalues are only good to rounding^(1/6).
    close = 1e-6 if chain.closure is not Closure.OPEN else 0.05
    assert np.abs(found[:, None] - wanted).min(axis=1).max() <= close
    assert np.sum(found) == pytest.approx(np.sum(wanted), abs=1e-6)
    assert np.prod(found) == pytest.approx(np.exp(-np.broadcast_to(chain.deltas, 6).sum() * 2 * np.pi / OMEGA))


@each_system
def test_both_full_rungs_agree_to_the_last_harmonic(name):
    chain, setting = built(name, preload=0.02)
    balance = solve(chain, setting, tol=1e-11, rung="harmonic_balance")
    integral = steady_from_rest(chain, setting, tol=1e-12, max_periods=5000)
    depth = min(balance.harmonics.shape[1], 7)
    assert balance.harmonics[:, :depth] == pytest.approx(integral.harmonics[:, :depth], abs=1e-11)
    assert balance.branch.tolist() == integral.branch.tolist()
    ours, theirs = (np.sort(np.abs(r.multipliers).reshape(-1)) for r in (balance, integral))
    assert ours == pytest.approx(theirs, abs=1e-7)


@each_system
@pytest.mark.parametrize("rung", ["linear", "one_harmonic"])
def test_cheap_rungs_know_their_error(name, rung):
    drives = 0.02 * 0.5 ** np.arange(5)
    chain, setting = built(name, epsilon=drives)
    truth = solve(chain, setting, tol=1e-12, rung="harmonic_balance")
    rough = solve(chain, setting, tol=1e-12, rung=rung)
    error = np.abs(rough.phasor - truth.phasor).max(axis=1) / np.abs(truth.phasor).max(axis=1)
    assert (error <= rough.error_estimate).all()
    assert (rough.error_estimate <= 10 * error + 1e-11).all()
    slope = np.polyfit(np.log(drives), np.log(error), 1)[0]
    assert slope == pytest.approx({"linear": 2, "one_harmonic": 4}[rung], abs=0.3)


@each_system
def test_equilibria_balance_their_forces(name):
    chain, setting = built(name, epsilon=0.0, bias=[0.05, -0.02, 0.03, 0.0, 0.04, 0.01])
    response = solve(chain, setting, tol=1e-10, rung="static")
    assert response.outcome[0] is Outcome.OK
    assert solve(chain, setting, tol=1e-10).mean == pytest.approx(response.mean, rel=1e-9)
    at = np.concatenate([response.mean[0], np.zeros(6)])
    assert np.abs(slope_of(name, chain, setting)(0.0, at)).max() <= 1e-13


@each_system
def test_without_cubic_terms_the_linear_rung_is_exact(name):
    given: dict[str, Any] = {"delta": 0.1, **SYSTEMS[name], "beta": 0.0}
    chain, (_, setting) = Chain.of(6, **given), built(name, preload=0.02)
    response = solve(chain, setting, tol=1e-12)
    assert (response.rung, response.outcome[0]) == ("linear", Outcome.OK)
    integral = steady_from_rest(chain, setting, tol=1e-12, max_periods=100)
    assert response.phasor == pytest.approx(integral.phasor, abs=1e-12)
    assert response.mean == pytest.approx(integral.mean, abs=1e-12)


def test_a_grid_without_links_downwards_is_its_first_row():
    grid, row = Chain.of(12, delta=0.02, beta=-1.0, rows=3), Chain(4, 0.02, -1.0)
    lam = np.tile([0.1, 0.2, 0.15], (3, 1))
    for rung in ("linear", "one_harmonic", "harmonic_balance", "ode"):
        two = solve(grid, Setting.of(grid, epsilon=0.01, lam=lam, omega=1.1), tol=1e-9, rung=rung)
        one = solve(row, Setting.of(row, epsilon=0.01, lam=lam[0], omega=1.1), tol=1e-9, rung=rung)
        assert two.phasor[0, :4] == pytest.approx(one.phasor[0], rel=1e-12)
        assert not two.phasor[0, 4:].any()


def test_a_grid_does_not_change_when_mirrored():
    grid = Chain.of(12, delta=0.02, beta=-1.0, rows=3)
    mirror = Chain.of(12, delta=0.02, beta=-1.0, rows=4)
    rng = np.random.default_rng(2)
    right, down = rng.uniform(0.02, 0.05, (3, 3)), rng.uniform(0.02, 0.05, (2, 4))
    a = solve(grid, Setting.of(grid, epsilon=0.01, lam=right, lam_y=down, omega=1.1), tol=1e-9)
    b = solve(mirror, Setting.of(mirror, epsilon=0.01, lam=down.T, lam_y=right.T, omega=1.1), tol=1e-9)
    assert a.outcome[0] is b.outcome[0] is Outcome.OK
    turned = a.phasor.reshape(3, 4).T
    assert turned == pytest.approx(b.phasor.reshape(4, 3), rel=1e-9)


@pytest.mark.parametrize("closure", ["ring", "bidirectional"])
def test_cost_of_a_joint_solve_is_linear_in_its_length(closure):
    work = []
    for n in (25, 50, 100):
        chain = Chain(n, 0.1, -1.0, closure)
        response = solve(chain, Setting.of(chain, epsilon=0.01, lam=0.1, omega=1.1), tol=1e-9, rung="harmonic_balance")
        assert response.outcome[0] is Outcome.OK
        work.append(response.stats.newton_steps / n)
    assert max(work) <= min(work) + 1


@pytest.mark.parametrize("closure", ["ring", "bidirectional"])
def test_band_and_dense_elimination_agree(closure, monkeypatch):
    from chainsim.harmonic_balance import joint

    chain = Chain(11, 0.05, -1.0, closure)
    setting = Setting.of(chain, epsilon=[0.01, 0.03], lam=0.1, omega=[1.1, 0.95], bias=0.01)
    dense = solve(chain, setting, tol=1e-10, rung="harmonic_balance")
    monkeypatch.setattr(joint, "DENSE", 0)
    band = solve(chain, setting, tol=1e-10, rung="harmonic_balance")
    assert band.harmonics == pytest.approx(dense.harmonics, abs=1e-14)


@settings(max_examples=25, deadline=None)
@given(
    closure=st.sampled_from(list(Closure)), n=st.integers(1, 5), lam=st.floats(0, 0.3), omega=st.floats(0.5, 1.6),
    epsilon=st.floats(0, 0.02), turn=st.floats(-3, 3),
)  # fmt: skip
def test_a_phase_of_the_drive_turns_every_phasor(closure, n, lam, omega, epsilon, turn):
    chain = Chain(n, 0.1, -1.0, closure)
    a, b = (
        solve(chain, Setting.of(chain, epsilon=epsilon, lam=lam, omega=omega, phase=phase), tol=1e-9)
        for phase in (0.0, turn)
    )
    assert a.outcome[0] is b.outcome[0]
    if a.outcome[0] is Outcome.OK:
        assert np.abs(b.phasor - a.phasor * np.exp(1j * turn)).max() <= 1e-7 * max(np.abs(a.phasor).max(), 1e-300)


def test_when_the_lower_branch_of_a_ring_is_sure_it_is_the_one_integrated():
    from chainsim.reach.rest import sure_from_rest

    rng = np.random.default_rng(4)
    for closure in (Closure.RING, Closure.BIDIRECTIONAL):
        chain = Chain(4, 0.05, -1.0, closure)
        setting = Setting.of(
            chain, epsilon=np.exp(rng.uniform(np.log(1e-4), np.log(0.05), 60)), lam=rng.uniform(0.005, 0.04, (60, 1)),
            omega=rng.uniform(0.9, 1.2, 60),
        )  # fmt: skip
        steady = solve(chain, setting, tol=1e-9, rung="harmonic_balance")
        sure = sure_from_rest(chain, setting, steady)
        assert sure.sum() > 5
        truth = steady_from_rest(chain, setting[sure], tol=1e-9, max_periods=20_000)
        assert (truth.outcome == Outcome.OK).all()
        assert truth.phasor == pytest.approx(steady.phasor[sure], rel=1e-7)


def test_descriptions_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"chain\.delta: expected a number or a list of 3, got shape \(2,\)"):
        Chain.of(3, delta=[0.1, 0.2], beta=-1.0)
    with pytest.raises(ValueError, match=r"chain\.delta: expected a finite number >= 0, got -0\.1"):
        Chain.of(2, delta=[0.1, -0.1], beta=-1.0)
    with pytest.raises(ValueError, match=r"chain\.stiffness: expected a finite number, got nan"):
        Chain.of(1, delta=0.1, beta=-1.0, stiffness=[np.nan])
    with pytest.raises(ValueError, match=r"chain\.rows: expected a divisor of n = 6, got 4"):
        Chain.of(6, delta=0.1, beta=-1.0, rows=4)
    with pytest.raises(ValueError, match=r"chain\.closure: a grid is open"):
        Chain.of(6, delta=0.1, beta=-1.0, rows=2, closure="ring")
    with pytest.raises(ValueError, match=r"chain\.kind: an amplifier acts one way"):
        Chain.of(6, delta=0.1, beta=-1.0, kind=CouplingKind.AMPLIFIER, closure="bidirectional")
    grid = Chain.of(6, delta=0.1, beta=-1.0, rows=2)
    with pytest.raises(ValueError, match=r"setting\.lam_y: expected a number or shape \(1, 3\)"):
        Setting.of(grid, epsilon=0.1, lam=0.1, lam_y=[0.1, 0.2], omega=1.0)
    with pytest.raises(ValueError, match=r"setting\.lam_y: only a grid"):
        Setting.of(Chain(2, 0.1, -1.0), epsilon=0.1, lam=0.1, lam_y=0.1, omega=1.0)
    two_way = Chain(3, 0.1, -1.0, Closure.BIDIRECTIONAL)
    setting = Setting.of(two_way, epsilon=0.1, lam=0.1, omega=1.0)
    with pytest.raises(RungError, match="the branches of a bidirectional chain are found together: use joint_branches"):
        load_rung("harmonic_balance").solve(two_way, setting, tol=1e-6, start=Start.ALL)
