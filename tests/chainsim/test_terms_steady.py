"""Steady states with every term, in every closure, against closed forms, other integrations and the ladder."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chainsim import Chain, Closure, CouplingKind, Outcome, RungError, Setting, Start, solve
from chainsim.continuation.locking import locking
from chainsim.effects.effects import AmplifierDynamics, BoucWen, Creep, Play, Terms, Tone, bending_modes
from chainsim.effects.lines import Lines
from chainsim.effects.ode import integrate_terms
from chainsim.effects.rungs import solve_with_terms
from chainsim.effects.steady import steady_with_terms

DELTA = 5.3006e-3
SLOW = Creep(per_decade=0.1, first=2.0, last=200.0, each=1)
CHAINS = {
    "open": Chain(3, 0.05, -1.0),
    "ring": Chain(3, 0.05, -1.0, Closure.RING),
    "bidirectional": Chain(3, 0.05, -1.0, Closure.BIDIRECTIONAL),
    "grid": Chain(4, 0.05, -1.0, rows=2),
    "amplifier": Chain(3, 0.05, -1.0, Closure.RING, kind=CouplingKind.AMPLIFIER),
}
each_closure = pytest.mark.parametrize("name", CHAINS)


def links(chain, setting):
    """The matrix of all links, written down from the equations."""
    n, lam = chain.n, setting.lam[0]
    matrix = np.zeros((n, n))

    def link(fed, source, strength):
        matrix[fed, source] += strength
        if chain.kind == "resistor":
            matrix[fed, fed] -= strength

    for m in range(n):
        if chain.rows > 1:
            if m % chain.cols:
                link(m, m - 1, lam[m])
            if m >= chain.cols:
                link(m, m - chain.cols, setting.lam_y[0, m])
        elif m or chain.closure == "ring":
            link(m, (m - 1) % n, lam[m])
            if chain.closure == "bidirectional":
                link(m - 1, m, lam[m])
    return matrix


def setting_of(chain, **more):
    values = {"epsilon": 0.02, "lam": 0.04, "omega": 1.03, **more}
    if chain.rows > 1:
        values["lam_y"] = 0.06
    return Setting.of(chain, **values)


@each_closure
def test_without_terms_it_is_the_chain_of_any_closure(name):
    chain = CHAINS[name]
    bias = 0.01 * np.arange(chain.n)
    setting = setting_of(chain, bias=bias, preload=0.05, phase=0.3)
    matrix, n = links(chain, setting), chain.n

    def slope(tau, y):
        z, v = y[:n], y[n:]
        pull = matrix @ z - chain.delta * v - z - chain.beta * z**3 + bias
        pull[0] += 0.02 * np.cos(1.03 * tau + 0.3) + 0.05
        return np.concatenate([v, pull])

    truth = solve_ivp(slope, (0, 40), np.zeros(2 * n), method="DOP853", rtol=1e-11, atol=1e-13).y[:n, -1]
    moved = integrate_terms(chain, setting, Terms(), duration=40.0, step=0.02, every=1)
    assert moved.tip[-1] == pytest.approx(truth, rel=1e-6, abs=1e-9)


@each_closure
def test_the_steady_state_is_that_of_the_ladder(name):
    chain = CHAINS[name]
    setting = setting_of(chain, bias=0.02)
    wanted = solve(chain, setting, tol=1e-9)
    found = steady_with_terms(chain, setting, Terms(), tol=1e-6, start=Start.REST)
    assert found.outcome is wanted.outcome[0] is Outcome.OK
    assert found.error_estimate <= 1e-6
    size = np.abs(wanted.phasor[0]).max()
    for mine, other in ((found.amplitude[0], wanted.phasor[0]), (found.amplitude[2], wanted.third[0])):
        assert np.abs(mine - other).max() <= 1e-6 * size
    assert np.abs(found.mean - wanted.mean[0]).max() <= 1e-6 * size


@pytest.mark.parametrize(("rung", "tol"), [("ode", 1e-6), ("harmonic_balance", 1e-11)])
@pytest.mark.parametrize("closure", ["open", "ring", "bidirectional"])
def test_linear_terms_are_factors_of_the_force(closure, rung, tol):
    """f = e (1 + sum g/(1 + i omega T)), tip = f (1/K + modes), and the drive is filtered: all in one linear system."""
    chain, omega = Chain(3, 0.05, 0.0, closure), 1.03
    setting = setting_of(chain, phase=0.4)
    creep, modes = Creep(per_decade=0.1, first=2.0, last=200.0, each=1), bending_modes(1.0, (5.0, 9.5), delta=0.05)
    terms = Terms(creep=creep, modes=modes, amplifier=AmplifierDynamics(bandwidth=2.0))
    found = solve_with_terms(chain, setting, terms, tol=tol, rung=rung, start=Start.REST)
    grown = 1 + sum(0.1 / (1 + 1j * omega * t) for t in creep.times)
    tip = 1 / (1 - omega**2 + 0.05j * omega)
    tip += sum(mode.gain / (mode.omega**2 - omega**2 + 1j * mode.delta * omega) for mode in modes)
    drive = 0.02 * np.exp(0.4j) / (1 + 1j * omega / 2.0) * np.eye(3)[0]
    wanted = np.linalg.solve(np.eye(3) / (grown * tip) - links(chain, setting), drive)
    assert found.outcome is Outcome.OK
    assert np.abs(found.amplitude[0] - wanted).max() <= tol * np.abs(wanted).max()
    assert np.abs(found.amplitude[1:]).max() <= tol * np.abs(wanted).max()


@each_closure
@pytest.mark.parametrize("phase", [0.0, 0.3])
def test_harmonic_balance_is_the_limit_of_the_integration(name, phase):
    chain = CHAINS[name]
    bias = 0.02 * np.arange(chain.n) if phase else 0.0
    setting = setting_of(chain, phase=phase, bias=bias, preload=0.03 if phase else 0.0)
    modes = bending_modes(1.0, (5.0, 9.5), delta=0.05)
    terms = Terms(modes=modes, creep=SLOW, amplifier=AmplifierDynamics(2.0))
    whole = solve_with_terms(chain, setting, terms, tol=1e-6, rung="ode", start=Start.REST)
    for rung, stable in (("harmonic_balance", None), ("auto", True)):
        sharp = solve_with_terms(chain, setting, terms, tol=1e-9, rung=rung, start=Start.REST)
        assert (sharp.outcome, sharp.rung, sharp.stable) == (Outcome.OK, "harmonic_balance", stable)
        size = np.abs(sharp.amplitude).max()
        assert np.abs(whole.amplitude[:3] - sharp.amplitude[:3]).max() <= 1e-6 * size
        assert np.abs(whole.mean - sharp.mean).max() <= 1e-6 * size
        assert (sharp.drift is None) == (rung == "harmonic_balance")


@each_closure
def test_harmonic_balance_without_terms_is_that_of_the_ladder(name):
    chain = CHAINS[name]
    for bias in (0.0, 0.02):
        setting = setting_of(chain, bias=bias)
        found = solve_with_terms(chain, setting, Terms(), tol=1e-10, rung="harmonic_balance", start=Start.RAMP)
        wanted = solve(chain, setting, tol=1e-11, rung="harmonic_balance", start="ramp")
        assert found.amplitude[0] == pytest.approx(wanted.phasor[0], rel=1e-9)
        assert found.amplitude[2] == pytest.approx(wanted.third[0], rel=1e-6)


@pytest.mark.parametrize(
    ("epsilon", "balanced", "sure"),
    [
        (1e-3, Outcome.OK, Outcome.OK),
        (0.3, Outcome.OK, Outcome.ESCAPED),
        (1e12, Outcome.NO_CONVERGENCE, Outcome.ESCAPED),
    ],
)
def test_auto_believes_the_integration_where_harmonic_balance_finds_an_orbit_that_is_not_reached(
    epsilon, balanced, sure
):
    chain = Chain(1, 0.01, -1.0)
    setting = Setting.of(chain, epsilon=epsilon, lam=0, omega=1.0)
    for rung, outcome in (("harmonic_balance", balanced), ("auto", sure)):
        found = solve_with_terms(chain, setting, Terms(creep=SLOW), tol=1e-6, rung=rung, start=Start.REST)
        assert found.outcome is outcome
        assert np.isfinite(found.amplitude).all() == (outcome is Outcome.OK)


def test_bouc_wen_in_a_ring_against_an_integration_of_its_own():
    chain = Chain(2, 0.2, -1.0, Closure.RING)
    setting = Setting.of(chain, epsilon=0.02, lam=0.1, omega=1.0)
    model = BoucWen(gain=0.4, loading=60.0, unloading=20.0)

    def slope(tau, y):
        z, v, h = y[:2], y[2:4], y[4:]
        e, change = 0.1 * (z[::-1] - z), 0.1 * (v[::-1] - v)
        e[0] += 0.02 * math.cos(tau)
        change[0] -= 0.02 * math.sin(tau)
        rate = 0.4 * change - 60 * np.abs(change) * h - 20 * change * np.abs(h)
        return np.concatenate([v, e - h - 0.2 * v - z + z**3, rate])

    period = 2 * np.pi
    at = 30 * period + np.arange(64) * (period / 64)
    truth = solve_ivp(slope, (0, at[-1]), np.zeros(6), t_eval=at, rtol=1e-9, atol=1e-12, max_step=0.05).y[:2]
    wanted = 2 * (truth * np.exp(-1j * at)).mean(axis=1)
    found = steady_with_terms(chain, setting, Terms(hysteresis=model), tol=1e-4, start=Start.REST)
    assert found.outcome is Outcome.OK
    assert np.abs(found.amplitude[0] - wanted).max() <= 1e-4 * np.abs(wanted).max()


@pytest.mark.parametrize("beta", [0.0, -1.0])
def test_creep_ends_where_its_relaxations_do_and_drifts_there_alike_in_every_decade(beta):
    chain, creep, force = Chain(2, 0.3, beta, Closure.BIDIRECTIONAL), Creep(per_decade=0.02, first=80.0, last=8e4), 0.05
    setting = Setting.of(chain, epsilon=0.0, lam=0.0, omega=1.0, bias=[force, 2 * force])
    found = steady_with_terms(chain, setting, Terms(creep=creep), tol=1e-6, start=Start.REST)
    grown = 1 + 0.01 * len(creep.times)
    wanted = [np.sort(np.roots([beta, 0, 1, -grown * b]).real)[1 if beta else 0] for b in (force, 2 * force)]
    assert found.outcome is Outcome.OK
    assert found.mean == pytest.approx(wanted, rel=1e-6)
    assert found.drift is not None
    assert found.drift.tau[-1] == pytest.approx(8e4, rel=1e-3)
    if not beta:
        inner = (found.drift.tau > 500) & (found.drift.tau < 4e4)
        growth = np.diff(found.drift.mean[inner, 0]) / force
        assert growth == pytest.approx(0.01, rel=0.2)


def test_a_ramp_stays_on_the_lower_branch_that_a_sudden_drive_leaves():
    chain = Chain(1, DELTA, -1.0)
    setting = Setting.of(chain, epsilon=2.0e-3, lam=0, omega=0.985)
    low, high = np.abs(solve(chain, setting, tol=1e-8, start="all").phasor[[0, 2], 0])
    ends = [
        abs(steady_with_terms(chain, setting, Terms(), tol=1e-4, start=start).amplitude[0, 0])
        for start in (Start.RAMP, Start.REST)
    ]
    assert ends[0] == pytest.approx(low, rel=1e-4)
    assert ends[1] == pytest.approx(high if abs(ends[1] - low) > 0.1 * low else low, rel=1e-4)


def test_an_unlocked_ring_beats_as_its_envelope_does():
    ring = Chain(3, DELTA, 1.0, Closure.RING)
    setting = Setting.of(ring, epsilon=5e-5, lam=1e-2, omega=1.0)
    found = steady_with_terms(ring, setting, Terms(), tol=1e-4, start=Start.REST)
    slow = locking(ring, setting, start="rest")
    assert found.outcome is slow.outcome[0] is Outcome.NOT_LOCKED
    assert found.beat is not None
    assert found.beat.omega == pytest.approx(slow.beat[0], rel=0.02)
    assert found.beat.depth.max() == pytest.approx(slow.spread[0], rel=0.02)
    assert np.isnan(found.amplitude).all()


def test_play_without_width_is_a_spring():
    """Plays of radius 0 follow the force: base and weights add up."""
    ring = CHAINS["ring"]
    setting = setting_of(ring)
    plain = steady_with_terms(ring, setting, Terms(), tol=1e-5, start=Start.REST)
    thin = Terms(hysteresis=Play(radius=(0.0, 0.0), weight=(0.25, 0.25), base=0.5))
    assert steady_with_terms(ring, setting, thin, tol=1e-5, start=Start.REST).amplitude[0] == pytest.approx(
        plain.amplitude[0], rel=1e-4
    )


def test_tones_of_a_linear_ring_add_up():
    ring = Chain(3, 0.05, 0.0, Closure.RING)
    tones = Tone(0.02, 1.03, 0.2), Tone(0.01, 0.9), Tone(0.03, 1.2, -1.0)
    setting = setting_of(ring)
    found = steady_with_terms(ring, setting, Terms(tones=tones), tol=1e-5, start=Start.REST)
    assert found.outcome is Outcome.OK
    for k, tone in enumerate(tones):
        alone = Setting.of(ring, epsilon=tone.epsilon, lam=0.04, omega=tone.omega, phase=tone.phase)
        assert found.amplitude[found.lines.place(*np.eye(3, dtype=int)[k])] == pytest.approx(
            solve(ring, alone, tol=1e-10).phasor[0], rel=1e-4
        )


def test_lines_of_an_amplitude_modulated_carrier_are_not_counted_twice():
    lines = Lines.of((Tone(1, 1.0), Tone(1, 0.99), Tone(1, 1.01)))
    assert lines.omega[:3] == pytest.approx([1.0, 0.99, 1.01])
    assert np.diff(np.sort(lines.omega)).min() == pytest.approx(0.01)
    assert lines.place(1, 0, 0) == 0
    assert lines.place(9, 9, 9) is None


def test_auto_refines_two_tones_by_harmonic_balance():
    chain = Chain(2, 0.05, -1.0)
    setting = Setting.of(chain, epsilon=0.005, lam=0.1, omega=0.95)
    terms = Terms(tones=(Tone(0.005, 0.95), Tone(0.01, 1.1, 0.5)))
    sharp = solve_with_terms(chain, setting, terms, tol=1e-6, rung="auto", start=Start.REST)
    whole = solve_with_terms(chain, setting, terms, tol=1e-5, rung="ode", start=Start.REST)
    assert (sharp.rung, sharp.stable, whole.rung) == ("harmonic_balance", True, "ode")
    assert sharp.outcome is whole.outcome is Outcome.OK
    for k in ((1, 0), (0, 1), (2, -1), (-1, 2)):
        mine, other = (each.amplitude[each.lines.place(*k)] for each in (sharp, whole))
        assert np.abs(mine - other).max() < 1e-5 * np.abs(sharp.amplitude).max()


@pytest.mark.parametrize(
    ("chain", "setting", "outcome"),
    [
        ({"beta": -1.0}, {"epsilon": 5.0}, Outcome.ESCAPED),
        ({"beta": 1.0}, {"epsilon": 1e12}, Outcome.NO_CONVERGENCE),
        ({"beta": -1e12}, {"epsilon": 1e-8}, Outcome.OK),
        ({"delta": 1e-12}, {}, Outcome.OUT_OF_BUDGET),
        ({"delta": 1e6}, {}, Outcome.OUT_OF_BUDGET),
        ({}, {"omega": 1e-6}, Outcome.OUT_OF_BUDGET),
        ({}, {"omega": 1e6}, Outcome.OUT_OF_BUDGET),
        ({}, {"lam": 1e4}, Outcome.OK),
        ({}, {"epsilon": 0.0}, Outcome.OK),
        ({"n": 1}, {"lam": 0.0}, Outcome.OK),
    ],
)
def test_extremes_end_in_an_outcome(chain, setting, outcome):
    built = Chain.of(**{"n": 2, "delta": 0.1, "beta": -1.0, "closure": "bidirectional", **chain})
    asked = Setting.of(built, **{"epsilon": 0.01, "lam": 0.1, "omega": 1.1, **setting})
    found = steady_with_terms(built, asked, Terms(), tol=1e-5, start=Start.REST)
    assert found.outcome is outcome
    assert np.isfinite(found.amplitude).all() == (outcome is Outcome.OK)


@pytest.mark.parametrize(
    "terms",
    [
        Terms(hysteresis=BoucWen(0.3, 60.0, 20.0)),
        Terms(hysteresis=Play((1e-3, 4e-3), (0.2, 0.2), 0.6)),
        Terms(amplifier=AmplifierDynamics(2.0, slew=8e-3, limit=1e-2)),
    ],
    ids=["bouc_wen", "play", "amplifier"],
)
def test_the_error_estimate_covers_the_error(terms):
    rng, found = np.random.default_rng(5), 0
    for closure in [*Closure] * 2:
        chain = Chain(3, float(rng.uniform(0.03, 0.1)), -1.0, closure)
        place = {"epsilon": rng.uniform(1e-3, 1e-2), "lam": rng.uniform(0.01, 0.1), "omega": rng.uniform(1.0, 1.3)}
        rough, fine = (
            steady_with_terms(chain, Setting.of(chain, **place), terms, tol=tol, start=Start.REST)
            for tol in (1e-3, 3e-5)
        )
        if rough.outcome is Outcome.OK and np.isfinite(fine.error_estimate):
            size = np.abs(fine.amplitude[0]).max()
            assert np.abs(rough.amplitude - fine.amplitude).max() <= rough.error_estimate * size
            found += 1
    assert found >= 4


TWO = Terms(tones=(Tone(0.01, 0.95), Tone(0.01, 1.1)))


@pytest.mark.parametrize(
    ("chain", "terms", "rung", "start", "words"),
    [
        (CHAINS["ring"], TWO, "harmonic_balance", "rest", "not carry two tones of a ring chain; use rung ode or auto"),
        (CHAINS["grid"], TWO, "harmonic_balance", "rest", "not carry two tones of a grid"),
        (CHAINS["open"], replace(TWO, creep=SLOW), "harmonic_balance", "rest", "not carry creep with several tones"),
        (CHAINS["open"], Terms(hysteresis=BoucWen(0, 1, 0)), "harmonic_balance", "rest", "not carry hysteresis; use"),
        (
            CHAINS["open"],
            Terms(amplifier=AmplifierDynamics(1, 1)),
            "harmonic_balance",
            "rest",
            "an amplifier that slews",
        ),
        (CHAINS["open"], Terms(creep=SLOW), "linear", "rest", "does not carry creep; use rung ode or auto"),
        (CHAINS["open"], TWO, "auto", "all", "start all: branches are listed without terms"),
        (Chain(1, 0.0, -1.0), TWO, "ode", "rest", "without damping nothing settles"),
    ],
)
def test_refusals_name_the_term_and_the_cure(chain, terms, rung, start, words):
    with pytest.raises(RungError, match=words):
        solve_with_terms(chain, setting_of(chain), terms, tol=1e-4, rung=rung, start=Start(start))
