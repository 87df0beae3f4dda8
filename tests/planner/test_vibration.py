"""Patterns held by vibration: every on/off row, the ways between them, and what devices cannot do."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from chainsim import Device, Outcome, Span, load_device
from planner import OperatingPoint, Ramp
from planner.amplitudes.vibration import Vibration
from planner.families import family_of, row_of
from planner.targets import AmplitudeTarget
from tests.support.known import known

LINKED = load_device("linked-6x6")
SINGLE = load_device("independent-6x6")
ROWS = np.array(list(product((0.0, 1.0), repeat=6)))
Floats = NDArray[np.float64]


def vibration(device: Device = LINKED, contrast_db: float = 20.0) -> Vibration:
    family = family_of(row_of(AmplitudeTarget, device), device, contrast_db)
    assert isinstance(family, Vibration)
    return family


def standing(family: Vibration) -> list[OperatingPoint]:
    """All 64 rows as a chain holds them that has moved before."""
    return family.states(np.array([family.levels(row, True) for row in ROWS]))


@pytest.fixture(scope="module")
def family() -> Vibration:
    return vibration()


@pytest.fixture(scope="module")
def states(family: Vibration) -> list[OperatingPoint]:
    return standing(family)


def test_all_rows_are_held(states: list[OperatingPoint]) -> None:
    for row, state in zip(ROWS, states, strict=True):
        assert state.outcome is Outcome.OK
        assert state.error < 1e-7
        felt = np.abs(state.phasor) / LINKED.full_scale
        np.testing.assert_allclose(felt, state.target, atol=1e-7)
        np.testing.assert_array_equal(state.target[row == 1], 1.0)
        assert np.all(state.lam >= LINKED.coupling.lam.min)
        assert np.all(state.lam <= LINKED.coupling.lam.max)
        assert not state.bias.any()
        assert LINKED.omega.min <= state.omega <= LINKED.omega.max


def test_margins_are_sane(states: list[OperatingPoint]) -> None:
    for state in states:
        assert state.margins.volts == pytest.approx(abs(state.epsilon) / LINKED.epsilon_max)
        assert 0 < state.margins.volts < 0.51
        assert state.margins.well == pytest.approx(LINKED.full_scale * state.target.max(), rel=1e-6)
        assert 1 < state.margins.noise_gain < 1e12


@pytest.mark.parametrize("contrast_db", [10.0, 20.0, 26.0])
def test_contrast_is_honoured_or_what_is_lacking_is_said(contrast_db: float) -> None:
    family = vibration(contrast_db=contrast_db)
    assert family.band.lacking == ""
    for row, state in zip(ROWS, standing(family), strict=True):
        assert state.outcome is (Outcome.UNREACHABLE if family.band.lacking else Outcome.OK)
        felt = np.abs(state.phasor) / LINKED.full_scale
        assert np.all(felt[row == 0] <= 10 ** (-contrast_db / 20) * (1 + 1e-6))
        # An idle floor, not silence: nothing would pass a resting actuator.
        assert np.all(felt > 0)
    if family.band.lacking:
        assert family.band.lacking in family.note()


def test_a_chain_rests_until_its_first_dot(family: Vibration) -> None:
    np.testing.assert_array_equal(family.levels(np.zeros(6), False), 0.0)
    first = family.levels(np.array([0, 1.0, 0, 0, 0, 0]), False)
    assert np.all(first > 0)
    assert first[1] == 1
    after = family.levels(np.zeros(6), True)
    assert np.all((after > 0) & (after <= family.band.floor))


def test_rest_is_silence(family: Vibration) -> None:
    (rest,) = family.states(np.zeros((1, 6)))
    assert rest.outcome is Outcome.OK
    assert rest.epsilon == 0
    assert rest.error == 0
    assert not rest.phasor.any()


def test_states_do_not_depend_on_their_company(family: Vibration, states: list[OperatingPoint]) -> None:
    for index in (1, 22, 63):
        (alone,) = family.states(states[index].target[None])
        np.testing.assert_allclose(alone.lam, states[index].lam, rtol=1e-7)
        assert alone.epsilon == pytest.approx(states[index].epsilon, rel=1e-7)


def check_ramp(ramp: Ramp | None, before: OperatingPoint, after: OperatingPoint) -> None:
    """A ramp within the device that begins and ends in the states; a chain at rest takes any links."""
    assert ramp is not None
    epsilon, slope, lam, lam_t_s = known(ramp.epsilon), known(ramp.epsilon_slope), known(ramp.lam), known(ramp.lam_t_s)
    assert ramp.lacking == ""
    assert ramp.duration_s <= 0.35
    assert ramp.t_s[0] == 0
    assert np.abs(epsilon).max() <= LINKED.epsilon_max
    assert lam_t_s[0] == 0
    assert lam_t_s[-1] == pytest.approx(ramp.duration_s, rel=1e-14)
    allowed = LINKED.coupling.lam
    assert np.all((lam >= allowed.min) & (lam <= allowed.max))
    for node, state in ((0, before), (-1, after)):
        assert epsilon[node] == pytest.approx(state.epsilon, rel=1e-13, abs=1e-15)
        assert abs(slope[node]) < 1e-4 * np.abs(slope).max()
        if state.phasor.any():
            np.testing.assert_allclose(lam[node], state.lam, rtol=1e-13)


def test_two_hundred_changes(family: Vibration, states: list[OperatingPoint]) -> None:
    rng = np.random.default_rng(11)
    before, after = ([states[i] for i in rng.integers(0, 64, 200)] for _ in range(2))
    for one, other, ramp in zip(before, after, family.ramps(before, after), strict=True):
        if one is other:
            assert ramp is None
        else:
            check_ramp(ramp, one, other)


def test_the_way_in_and_out_of_every_row(family: Vibration, states: list[OperatingPoint]) -> None:
    rest = family.states(np.zeros((64, 6)))
    for state, way_in, way_out in zip(states, family.ramps(rest, states), family.ramps(states, rest), strict=True):
        check_ramp(way_in, rest[0], state)
        check_ramp(way_out, state, rest[0])
        assert np.ptp(known(known(way_in).lam), axis=0).max() < 0.02
    assert family.ramps(rest[:1], rest[:1]) == [None]


def test_slopes_are_the_derivatives(family: Vibration, states: list[OperatingPoint]) -> None:
    (rest,) = family.states(np.zeros((1, 6)))
    for ramp in map(known, family.ramps([states[37], rest], [states[22], states[37]])):
        middle = np.arange(2, len(ramp.t_s) - 2)
        e, step = known(ramp.epsilon), ramp.t_s[1]
        numeric = (8 * (e[middle + 1] - e[middle - 1]) - (e[middle + 2] - e[middle - 2])) / (12 * step)
        np.testing.assert_allclose(known(ramp.epsilon_slope)[middle], numeric, atol=2e-3 * np.abs(numeric).max())


def integrated(
    device: Device, omega: float, ramps: list[Ramp | None], *, stands_s: float, rtol: float
) -> list[NDArray[np.complex128]]:
    """First harmonics under the full equations over each stand, after ramps that follow one another.

    As `Ramp` says: the drive is cubic Hermite between nodes, links are straight between theirs.
    """
    n, scale = device.chain_length, device.tau_per_s
    state, begin, felt = np.zeros(2 * n), 0.0, []
    for ramp in map(known, ramps):
        drive = CubicHermiteSpline(ramp.t_s * scale, ramp.epsilon, known(ramp.epsilon_slope) / scale)
        length = ramp.duration_s * scale

        def slope(
            tau: float, state: Floats, ramp: Ramp = ramp, drive: CubicHermiteSpline = drive, begin: float = begin,
            length: float = length,
        ) -> Floats:  # fmt: skip
            z, at = state[:n], min(tau - begin, length)
            out = np.concatenate([state[n:], -device.delta * state[n:] - z - device.beta * z**3])
            out[n] += (complex(drive(at)) * np.exp(1j * omega * tau)).real
            if n > 1:
                lam = known(ramp.lam)
                k = min(int(at / length * (len(lam) - 1)), len(lam) - 2)
                part = at / length * (len(lam) - 1) - k
                out[n + 1 :] += ((1 - part) * lam[k] + part * lam[k + 1]) * (z[:-1] - z[1:])
            return out

        periods = int(stands_s * scale * omega / (2 * np.pi))
        points = begin + length + 2 * np.pi / omega * np.arange(32 * periods + 1) / 32
        ran = solve_ivp(
            slope, (begin, points[-1]), state, "DOP853", t_eval=points, rtol=rtol, atol=1e-4 * rtol, max_step=2.0
        )
        turned = ran.y[:n, :-1] * np.exp(-1j * omega * points[:-1])
        felt.append(2 * turned.reshape(n, periods, 32).mean(axis=2).T)
        state, begin = ran.y[:, -1], float(points[-1])
    return felt


@pytest.mark.parametrize(
    ("rows", "rtol"),
    [((0b110011, 0b010101, 0b101110), 1e-9), ((0b111110, 0b111111), 1e-12)],
    ids=["mixed", "full"],
)
def test_a_short_story_under_the_full_equations(
    rows: tuple[int, ...], rtol: float, family: Vibration, states: list[OperatingPoint]
) -> None:
    """Rest, patterns, rest: patterns within 2 % of full scale from the first period on, silence below the floor.

    Six raised dots alike magnify noise a billion times, that of an integrator too: hence its tolerance.
    """
    (rest,) = family.states(np.zeros((1, 6)))
    told = [rest, *(states[row] for row in rows), rest]
    felt = integrated(LINKED, family.band.omega, family.ramps(told[:-1], told[1:]), stands_s=0.05, rtol=rtol)
    for state, phasors in zip(told[1:], felt, strict=True):
        off = np.abs(phasors) / LINKED.full_scale - state.target
        assert np.abs(off).max() < (0.02 if state.target.any() else 0.05)


def test_a_single_actuator_under_the_full_equations() -> None:
    family = vibration(SINGLE)
    off, half, on = family.states(np.array([[0.0], [0.5], [1.0]]))
    told = [off, on, half, off, on]
    felt = integrated(SINGLE, family.band.omega, family.ramps(told[:-1], told[1:]), stands_s=0.1, rtol=1e-9)
    for state, phasors in zip(told[1:], felt, strict=True):
        np.testing.assert_allclose(np.abs(phasors) / SINGLE.full_scale, state.target[0], atol=2e-3)


def test_single_actuators_are_silent_or_on() -> None:
    family = vibration(SINGLE)
    off, on = family.states(np.array([[0.0], [1.0]]))
    np.testing.assert_array_equal(family.levels(np.zeros(1), True), 0.0)
    assert off.outcome is on.outcome is Outcome.OK
    assert off.epsilon == 0
    assert abs(on.phasor[0]) == pytest.approx(SINGLE.full_scale, rel=1e-7)
    ramp, none = family.ramps([off, on], [on, on])
    assert none is None
    assert ramp is not None
    assert ramp.lam is None
    assert ramp.lam_t_s is None


def weak(**changes: object) -> Vibration:
    return vibration(LINKED.model_copy(update=changes))


@pytest.mark.parametrize("high", [1.0, 1.1, 1.2])
def test_patterns_out_of_reach_are_said_to_be(high: float) -> None:
    """Without detuning some profiles have no links at all; they are unreachable too, and their ways are sound."""
    family = weak(omega=Span(min=0.9, max=high))
    states = standing(family)
    assert {state.outcome for state in states} == {Outcome.UNREACHABLE}
    for state in states:
        for array in (state.lam, state.phasor, state.bias, state.mean):
            assert np.all(np.isfinite(array))
        assert state.error == pytest.approx(
            np.abs(np.abs(state.phasor) / LINKED.full_scale - state.target).max(), abs=1e-7
        )
    assert "lacks detuning" in family.note()
    (rest,) = family.states(np.zeros((1, 6)))
    assert rest.outcome is Outcome.OK
    for ramp in family.ramps([rest, states[63], states[1]], [states[21], states[21], rest]):
        if ramp is not None:
            assert np.all(np.isfinite(known(ramp.epsilon)))
            assert np.all(np.isfinite(known(ramp.lam)))


@pytest.mark.parametrize("full_scale", [0.5, 0.8, 0.95])
def test_near_the_hilltop_no_number_is_called_right(full_scale: float) -> None:
    for state in standing(weak(full_scale=full_scale)):
        assert state.outcome is not Outcome.OK


def test_a_ramp_says_what_it_lacks(family: Vibration, states: list[OperatingPoint]) -> None:
    steady = max(abs(state.epsilon) for state in states) / LINKED.epsilon_per_volt
    few_volts = weak(amplifier=LINKED.amplifier.model_copy(update={"volts": 0.5 * steady}))
    few_links = weak(coupling=LINKED.coupling.model_copy(update={"lam": Span(min=0.0, max=0.3)}))
    for lacking, word in ((few_volts, "volts"), (few_links, "range of lam")):
        made = standing(lacking)
        (ramp,) = lacking.ramps([made[0b111111]], [made[0b101010]])
        assert word in known(ramp).lacking
        assert word in lacking.note()
