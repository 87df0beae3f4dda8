"""One list of hostile settings for every rung and system: a right answer, a named outcome or a ValueError."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from chainsim import (
    Chain,
    GridIntegrator,
    Outcome,
    RungError,
    Setting,
    Start,
    Terms,
    balance_near,
    integrate_terms,
    load_rung,
    solve,
    steady_from_rest,
)  # fmt: skip
from tests.support.everyday import one_in
from tests.support.hostile import BASE, CLOSURES, ESCAPE, HOSTILE, SYSTEMS, built

STEADY = ["static", "linear", "one_harmonic", "harmonic_balance"]
# The four closures every day, the kinds with the long runs.
each_system = pytest.mark.parametrize(
    "system", [pytest.param(name, marks=() if name in CLOSURES else pytest.mark.slow) for name in SYSTEMS]
)


def sane(response):
    for index, outcome in enumerate(response.outcome):
        assert isinstance(outcome, Outcome)
        if outcome is Outcome.OK:
            assert np.isfinite(response.harmonics[index]).all()
            assert np.isfinite(response.mean[index]).all()
            assert np.isfinite(response.multipliers[index]).all()
            assert np.isfinite(response.error_estimate[index])
            assert response.stable[index]


@each_system
@pytest.mark.parametrize("rung", [*STEADY, pytest.param("envelope", marks=pytest.mark.slow)])
@pytest.mark.parametrize("extreme", one_in(3, HOSTILE), ids=str)
def test_steady_rungs(system, rung, extreme):
    chain, setting = built(system, extreme)
    refusal = load_rung(rung).refusal(chain, setting, Start.REST)
    if refusal:
        # The envelope says what it is not true of; the others answer everything.
        assert rung == "envelope"
        with pytest.raises(RungError, match="use rung"):
            solve(chain, setting, tol=1e-6, rung=rung)
        return
    response = solve(chain, setting, tol=1e-6, rung=rung)
    sane(response)
    assert response.stats.newton_steps <= 20_000 * max(1, chain.n // 100)
    assert response.stats.rhs_evals <= 5e8


@each_system
@pytest.mark.parametrize("extreme", one_in(3, HOSTILE), ids=str)
def test_integration(system, extreme):
    if extreme == {"n": 1000} and system in {"ring", "bidirectional"}:
        pytest.skip("its joint map is a matrix of 2000 x 2000")
    response = steady_from_rest(*built(system, extreme), tol=1e-6, max_periods=300)
    sane(response)
    assert response.stats.rhs_evals <= 5e8


@pytest.mark.slow
@each_system
@pytest.mark.parametrize("extreme", [each for each in HOSTILE if each != {"n": 1000}], ids=str)
def test_auto(system, extreme):
    response = solve(*built(system, extreme), tol=1e-6)
    sane(response)
    assert response.stats.rhs_evals <= 5e9


@pytest.mark.parametrize("n", [1, 2, 1000])
@pytest.mark.parametrize("system", ["open", "ring", "bidirectional", "amplifier"])
@pytest.mark.parametrize("rung", STEADY)
def test_lengths(n, system, rung):
    response = solve(*built(system, {"n": n}), tol=1e-6, rung=rung)
    assert response.outcome[0] in (Outcome.OK, Outcome.OUT_OF_BUDGET)
    # The multipliers of a joint chain of more than 200 are not formed, and without them nothing is called stable.
    assert (response.outcome[0] is Outcome.OK) == (n < 1000 or system in {"open", "amplifier"})


@pytest.mark.slow
@pytest.mark.parametrize("system", ["open", "grid", "amplifier"])
@pytest.mark.parametrize("rung", [*STEADY, "auto"])
def test_a_million_oscillators(system, rung):
    response = solve(*built(system, {"n": 1_000_000}), tol=1e-6, rung=rung)
    sane(response)
    # Whether a sudden drive of so long a chain reaches the lower answer is not integrated.
    assert response.outcome[0] is Outcome.OK or (rung, response.outcome[0]) == ("auto", Outcome.OUT_OF_BUDGET)


@pytest.mark.parametrize("basis_and_rung", ["static", "one_harmonic", "harmonic_balance", "linear"])
def test_long_chains_are_answered_as_short_ones(basis_and_rung, monkeypatch):
    from chainsim.harmonic_balance import long

    chain = Chain(40, 0.02, -1.0)
    forces = {"epsilon": 0.0, "preload": 0.1} if basis_and_rung == "static" else {"epsilon": 1e-3}
    setting = Setting.of(chain, lam=0.2, omega=1.05, **forces)
    short = solve(chain, setting, tol=1e-9, rung=basis_and_rung)
    monkeypatch.setattr(long, "LONG", 10)
    monkeypatch.setattr(long, "BLOCK", 7)
    alone = solve(chain, setting, tol=1e-9, rung=basis_and_rung)
    assert alone.outcome[0] is short.outcome[0] is Outcome.OK
    assert alone.harmonics == pytest.approx(short.harmonics, rel=1e-12)
    assert alone.mean == pytest.approx(short.mean, rel=1e-12)
    assert alone.error_estimate == pytest.approx(short.error_estimate, rel=1e-6, abs=1e-13)


def exact_chain(setting, delta):
    """First harmonics of a linear open chain in exact rational arithmetic, as pairs of fractions."""
    omega, lam = Fraction(float(setting.omega[0])), [Fraction(float(link)) for link in setting.lam[0]]
    re, im, found = Fraction(float(setting.epsilon[0])), Fraction(0), []
    for m, link in enumerate(lam):
        a, b = 1 + (link if m else 0) - omega**2, Fraction(delta) * omega
        size = a * a + b * b
        if m:
            re, im = re * link, im * link
        re, im = (re * a + im * b) / size, (im * a - re * b) / size
        found.append((re, im))
    return found


LINEAR = [{key: value for key, value in each.items() if key != "beta"} for each in HOSTILE]


@pytest.mark.parametrize("extreme", [each for each in LINEAR if not {"preload", "n"} & set(each)], ids=str)
def test_linear_answers_against_exact_fractions(extreme):
    values = BASE | extreme | {"beta": 0.0}
    if values["delta"] == 0.0 and abs(values["omega"] - 1) < 1e-15:
        pytest.skip("no bounded answer at a resonance without damping")
    chain, setting = built("open", extreme | {"beta": 0.0})
    found = solve(chain, setting, tol=1e-6, rung="linear", start="ramp")
    if not found.locked[0]:
        return
    # 1 + lam - omega^2 is formed in double precision: its rounding, over what is left of it, is the error allowed.
    stiffness = 1 + abs(values["lam"]) + values["omega"] ** 2
    sharpest = min(
        abs(complex(1 + (values["lam"] if m else 0) - values["omega"] ** 2, values["delta"] * values["omega"]))
        for m in range(2)
    )
    allowed = 1e-14 + 12 * 2.3e-16 * stiffness / sharpest
    for (re, im), phasor in zip(exact_chain(setting, values["delta"]), found.phasor[0], strict=True):
        wanted = complex(float(re), float(im))
        assert abs(phasor - wanted) <= allowed * abs(wanted) + 1e-300


@pytest.mark.parametrize("by", [-1e-9, -1e-6, 1e-9, 1e-6])
@pytest.mark.parametrize("beta", [-1.0, -1e12, -1e-12])
def test_the_static_well_ends_where_algebra_says(by, beta):
    """``c + beta c^3 = b`` has its fold at b = 2/(3 sqrt(3 |beta|)), at c = 1/sqrt(3 |beta|)."""
    chain = Chain(1, 0.02, beta)
    bias = ESCAPE / np.sqrt(-beta) * (1 + by)
    response = solve(chain, Setting.of(chain, epsilon=0, lam=0, omega=1, bias=bias), tol=1e-9, rung="static")
    assert response.outcome[0] is (Outcome.OK if by < 0 else Outcome.ESCAPED)
    if by < 0:
        # Near a fold c is off by the square root of the distance: 3 |beta| c_0 (c - c_0)^2 = b_0 - b.
        wanted = (1 - np.sqrt(-2 * by / 3)) / np.sqrt(-3 * beta)
        assert response.mean[0, 0] == pytest.approx(wanted, rel=2 * abs(by) ** 0.5 * abs(by) ** 0.5 + 1e-6)


@pytest.mark.parametrize("by", [-1e-12, 1e-12])
def test_within_rounding_of_a_fold_there_is_an_answer_or_a_named_outcome(by):
    kappa, g = 1 - 0.985**2, 5e-3 * 0.985
    v = kappa / 3 * (2 - np.sqrt(1 - 3 * (g / kappa) ** 2))
    fold = np.sqrt(v * ((kappa - v) ** 2 + g * g) / 0.75)
    chain = Chain(1, 5e-3, -1.0)
    setting = Setting.of(chain, epsilon=fold * (1 + by), lam=0, omega=0.985)
    for start in ("rest", "ramp", "all"):
        for rung in ("one_harmonic", "harmonic_balance"):
            sane(solve(chain, setting, tol=1e-6, rung=rung, start=start))
    rough = solve(chain, setting, tol=1e-6, rung="one_harmonic", start="all")
    assert len(rough) in (1, 2, 3)


def test_softening_and_hardening_orbits_against_a_taylor_integrator():
    heyoka = pytest.importorskip("heyoka")
    for beta, epsilon in ((-1.0, 0.15), (1.0, 5.0)):
        z, v = heyoka.make_vars("z", "v")
        force = epsilon * heyoka.cos(1.3 * heyoka.time)
        system = [(z, v), (v, force - 0.05 * v - z - beta * z * z * z)]
        chain = Chain(1, 0.05, beta)
        response = solve(chain, Setting.of(chain, epsilon=epsilon, lam=0, omega=1.3), tol=1e-11)
        assert response.outcome[0] is Outcome.OK
        order = np.arange(1, response.harmonics.shape[1] + 1)
        start = [response.harmonics[0, :, 0].real.sum(), (1.3j * order * response.harmonics[0, :, 0]).real.sum()]
        orbit = heyoka.taylor_adaptive(system, list(start), tol=1e-16)
        orbit.propagate_until(2 * np.pi / 1.3)
        assert np.abs(orbit.state - start).max() <= 1e-8 * np.abs(start).max()


def energy(z, v, beta):
    return v * v / 2 + z * z / 2 + beta * z**4 / 4


@pytest.mark.slow
def test_energy_stays_bounded_over_a_million_periods():
    from chainsim.equations.views import Network
    from chainsim.time_domain.network import advance_network
    from chainsim.time_domain.splitting import forcing_table

    one, nothing = np.ones((1, 1)), np.zeros((1, 1))
    network = Network(
        one, nothing, nothing, 0, nothing, np.zeros((1, 2)), np.array([2 * np.pi]), np.zeros(1), -np.ones(1), False
    )
    state, table, ratios = np.array([[0.5, 0.0]]), forcing_table(8), []
    for _ in range(100):
        advance_network(state, np.zeros(1, dtype=np.int64), network, table, 0, 80_000, np.zeros(1))
        ratios.append(energy(state[0, 0], state[0, 1], -1.0) / energy(0.5, 0.0, -1.0) - 1)
    errors = np.array(ratios)
    assert np.abs(errors).max() <= 1e-4
    # No drift: the second half is no worse than the first.
    assert np.abs(errors[50:]).max() <= 2 * np.abs(errors[:50]).max() + 1e-9


@settings(max_examples=30, deadline=None)
@given(
    system=st.sampled_from(list(SYSTEMS)), rung=st.sampled_from(STEADY), lam=st.floats(-1e6, 1e6),
    omega=st.floats(1e-6, 1e6), delta=st.floats(0, 1e6), beta=st.floats(-1e12, 1e12), epsilon=st.floats(0, 1e12),
    preload=st.floats(-1e12, 1e12),
)  # fmt: skip
def test_around_the_list(system, rung, lam, omega, delta, beta, epsilon, preload):
    extreme = {"lam": lam, "omega": omega, "delta": delta, "beta": beta, "epsilon": epsilon, "preload": preload}
    sane(solve(*built(system, extreme), tol=1e-6, rung=rung))


@each_system
@pytest.mark.parametrize("size", [1.5, 50.0, 1e200])
def test_guides_beyond_the_hilltop(system, size):
    chain, setting = built(system, {})
    for rate in (1, 3):
        guide = np.full((1, rate, chain.n), size, dtype=np.complex128)
        sane(balance_near(chain, setting, guide, tol=1e-6, mean=np.full((1, chain.n), size)))
    sane(balance_near(chain, setting, guide[:, 0], tol=1e-6))


def test_steps_too_large_are_cut_or_refused():
    grid = GridIntegrator(shape=(1, 1), chain_length=1, delta=0.1, beta=0.0, ring=False, dtau=200.0)
    force = np.ones((3, 1, 1))
    assert grid.advance(force, np.zeros((1, 1))).ravel()[1:] == pytest.approx([1.0, 1.0], abs=2e-4)
    chain, setting = built("open", {})
    with pytest.raises(ValueError, match="step: expected at most"):
        integrate_terms(chain, setting, Terms(), duration=1e3, step=100.0, every=1)


@each_system
@pytest.mark.parametrize(
    ("extreme", "named"),
    [
        ({"delta": -1e-12}, "chain.delta"), ({"delta": np.nan}, "chain.delta"), ({"beta": np.inf}, "chain.beta"),
        ({"epsilon": np.nan}, "setting.epsilon"), ({"lam": -np.inf}, "setting.lam"), ({"omega": 0.0}, "setting.omega"),
        ({"omega": np.nan}, "setting.omega"), ({"preload": np.inf}, "setting.preload"), ({"n": 0}, "chain.n"),
    ],
    ids=str,
)  # fmt: skip
def test_bad_numbers_are_named(system, extreme, named):
    with pytest.raises(ValueError, match=named):
        built(system, extreme)


def test_every_branch_of_a_long_multistable_chain_is_refused_in_one_sentence():
    chain = Chain(64, 5.3e-3, -1.0)
    setting = Setting.of(chain, epsilon=2e-3, lam=6.131e-3, omega=0.99)
    with pytest.raises(RungError, match="more than 2048 branches by oscillator 11; use start rest"):
        solve(chain, setting, tol=1e-6, start="all")


@pytest.mark.parametrize(("delta", "omega"), [(1e6, 1.05), (1e3, 1e-2), (3.0, 1e-2), (0.1, 3e-4), (1e-3, 2e-4)])
def test_multipliers_under_a_drive_far_slower_than_the_oscillators(delta, omega):
    """A faint orbit has the multipliers of the oscillators at rest, exp(T (-delta/2 +- sqrt(delta^2/4 - k)))."""
    chain = Chain(2, delta, -1.0)
    setting = Setting.of(chain, epsilon=1e-6, lam=0.1, omega=omega)
    response = solve(chain, setting, tol=1e-6, rung="harmonic_balance")
    for m, k in enumerate((Fraction(1), 1 + Fraction(0.1))):
        square = Fraction(delta) ** 2 / 4 - k
        root = np.sqrt(complex(float(square)))
        fast = -delta / 2 - root
        # Their product is k: the slower one without its cancellation.
        slow = float(k) / fast
        wanted = np.exp(2 * np.pi / omega * np.array([slow, fast]))
        found = response.multipliers[0, m]
        assert np.abs(found) == pytest.approx(np.abs(wanted), rel=1e-5, abs=1e-100)
    assert response.outcome[0] is Outcome.OK


def test_a_hardening_oscillator_never_escapes():
    chain = Chain(1, 0.05, 1.0)
    setting = Setting.of(chain, epsilon=[1.0, 1e6, 1e100, 1e300], lam=0, omega=1.0)
    response = steady_from_rest(chain, setting, tol=1e-6, max_periods=500)
    assert response.outcome[0] is Outcome.OK
    assert Outcome.ESCAPED not in response.outcome.tolist()
