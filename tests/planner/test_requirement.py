"""What a scene requires: every estimate against the solved term, and what the selection leaves out and saves."""

import json
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from chainsim import (
    ActuatorSpread,
    Chain,
    Closure,
    Device,
    GridIntegrator,
    HigherMode,
    Outcome,
    Setting,
    Surroundings,
    load_device,
    solve,
    surroundings_of,
)
from chainsim.effects.effects import AmplifierDynamics, BoucWen, Creep, Mode, Terms, bending_modes
from chainsim.effects.ode import integrate_terms
from encoders import Frame, GridShape, Scene, TargetPattern, TextOptions, TextSource, encode_text
from planner import FramePlan, OperatingPoint, PointTone, RelativeSpread, plan_scene, spread_of
from planner.analysis.effects import Linearisation
from planner.analysis.requirement import Requirement, RequirementError, require
from planner.analysis.scene_effects import TERMS
from planner.transitions.check import Way
from tests.support.known import known

LINKED = load_device("linked-6x6")
NOTHING = Surroundings()


def device_of(n, *, rows=1, delta=0.03, beta=-1.0, **changes):
    profile = LINKED.as_dict() | {"rows": rows, "cols": n, "chain_length": n, "delta": delta, "beta": beta} | changes
    return Device.model_validate(profile)


def held(device, setting, *, phase=None):
    """The state a chain reaches from rest, or None."""
    response = solve(device.chain, setting, tol=1e-9, rung="auto", start="rest")
    if response.outcome[0] is not Outcome.OK:
        return None
    drive = complex(setting.epsilon[0] * np.exp(1j * setting.phase[0]))
    felt = response.phasor[0] if drive else np.zeros(device.chain_length, complex)
    return OperatingPoint(
        drive, setting.lam[0, 1:], float(setting.omega[0]), felt, mean=response.mean[0], bias=setting.bias[0],
        target=np.abs(felt + response.mean[0]) / device.full_scale, phase=phase,
    )  # fmt: skip


def frame_of(device, states, *, held_s=1.0, ramps=None, start_s=0.0):
    pattern = TargetPattern(np.zeros((device.rows, device.cols), complex))
    ramps = ramps or (None,) * len(states)
    return FramePlan(Frame(pattern, held_s), start_s, start_s, start_s + held_s, tuple(states), ramps)


def effects(device, states, around=NOTHING, *, tol=1e-3, **frame):
    found = require([frame_of(device, states, **frame)], device, around, tol=tol)
    return {term.name: term.effect for term in found.terms}


def terms_of(around, names, device):
    """The simulator's terms for those names."""
    loop = around.hysteresis / around.largest_loop if around.largest_loop < math.inf else 0.0
    first = around.creep_first_s * device.tau_per_s
    return Terms(
        hysteresis=BoucWen(around.hysteresis, 0.75 * loop, 0.25 * loop) if "hysteresis" in names else None,
        creep=Creep(around.creep_per_decade, first, 1e3 * first) if "creep" in names else None,
        modes=tuple(Mode(one.omega, one.delta, one.gain) for one in around.modes) if "higher modes" in names else None,
        amplifier=AmplifierDynamics(around.bandwidth_hz / device.f0_hz) if "amplifier dynamics" in names else None,
    )  # fmt: skip


def whole(device, states, around, names, factors):
    """All rows as one chain or grid, and its setting, with the terms of those names; `factors` of each stiffness."""
    n, rows = device.chain_length, device.rows
    beta = device.beta if "nonlinearity" in names else 0.0
    stiffness = factors if "spread" in names else 1.0
    chain = Chain.of(n * rows, delta=device.delta, beta=beta, stiffness=stiffness, rows=rows)
    (first, *others), row_lam = states, around.row_lam if "2-D coupling" in names else 0.0
    assert not any(state.epsilon for state in others)
    lam, bias = np.array([state.lam for state in states]), np.concatenate([state.bias for state in states])
    setting = Setting.of(
        chain, epsilon=abs(first.epsilon), phase=float(np.angle(first.epsilon)), lam=lam if rows > 1 else first.lam,
        omega=first.omega, bias=bias, preload=around.preload if "preload" in names else 0.0,
        lam_y=row_lam if rows > 1 else 0.0,
    )  # fmt: skip
    return chain, setting


def integrated(device, states, around, names, *, factors, duration):
    """Amplitudes or deflections from rest with the terms of those names, and the work; `factors` of each stiffness."""
    state = states[0]
    chain, setting = whole(device, states, around, names, factors)
    step = min(0.1, 0.9 * device.f0_hz / around.bandwidth_hz) if "amplifier dynamics" in names else 0.1
    terms = terms_of(around, names, device)
    motion = integrate_terms(chain, setting, terms, duration=duration, step=step, every=round(0.6 / step))
    if motion.outcome is not Outcome.OK:
        return np.full(chain.n, np.inf), motion.stats.rhs_evals
    if not state.moving:
        return np.abs(motion.tip[-1]), motion.stats.rhs_evals
    late = duration - 40 * math.pi / state.omega
    return np.abs(motion.line(state.omega, since=late)), motion.stats.rhs_evals


def setting_of(device, state, around):
    lam = state.lam[0] if device.coupling.closure is Closure.RING else state.lam
    return Setting.of(
        device.chain, epsilon=abs(state.epsilon), phase=float(np.angle(state.epsilon)), lam=lam, omega=state.omega,
        bias=state.bias, preload=around.preload,
    )  # fmt: skip


def random_scene(rng, shapes):
    """A device, its chains' states, and what acts beside; every size log-uniform.

    Of two rows both are deflected, or the upper one vibrates and the lower one rests.
    """
    while True:
        rows, n = shapes[rng.integers(len(shapes))]
        device = device_of(n, rows=rows, delta=float(rng.uniform(0.03, 0.08)), beta=float(rng.choice([-1.0, 0.5])))
        lam, omega = rng.uniform(0.0, 0.3, n - 1), float(rng.uniform(0.9, 1.3))
        if n == 1:
            lam = 0.0
        amplitude = 10 ** rng.uniform(-2.5, -1)
        if rng.random() < 0.3:
            bias = amplitude * rng.choice([0.0, 0.5, 1.0], (rows, n))
            bias[:, 0] = amplitude
            settings = [Setting.of(device.chain, epsilon=0.0, lam=lam, omega=1.0, bias=row) for row in bias]
        else:
            epsilon = amplitude * abs(1 - omega**2 + 1j * device.delta * omega)
            sizes = [epsilon, *[0.0] * (rows - 1)]
            settings = [Setting.of(device.chain, epsilon=one, lam=lam, omega=omega) for one in sizes]
        states = [held(device, setting) for setting in settings]
        if all(state is not None and np.abs(state.phasor + state.mean).max() < 0.3 for state in states):
            force = float(settings[0].epsilon[0] + amplitude)
            return device, states, random_surroundings(rng, device, force)


def random_surroundings(rng, device, force):
    def size(low, high):
        return float(10 ** rng.uniform(math.log10(low), math.log10(high)))

    return Surroundings(
        preload=size(1e-5, 1e-1), hysteresis=size(1e-6, 1e-1), saturation=force * size(1e-2, 10),
        creep_per_decade=size(1e-6, 1e-1), creep_first_s=size(10, 100) / device.tau_per_s,
        modes=(HigherMode(omega=4.965, delta=5 * device.delta, gain=size(1e-6, 3)),),
        bandwidth_hz=device.f0_hz * size(1, 50),
        spread=ActuatorSpread(frequency=size(1e-6, 1e-2)), row_lam=size(1e-6, 1e-1) if device.rows > 1 else 0.0,
    )  # fmt: skip


def left_out_matters(seed, shapes):
    """By how much, in units of the tolerance, and the evaluations with everything and with the selection."""
    rng = np.random.default_rng(seed)
    device, states, around = random_scene(rng, shapes)
    tol = float(10 ** rng.uniform(-3.5, -1))
    duration = 2 * (12 + 3 * device.chain_length) / device.delta
    frame = frame_of(device, states, held_s=duration / device.tau_per_s)
    found = require([frame], device, around, tol=tol)
    factors = (1 + around.spread.frequency * rng.standard_normal(device.chain_length * device.rows)) ** 2
    full, work = integrated(device, states, around, frozenset(TERMS), factors=factors, duration=duration)
    if found.included & {"hysteresis", "creep", "higher modes", "amplifier dynamics"}:
        kept, less = integrated(device, states, around, found.included, factors=factors, duration=duration)
    else:
        chain, setting = whole(device, states, around, found.included | {"nonlinearity"}, factors)
        answer = solve(chain, setting, tol=tol / 10, rung=found.rung, start="rest")
        kept = np.abs(answer.phasor[0] if states[0].moving else answer.mean[0])
        less = answer.stats.newton_steps + answer.stats.oscillators_solved
    scale = max(float(np.abs(state.phasor + state.mean).max()) for state in states)
    return float(np.abs(full - kept).max()) / scale / tol, work, less


SMALL = [(1, 1), (1, 2), (1, 3)]
LARGE = [(1, 6), (2, 3), (2, 6)]


def check_scenes(count, shapes):
    found = np.array([left_out_matters(seed, shapes) for seed in range(count)])
    assert np.mean(found[:, 0] <= 1) >= 0.99, np.flatnonzero(found[:, 0] > 1)
    # Something was left out that can be seen, and it saved work.
    assert np.median(found[:, 0]) > 1e-3
    assert found[:, 2].sum() < 0.8 * found[:, 1].sum()


def test_what_is_left_out_of_random_scenes_matters_less_than_the_tolerance():
    check_scenes(20, SMALL)


@pytest.mark.slow
def test_what_is_left_out_of_200_random_scenes_matters_less_than_the_tolerance():
    check_scenes(200, SMALL)


@pytest.mark.slow
def test_what_is_left_out_of_200_scenes_of_long_chains_and_coupled_rows_matters_less_than_the_tolerance():
    check_scenes(200, LARGE)


def vibrating(n=3, *, omega=1.2, lam=0.1, amplitude=0.08, device=None, phase=None):
    device = device or device_of(n)
    epsilon = amplitude * abs(1 - omega**2 + 1j * device.delta * omega)
    return device, held(device, Setting.of(device.chain, epsilon=epsilon, lam=lam, omega=omega), phase=phase)


def resting(bias):
    device = device_of(len(bias))
    return device, held(device, Setting.of(device.chain, epsilon=0.0, lam=0.1, omega=1.0, bias=bias))


def test_nonlinearity_is_what_the_linear_rung_is_off_by():
    device, state = vibrating()
    answer = solve(device.chain, setting_of(device, state, NOTHING), tol=1e-6, rung="linear", start="rest")
    off = np.abs(np.abs(answer.phasor[0]) - np.abs(state.phasor)).max() / np.abs(state.phasor).max()
    assert effects(device, [state])["nonlinearity"] == pytest.approx(off, rel=1e-9)
    phased = replace(state, phase=np.angle(state.phasor))
    turned = answer.phasor[0] * np.exp(-1j * np.angle(np.vdot(state.phasor, answer.phasor[0])))
    off = np.abs(turned - state.phasor).max() / np.abs(state.phasor).max()
    assert effects(device, [phased])["nonlinearity"] == pytest.approx(off, rel=1e-9)


@pytest.mark.parametrize("closure", ["open", "ring"])
def test_third_harmonic_is_what_one_harmonic_is_off_by(closure):
    coupling = {"closure": closure, "scope": "chain", "lam": {"min": 0.0, "max": 1.0}}
    device = device_of(3, coupling=coupling)
    device, state = vibrating(device=device, lam=0.02, omega=0.97)
    moved = Linearisation(device.chain, state).without_third()[0]
    setting = setting_of(device, state, NOTHING)
    if closure == "open":
        one = solve(device.chain, setting, tol=1e-3, rung="one_harmonic", start="rest").phasor[0]
        exact = solve(device.chain, setting, tol=1e-12, rung="harmonic_balance", start="rest").phasor[0]
        assert np.abs(moved - (one - exact)).max() < 0.1 * np.abs(one - exact).max()
    assert 0 < np.abs(moved).max() < 1e-4 * np.abs(state.phasor).max()


@pytest.mark.parametrize("closure", ["open", "ring"])
def test_a_small_force_moves_the_motion_as_the_simulator_says(closure):
    coupling = {"closure": closure, "scope": "chain", "lam": {"min": 0.0, "max": 1.0}}
    device, state = vibrating(device=device_of(3, coupling=coupling), lam=0.02, omega=0.95)
    standing = Linearisation(device.chain, state)
    setting = setting_of(device, state, NOTHING)
    more = Setting.of(device.chain, epsilon=1.001 * setting.epsilon, lam=state.lam[0], omega=setting.omega)
    before, after = (solve(device.chain, one, tol=1e-11, start="rest").phasor[0] for one in (setting, more))
    force = np.zeros(3, complex)
    force[0] = 1e-3 * state.epsilon
    assert standing.moved(standing.lines[0], force) == pytest.approx(after - before, rel=5e-3, abs=1e-9)


def told(spread):
    return ActuatorSpread(frequency=spread.f0, damping=spread.delta, beta=spread.beta, lam=spread.lam)


def test_a_fingertip_stiffens_damps_and_presses():
    """A linear chain under each alone: what is felt changes as the equations with it say."""
    device = device_of(3, beta=0.0)
    setting = Setting.of(device.chain, epsilon=0.004, lam=0.2, omega=1.1)
    state = held(device, setting)
    for name, value in (("touch_stiffness", 1e-4), ("touch_damping", 1e-4)):
        chain = Chain.of(
            3, beta=0.0, delta=device.delta + (value if name == "touch_damping" else 0.0),
            stiffness=1.0 + (value if name == "touch_stiffness" else 0.0),
        )  # fmt: skip
        touched = np.abs(solve(chain, setting, tol=1e-9, rung="auto", start="rest").phasor[0])
        off = np.abs(touched - np.abs(state.phasor)).max() / np.abs(state.phasor).max()
        estimate = effects(device, [state], Surroundings.model_validate({name: value}))["preload"]
        assert estimate / 2 == pytest.approx(off, rel=0.03)
    assert effects(device, [state])["preload"] == 0.0


def test_spread_is_what_draws_scatter_by():
    device, state = vibrating(amplitude=0.05, device=device_of(4, rows=1))
    for spread in (
        RelativeSpread(f0=1e-4),
        RelativeSpread(delta=1e-3),
        RelativeSpread(beta=1e-3),
        RelativeSpread(lam=1e-4),
    ):
        sigma = effects(device, [state], Surroundings(spread=told(spread)))["spread"] / 2
        report = spread_of(device, [state], spread, tolerance=1.0, threshold=0.5, count=4000)
        worst = report.error * device.full_scale / np.abs(state.phasor).max()
        # The worst of four actuators, of which one scatters most.
        assert 0.7 * sigma < worst.mean() < 1.7 * sigma


def test_coupled_rows_are_what_a_grid_does():
    device = device_of(3, rows=2)
    biases = np.array([[0.02, 0.05, 0.0], [0.04, 0.0, 0.03]])
    lam = np.array([[0.1, 0.1]] * 2)
    states = []
    for bias in biases:
        setting = Setting.of(device.chain, epsilon=0.0, lam=0.1, omega=1.0, bias=bias)
        states.append(held(device, setting))
    grid = Chain(6, device.delta, device.beta, Closure.OPEN, rows=2)
    setting = Setting.of(grid, epsilon=0.0, lam=lam, lam_y=1e-3, omega=1.0, bias=biases.ravel())
    whole = solve(grid, setting, tol=1e-10, rung="static", start="rest").mean[0].reshape(2, 3)
    alone = np.array([state.mean for state in states])
    off = np.abs(whole - alone).max() / alone.max()
    assert effects(device, states, Surroundings(row_lam=1e-3))["2-D coupling"] / 2 == pytest.approx(off, rel=0.02)


def test_a_resting_row_is_moved_by_the_one_above():
    device = device_of(3, rows=2)
    _, upper = vibrating(device=device)
    lower = held(device, Setting.of(device.chain, epsilon=0.0, lam=0.1, omega=upper.omega))
    grid = Chain(6, device.delta, device.beta, Closure.OPEN, rows=2)
    lam = np.array([upper.lam, lower.lam])
    setting = Setting.of(grid, epsilon=abs(upper.epsilon), lam=lam, lam_y=1e-3, omega=upper.omega)
    whole = np.abs(solve(grid, setting, tol=1e-10, rung="harmonic_balance", start="rest").phasor[0])
    off = whole[3:].max() / whole[:3].max()
    assert effects(device, [upper, lower], Surroundings(row_lam=1e-3))["2-D coupling"] / 2 == pytest.approx(
        off, rel=0.01
    )


@pytest.mark.parametrize("row", [[1, 0, 1, 1, 0, 0], [1, 1, 1, 1, 1, 1], [0, 0, 1, 0, 1, 0]])
def test_the_way_into_a_long_chain_lacks_no_more_than_is_said(row):
    dots = np.zeros((6, 6))
    dots[0] = row
    scene = Scene(GridShape(6, 6), (Frame(TargetPattern(dots.astype(complex)), 1.0),))
    frame = next(iter(plan_scene(scene, LINKED).frames))
    state, ramp = frame.states[0], frame.ramps[0]
    omega, rate = state.omega, LINKED.tau_per_s
    assert ramp is not None
    drive, slope = known(ramp.epsilon), known(ramp.epsilon_slope) / rate
    way = Way(ramp.t_s * rate, drive, slope, known(ramp.lam_t_s) * rate, known(ramp.lam))
    dtau = 2 * math.pi / omega / 64
    tau = dtau * np.arange(64 * math.ceil(frame.settled_s * rate / dtau / 64), dtype=np.float64)
    carrier = np.exp(1j * omega * tau)
    force, lam = np.zeros((len(tau), 1, 6)), np.zeros((len(tau), 1, 6))
    force[:, 0, 0], lam[:, 0, 1:] = (way.drive(tau)[0] * carrier).real, way.links(tau)
    grid = GridIntegrator(shape=(1, 6), chain_length=6, delta=LINKED.delta, beta=LINKED.beta, ring=False, dtau=dtau)
    z = grid.advance(force, lam).reshape(-1, 64, 6)
    felt = 2 * np.abs((z * carrier.reshape(-1, 64, 1).conj()).mean(axis=1))
    lacks = np.maximum(np.abs(state.phasor) - felt, 0.0).sum(axis=0) * 64 * dtau / rate / (frame.end_s - frame.start_s)
    share = lacks.max() / np.abs(state.phasor).max()
    said = require([frame], LINKED, NOTHING, tol=1e-3)["transients"].effect
    assert share <= said <= 3 * share


def test_the_way_in_counts_for_half_of_its_time():
    device = load_device("paper-6x6")
    scene = encode_text(TextSource.of_text("a"), GridShape(6, 6), TextOptions(dwell_s=1.0))
    frame = next(iter(plan_scene(scene, device).frames))
    at, ramp = next((i, ramp) for i, ramp in enumerate(frame.ramps) if ramp is not None)
    lacking = 1 - known(ramp.bias) @ frame.states[at].bias / (frame.states[at].bias @ frame.states[at].bias)
    mean = np.trapezoid(lacking, ramp.t_s) / (frame.end_s - frame.start_s)
    found = require([frame], device, NOTHING, tol=1e-3)
    assert found["transients"].effect / 2 == pytest.approx(mean, rel=0.02)
    assert found["transients"].cost == 0
    assert found.rung == "static"


def test_tones_and_what_they_add_up_to():
    device, first = vibrating(amplitude=0.03, lam=0.05, omega=0.95)
    _, second = vibrating(amplitude=0.03, lam=0.05, omega=1.12)
    both = replace(first, tones=(PointTone(second.omega, second.epsilon, second.phasor),))
    standing = Linearisation(device.chain, both)
    assert standing.size == pytest.approx(np.abs(first.phasor) + np.abs(second.phasor))
    for change, state in zip(standing.without_cubic(), (first, second), strict=True):
        linear = solve(device.chain, setting_of(device, state, NOTHING), tol=1e-6, rung="linear", start="rest")
        assert change == pytest.approx(linear.phasor[0] - state.phasor, abs=1e-12)
    assert effects(device, [both])["third harmonic"] > effects(device, [first])["third harmonic"]


def test_an_amplifier_only_turns_what_all_actuators_share():
    device, state = vibrating(amplitude=1e-3)
    around = Surroundings(bandwidth_hz=20 * device.f0_hz)
    loss = 1 - 1 / math.sqrt(1 + (state.omega / 20) ** 2)
    assert effects(device, [state], around)["amplifier dynamics"] / 2 == pytest.approx(loss, rel=0.02)
    phased = replace(state, phase=np.angle(state.phasor))
    assert effects(device, [phased], around)["amplifier dynamics"] / 2 == pytest.approx(loss, rel=0.02)


def test_nothing_around_and_nothing_shown_require_nothing():
    device, state = resting([0.0, 0.0, 0.0])
    found = require([frame_of(device, [state])], device, surroundings_of(device), tol=1e-9)
    assert found.included == frozenset()
    assert found.left_out == 0.0


def test_what_is_assumed_is_the_papers_beam():
    modes = bending_modes(133.13, (661.03, 1258.3), delta=LINKED.delta)
    for ours, theirs in zip(surroundings_of(LINKED).modes, modes, strict=True):
        assert (ours.omega, ours.delta, ours.gain) == pytest.approx((theirs.omega, theirs.delta, theirs.gain), rel=1e-4)


def test_the_selection_is_monotone_in_the_tolerance():
    device, state = vibrating()
    frame = frame_of(device, [state])
    found = [require([frame], device, surroundings_of(device), tol=tol) for tol in (1e-6, 1e-4, 1e-2, 1.0, 1e3)]
    for strict, loose in pairwise(found):
        assert loose.included <= strict.included
        assert loose.work <= strict.work <= strict.work_of_all
    assert all(one.left_out <= one.tol for one in found)
    assert [one.rung for one in found][-1] == "linear"
    assert found[0].rung == "harmonic_balance"


def test_the_table_names_every_term_and_is_plain_json():
    device, state = vibrating()
    found = require([frame_of(device, [state])], device, surroundings_of(device), tol=1e-2)
    assert isinstance(found, Requirement)
    text = found.as_text()
    assert all(f"{name} " in text for name in TERMS)
    assert json.loads(json.dumps(found.as_dict()))["rung"] == found.rung


def test_complaints():
    device, state = vibrating()
    with pytest.raises(RequirementError, match="tol: expected a number > 0, got 0"):
        require([frame_of(device, [state])], device, NOTHING, tol=0.0)
    with pytest.raises(RequirementError, match="at least one frame"):
        require([], device, NOTHING, tol=0.1)
    with pytest.raises(KeyError, match="friction"):
        require([frame_of(device, [state])], device, NOTHING, tol=0.1)["friction"]
