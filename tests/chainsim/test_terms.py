"""Every term against a closed form or an integration of its own."""

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from chainsim import Chain, Closure, Outcome, Setting, load_device, solve
from chainsim.averaging.envelope import follow
from chainsim.effects.effects import (
    AmplifierDynamics,
    BoucWen,
    Creep,
    Mode,
    Play,
    Terms,
    TermsError,
    Tone,
    bending_modes,
    modulated,
)
from chainsim.effects.ode import integrate_terms
from chainsim.effects.tones import two_tones

DELTA = 5.3006e-3
ONE = Chain(1, 0.1, -1.0)


def run(chain, terms=None, *, duration=300.0, step=0.05, every=4, **setting):
    values = {"epsilon": 0.0, "lam": 0.0, "omega": 1.0, **setting}
    return integrate_terms(
        chain, Setting.of(chain, **values), terms or Terms(), duration=duration, step=step, every=every
    )  # fmt: skip


def test_without_terms_it_is_the_plain_chain_to_fourth_order():
    chain = Chain(3, 0.05, -1.0, Closure.RING)
    lam = np.array([0.02, 0.05, 0.03])

    def slope(tau, y):
        z, v = y[:3], y[3:]
        pull = lam * (np.roll(z, 1) - z) - chain.delta * v - z - chain.beta * z**3
        pull[0] += 0.02 * np.cos(1.1 * tau + 0.3) + 0.05
        return np.concatenate([v, pull + np.array([0, 0.01, 0])])

    truth = solve_ivp(slope, (0, 40), np.zeros(6), method="DOP853", rtol=1e-12, atol=1e-14).y[:3, -1]
    setting = {"epsilon": 0.02, "lam": lam, "omega": 1.1, "phase": 0.3, "preload": 0.05, "bias": [0, 0.01, 0]}
    errors = [np.abs(run(chain, duration=40.0, step=h, every=1, **setting).tip[-1] - truth).max() for h in (0.2, 0.1)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.3)


def played(e, radius):
    """The play operator over samples, one after the other."""
    out, p = np.empty(len(e)), 0.0
    for k, value in enumerate(e):
        p = min(max(p, value - radius), value + radius)
        out[k] = p
    return out


def test_play_operators_act_as_their_definition_in_a_slow_drive():
    plays = Play(radius=(0.0, 0.002, 0.006), weight=(0.3, 0.4, 0.2), base=0.1)
    chain, omega, top = Chain(1, 0.5, 0.0), 1e-3, 0.01
    motion = run(chain, Terms(hysteresis=plays), epsilon=top, omega=omega, duration=13000.0, step=0.2)
    e = top * np.cos(omega * motion.tau)
    wanted = 0.1 * e + sum(w * played(e, r) for r, w in zip(plays.radius, plays.weight, strict=True))
    late = motion.tau > 100
    assert np.abs(motion.tip[late, 0] - wanted[late]).max() < 2e-3 * top
    # A loop of play r under a swing of +-E encloses 4 r (E - r).
    cycle = motion.tau > motion.tau[-1] - 2 * np.pi / omega
    area = abs(np.trapezoid(motion.tip[cycle, 0], e[cycle]))
    loops = sum(4 * w * r * (top - r) for r, w in zip(plays.radius, plays.weight, strict=True))
    # Damping gives the linear part an area of its own, pi delta omega E^2.
    assert area == pytest.approx(loops + math.pi * 0.5 * omega * top**2, rel=0.02)


def test_play_operators_converge_with_the_second_order():
    plays = Terms(hysteresis=Play(radius=(0.004,), weight=(0.5,), base=0.5))
    ends = [run(ONE, plays, epsilon=0.02, duration=60.0, step=h, every=1).tip[-1, 0] for h in (0.1, 0.05, 0.025, 1e-3)]
    errors = np.abs(np.array(ends[:3]) - ends[3])
    assert np.polyfit(np.arange(3), np.log2(errors), 1)[0] == pytest.approx(-2, abs=0.7)


def test_bouc_wen_against_an_integration_of_its_own():
    model = BoucWen(gain=0.4, loading=60.0, unloading=20.0)

    def slope(tau, y):
        z, v, h = y
        e, change = 0.02 * math.cos(0.9 * tau), -0.018 * math.sin(0.9 * tau)
        rate = 0.4 * change - 60 * abs(change) * h - 20 * change * abs(h)
        return [v, e - h - 0.1 * v - z + z**3, rate]

    truth = solve_ivp(slope, (0, 100), np.zeros(3), method="DOP853", rtol=1e-11, atol=1e-13, max_step=0.05)
    motion = run(ONE, Terms(hysteresis=model), epsilon=0.02, omega=0.9, duration=100.0, step=0.01)
    assert motion.tip[-1, 0] == pytest.approx(truth.y[0, -1], rel=1e-5)
    assert np.abs(truth.y[2]).max() <= 0.4 / 80


@settings(max_examples=5)
@given(st.floats(0.005, 0.1), st.integers(1, 3))
def test_creep_grows_alike_in_every_decade(per_decade, each):
    creep = Creep(per_decade=per_decade, first=50.0, last=5e5, each=each)
    chain, force = Chain(1, 0.3, 0.0), 0.01
    motion = run(chain, Terms(creep=creep), bias=force, duration=1.2e5, step=0.5, every=20)
    at = np.interp([2e2, 2e3, 2e4], motion.tau, motion.tip[:, 0]) / force
    assert np.diff(at) == pytest.approx([per_decade] * 2, rel=0.12)
    assert at[0] > 1


def test_the_papers_creep_takes_a_hundred_seconds():
    device = load_device("paper-6x6")
    creep = Creep(per_decade=0.02, first=0.1 * device.tau_per_s, last=100 * device.tau_per_s, each=2)
    assert creep.times[-1] / device.tau_per_s == pytest.approx(100)
    assert len(creep.times) == 7


def test_higher_modes_add_their_linear_response():
    modes = bending_modes(133.13, (661.03, 1258.3), delta=0.05)
    assert [mode.omega for mode in modes] == pytest.approx([4.9653, 9.4517], abs=1e-4)
    chain = Chain(2, 0.05, 0.0)
    motion = run(chain, Terms(modes=modes), epsilon=1.0, lam=0.1, omega=1.3, duration=800.0, step=0.02, every=5)
    tip = 1 / (1 - 1.69 + 0.065j) + sum(m.gain / (m.omega**2 - 1.69 + 1.3j * m.delta) for m in modes)
    second = 0.1 * tip / (1 / tip + 0.1)
    assert motion.line(1.3, since=600.0) == pytest.approx([tip, second], rel=1e-5)


def test_the_modes_shares_are_those_of_a_cantilever_under_an_end_moment():
    """The tip deflection M L^2/(2 E I) is the sum over modes of phi(L) phi'(L) L/beta^4 with phi(L)^2 = 4."""
    roots = np.array([1.8751041, *((np.arange(1, 7) + 0.5) * np.pi)])
    modes = bending_modes(1.0, (roots[1:] / roots[0]) ** 2, delta=0.01)
    shares = np.array([1.0, *(mode.gain for mode in modes)])
    assert 4 * 1.3765 * np.sum(shares / roots**4) == pytest.approx(0.5, abs=2e-3)


def test_a_slow_amplifier_filters():
    terms = Terms(amplifier=AmplifierDynamics(bandwidth=0.7))
    motion = run(Chain(1, 0.1, 0.0), terms, epsilon=0.3, omega=1.2, duration=300.0)
    wanted = 0.3 / (1 + 1.2j / 0.7) / (1 - 1.44 + 0.12j)
    assert motion.line(1.2, since=200.0)[0] == pytest.approx(wanted, rel=1e-5)


def test_a_limited_amplifier_clips():
    terms = Terms(amplifier=AmplifierDynamics(bandwidth=50.0, limit=0.5))
    motion = run(Chain(1, 0.1, 0.0), terms, epsilon=1.0, omega=1.0, duration=300.0, step=0.01)
    clipped = 2 / np.pi * (math.asin(0.5) + 0.5 * math.sqrt(0.75))
    assert abs(motion.line(1.0, since=200.0)[0]) == pytest.approx(clipped / 0.1, rel=2e-3)


def test_a_slewing_amplifier_makes_triangles():
    terms = Terms(amplifier=AmplifierDynamics(bandwidth=50.0, slew=0.1))
    motion = run(Chain(1, 0.1, 0.0), terms, epsilon=1.0, omega=1.0, duration=300.0, step=0.01)
    triangle = 8 / np.pi**2 * (0.1 * np.pi / 2)
    assert abs(motion.line(1.0, since=200.0)[0]) == pytest.approx(triangle / 0.1, rel=1e-2)


def test_a_modulated_carrier_is_three_tones():
    tau = np.linspace(0, 100, 1000)
    tones = modulated(Tone(0.3, 1.01, 0.4), depth=0.6, omega=0.05)
    product = 0.3 * (1 + 0.6 * np.cos(0.05 * tau)) * np.cos(1.01 * tau + 0.4)
    assert sum(t.epsilon * np.cos(t.omega * tau + t.phase) for t in tones) == pytest.approx(product)


def test_the_ultrasonic_device_carries_a_tactile_modulation():
    device = load_device("ultrasonic-6x6")
    assert device.f0_hz == 40_000
    assert all(note.why for note in device.notes.values())
    chain, beat = Chain(2, device.delta, device.beta), 200.0 / device.f0_hz
    setting = Setting.of(chain, epsilon=1e-5, lam=0.004, omega=1.0)
    tones = modulated(Tone(1e-5, 1.0), depth=0.5, omega=beat)
    span = 2 * np.pi / beat
    full = integrate_terms(
        chain, setting, Terms(tones=tones), duration=6 * span, step=2 * np.pi / 64, every=2
    )  # fmt: skip
    knots = np.linspace(0, 6 * span, 241)
    trace = follow(chain, setting, knots, tol=1e-5, epsilon=1e-5 * (1 + 0.5 * np.cos(beat * knots)))
    felt = np.abs(trace.phasor[-41:, 0])
    rows = np.array([full.tip[abs(full.tau - at) < np.pi].max(axis=0) for at in knots[-41:-1]])
    assert rows == pytest.approx(felt[:-1], rel=0.02)
    # Modulation of the first: each sideband passes as 1/(1 + i beat/(delta/2)).
    depth = np.ptp(felt[:, 0]) / (felt[:, 0].max() + felt[:, 0].min())
    assert depth / 0.5 == pytest.approx(1 / abs(1 + 2j * beat / device.delta), rel=0.03)


def bars():
    """The physics note's two tones of unit gain at lags of 60 and 120 degrees, amplitude 0.01 each."""
    chain, a, lags = Chain(6, DELTA, -1.0), 0.01, np.radians([60.0, 120.0])
    lam = DELTA / math.sin(lags[0])
    omegas = np.sqrt(1 - 2.25 * a * a + lam * (1 - np.cos(lags)))
    impedance = 1 - omegas**2 - 2.25 * a * a + 1j * DELTA * omegas
    tones = tuple(
        Tone(a * abs(z), float(w), float(np.angle(z))) for z, w in zip(impedance, omegas, strict=True)
    )  # fmt: skip
    return chain, Setting.of(chain, epsilon=0, lam=lam, omega=1.0), tones


def test_two_tones_of_unit_gain_make_walking_bars():
    chain, setting, tones = bars()
    found = two_tones(chain, setting, tones, order=3)
    assert found.outcome is Outcome.OK
    assert found.error_estimate < 1e-5
    for line, lag in (((1, 0), -60), ((0, 1), -120)):
        phasor = found.line(*line)
        assert np.abs(phasor) == pytest.approx(0.01, rel=0.02)
        assert np.degrees(np.angle(phasor[1:] / phasor[:-1])) == pytest.approx(lag, abs=1.5)
    beat_hz = 133.13 * abs(tones[0].omega - tones[1].omega)
    assert beat_hz == pytest.approx(0.41, abs=0.01)


def test_two_tones_agree_with_the_integration():
    chain, omegas = Chain(2, 0.05, -1.0), (0.95, 1.1)
    tones = Tone(0.01, omegas[0]), Tone(0.02, omegas[1], 0.5)
    setting = Setting.of(chain, epsilon=0, lam=0.1, omega=1.0)
    found = two_tones(chain, setting, tones, order=7)
    motion = integrate_terms(chain, setting, Terms(tones=tones), duration=900.0, step=0.02, every=10)
    late = motion.tau > 700
    away = np.abs(found.displacement(motion.tau[late]) - motion.tip[late]).max()
    assert away < 5e-6 * np.abs(motion.tip).max() + found.error_estimate * np.abs(found.harmonics).max()


def test_one_silent_tone_leaves_the_harmonic_balance():
    chain = Chain(2, 0.05, -1.0)
    setting = Setting.of(chain, epsilon=0.01, lam=0.1, omega=0.97)
    found = two_tones(chain, setting, (Tone(0.01, 0.97), Tone(0.0, 1.3)), order=5)
    wanted = solve(chain, setting, tol=1e-10, rung="harmonic_balance")
    assert found.line(1, 0) == pytest.approx(wanted.phasor[0], rel=1e-8)
    assert found.line(3, 0) == pytest.approx(wanted.third[0], rel=1e-5)
    assert np.abs(found.line(0, 1)).max() < 1e-15


@settings(max_examples=10)
@given(st.floats(1e-6, 1e6))
def test_beta_is_a_length_scale_for_two_tones(stretch):
    answers = []
    for beta in (-1.0, -stretch):
        size = 1 / math.sqrt(-beta)
        chain = Chain(2, 0.05, beta)
        tones = Tone(0.01 * size, 0.95), Tone(0.02 * size, 1.1)
        setting = Setting.of(chain, epsilon=0, lam=0.1, omega=1.0)
        answers.append(two_tones(chain, setting, tones, order=3).harmonics / size)
    assert answers[1] == pytest.approx(answers[0], rel=1e-9)


def test_too_strong_tones_escape_and_say_so():
    chain = Chain(1, 0.01, -1.0)
    setting = Setting.of(chain, epsilon=0, lam=0, omega=1.0)
    found = two_tones(chain, setting, (Tone(3.0, 0.9), Tone(3.0, 1.1)), order=3)
    assert found.outcome is Outcome.ESCAPED
    assert np.isnan(found.harmonics).all()


def test_a_hard_drive_escapes():
    motion = run(ONE, epsilon=3.0)
    assert motion.outcome is Outcome.ESCAPED
    assert np.isfinite(motion.tip).all()


def test_preload_and_bias_shift_the_rest():
    motion = run(Chain(1, 0.3, -1.0), preload=0.1, bias=0.05)
    assert motion.tip[-1, 0] - motion.tip[-1, 0] ** 3 == pytest.approx(0.15)


def test_no_compiler_is_imported_before_an_integration():
    names = "averaging.envelope, averaging.rung, continuation.path, continuation.locking, continuation.spectrum"
    names += ", effects.effects, effects.tones"
    loads = "; ".join(f"import chainsim.{name}" for name in names.split(", "))
    code = f"import sys; {loads}; print({{'numba', 'scipy', 'matplotlib'}} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "set()\n"


PAIR = Chain(2, 0.05, -1.0)
STILL = Setting.of(PAIR, epsilon=0, lam=0.1, omega=1.0)
GOOD = (Tone(0.1, 0.9), Tone(0.1, 1.1))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: BoucWen(0.1, 1.0, 2.0), "loading"),
        (lambda: Play((1.0,), (1.0, 2.0), 0.5), "weight"),
        (lambda: Play((-1.0,), (1.0,), 0.5), "radius"),
        (lambda: Creep(0.1, 10.0, 1.0), "last"),
        (lambda: Creep(0.1, 1.0, 10.0, each=0), "each"),
        (lambda: Mode(-1.0, 0.1, 1.0), "modes"),
        (lambda: AmplifierDynamics(math.inf), "bandwidth"),
        (lambda: AmplifierDynamics(1.0, slew=0.0), "slew"),
        (lambda: Tone(math.nan, 1.0), "tones"),
        (lambda: run(ONE, step=2.0), "step"),
        (lambda: run(ONE, duration=-1.0), "duration"),
        (lambda: run(ONE, epsilon=[0.1, 0.2]), "setting"),
        (lambda: two_tones(PAIR, STILL, GOOD, order=2), "order"),
        (lambda: two_tones(PAIR, STILL, (GOOD[0], GOOD[0]), order=3), "frequencies"),
        (lambda: two_tones(Chain(2, 0.05, -1.0, Closure.RING), STILL, GOOD, order=3), "open"),
        (lambda: two_tones(PAIR, STILL, GOOD, order=3).line(2, 0), "lines"),
    ],
)
def test_bad_values_are_named(call, words):
    with pytest.raises(TermsError, match=words):
        call()
