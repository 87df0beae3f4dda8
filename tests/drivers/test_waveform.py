"""Waveforms and coupling events from plans made by hand, against the formula evaluated sample by sample."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from chainsim import Device, Outcome
from drivers import CouplingEvent, DriverError, LimitCheck, LimitError, Waveform, WaveformError, channels_of
from drivers.waveform.coupling import CouplingWriter, LamTrack
from drivers.waveform.sampling import volts_of
from encoders import Frame, TargetPattern
from planner import FirstOrderHold, FramePlan, Margins, OperatingPoint, Plan, Ramp
from tests.support.known import known
from tests.support.plans import NAMES, load

PATTERN = TargetPattern(np.zeros((1, 1), dtype=np.complex128))


def state(
    device: Device, epsilon: complex = 0j, omega: float = 1.0, lam: float = 0.0, bias: float = 0.0
) -> OperatingPoint:
    n = device.chain_length
    return OperatingPoint(
        target=np.ones(n), epsilon=epsilon, lam=np.full(n - 1, lam), bias=np.full(n, bias), omega=omega,
        phasor=np.zeros(n, dtype=np.complex128), mean=np.zeros(n), error=0.0, margins=Margins(0.0, 0.0),
        outcome=Outcome.OK,
    )  # fmt: skip


def frame(
    device: Device, start_s: float, end_s: float, states: list[OperatingPoint], ramps: list[Ramp | None] | None = None
) -> FramePlan:
    count = device.rows * device.chains_per_row
    states = states * (count // len(states))
    return FramePlan(
        Frame(PATTERN, end_s - start_s), start_s, start_s, end_s, tuple(states), tuple(ramps or [None] * count)
    )


def random_plan(device: Device, seed: int, frames: int = 1) -> Plan:
    """Smooth and straight ramps of every control, `frames` of each, with frame ends off the sample grid."""
    count, n = device.rows * device.chains_per_row, device.chain_length

    def draw() -> Iterator[FramePlan]:
        rng = np.random.default_rng(seed)
        start_s = 0.0
        epsilon, bias, lam = np.zeros(count, dtype=np.complex128), np.zeros((count, n)), np.zeros((count, n - 1))
        for smooth in [True, False] * frames:
            end_s = start_s + rng.uniform(0.04, 0.09)
            new_epsilon = 0.1 * rng.uniform(size=count) * np.exp(2j * np.pi * rng.uniform(size=count))
            new_bias = rng.uniform(-0.1, 0.1, (count, n)) if device.bias == "actuator" else np.zeros((count, n))
            new_lam = rng.uniform(0, device.coupling.lam.max, (count, n - 1))
            omega = rng.uniform(device.omega.min, device.omega.max)
            t_s = np.array([0.0, 0.013, 0.03])
            mix = np.array([0.0, rng.uniform(), 1.0])[:, np.newaxis]
            tilt = np.array([0.0, rng.uniform(0, 40), 10.0])[:, np.newaxis]
            ramps = tuple(
                Ramp(
                    t_s,
                    epsilon=epsilon[c] + (new_epsilon[c] - epsilon[c]) * mix[:, 0],
                    epsilon_slope=(new_epsilon[c] - epsilon[c]) * tilt[:, 0] if smooth else None,
                    bias=bias[c] + (new_bias[c] - bias[c]) * mix if device.bias == "actuator" else None,
                    bias_slope=(new_bias[c] - bias[c]) * tilt if smooth and device.bias == "actuator" else None,
                    lam_t_s=t_s if device.coupling.scope == "link" else None,
                    lam=lam[c] + (new_lam[c] - lam[c]) * mix if device.coupling.scope == "link" else None,
                )
                for c in range(count)
            )
            epsilon, bias, lam = new_epsilon, new_bias, new_lam
            states = tuple(
                replace(state(device, complex(epsilon[c]), omega), bias=bias[c], lam=lam[c]) for c in range(count)
            )
            yield FramePlan(Frame(PATTERN, end_s - start_s), start_s, start_s + 0.03, end_s, states, ramps)
            start_s = end_s

    return Plan(device, list(draw()), {})


def whole(waveform: Waveform, block: int = 1000) -> NDArray[np.float64]:
    return np.concatenate(list(waveform.blocks(block)))


def between(
    t: float,
    times: NDArray[np.float64],
    values: NDArray[np.complex128] | NDArray[np.float64],
    slopes: NDArray[np.complex128] | NDArray[np.float64] | None = None,
) -> complex:
    """The curve through the nodes at t, the plain way: the four Hermite basis functions, or a line."""
    k = next(k for k in range(1, len(times)) if t <= times[k])
    width = times[k] - times[k - 1]
    s = max(0.0, (t - times[k - 1]) / width)
    if slopes is None:
        return complex(values[k - 1] + (values[k] - values[k - 1]) * s)
    basis = [(1 + 2 * s) * (1 - s) ** 2, s * (1 - s) ** 2, s**2 * (3 - 2 * s), s**2 * (s - 1)]
    terms = [values[k - 1], width * slopes[k - 1], values[k], width * slopes[k]]
    return complex(sum(b * v for b, v in zip(basis, terms, strict=True)))


def expected_volts(plan: Plan, sample: int) -> list[float]:
    """Every channel at one sample, straight from the definitions."""
    device = plan.device
    rate, t = device.amplifier.rate_hz, sample / device.amplifier.rate_hz
    current = next(f for f in plan.frames if round(f.start_s * rate) <= sample < round(f.end_s * rate))
    since, tau = t - current.start_s, 2 * math.pi * device.f0_hz * t
    drives, biases = [], []
    for held, ramp in zip(current.states, current.ramps, strict=True):
        rising = ramp if ramp is not None and since < ramp.t_s[-1] else None
        envelope = held.epsilon
        if rising is not None:
            envelope = between(since, rising.t_s, known(rising.epsilon), rising.epsilon_slope)
        hold = FirstOrderHold.of(held.omega, 2 * math.pi * device.f0_hz / rate)
        envelope *= hold.gain
        if rising is not None and rising.epsilon_slope is not None:
            slope = np.interp(since, rising.t_s, rising.epsilon_slope) / (2 * math.pi * device.f0_hz)
            envelope += 1j * hold.lead * slope
        drives.append((envelope * cmath.exp(1j * held.omega * tau)).real / device.epsilon_per_volt)
        for m in range(device.chain_length if device.bias == "actuator" else 0):
            b = held.bias[m]
            if rising is not None:
                tilt = None if rising.bias_slope is None else rising.bias_slope[:, m]
                b = between(since, rising.t_s, known(rising.bias)[:, m], tilt).real
            biases.append(b / device.bias_per_volt)
    return drives + biases


@pytest.mark.parametrize("name", NAMES)
def test_samples_are_the_formula(name: str) -> None:
    plan = random_plan(load(name), seed=3)
    volts = whole(Waveform.of(plan))
    rate = plan.device.amplifier.rate_hz
    assert len(volts) == round(list(plan.frames)[-1].end_s * rate)
    joint = round(next(iter(plan.frames)).end_s * rate)
    for sample in (0, 1, 103, 104, 239, 240, 241, joint - 1, joint, joint + 1, joint + 150, len(volts) - 1):
        np.testing.assert_allclose(volts[sample], expected_volts(plan, sample), rtol=1e-10, atol=1e-9)


@settings(deadline=None, max_examples=25)
@given(st.sampled_from(NAMES[:3]), st.integers(1, 2000), st.integers(0, 100))
def test_samples_do_not_depend_on_the_block(name: str, block: int, seed: int) -> None:
    waveform = Waveform.of(random_plan(load(name), seed))
    blocks = list(waveform.blocks(block))
    assert all(len(b) == block for b in blocks[:-1])
    assert 1 <= len(blocks[-1]) <= block
    assert np.concatenate(blocks).tobytes() == whole(waveform, 10**6).tobytes()


def test_a_drive_runs_on_without_a_step_of_phase_over_frames() -> None:
    device = load("linked-6x6")
    held = state(device, 0.04 * cmath.exp(0.7j), omega=1.2345)
    joints = [0.0, 0.1003, 0.2501, 0.31, 1.77]
    split = [frame(device, a, b, [held]) for a, b in pairwise(joints)]
    one = Plan(device, [frame(device, 0.0, 1.77, [held])], {})
    # Equal to round-off only: chunks begin elsewhere, and vector instructions may round differently there.
    np.testing.assert_allclose(whole(Waveform.of(Plan(device, split, {}))), whole(Waveform.of(one)), atol=1e-11)


def test_the_hundredth_hour_is_as_exact_as_the_first_second() -> None:
    device = load("linked-6x6")
    held = state(device, 0.05, omega=1.25)
    long = frame(device, 0.0, 0.05, [held])
    late = replace(long, start_s=0.0, settled_s=0.0, end_s=360000.0)
    index = np.arange(360000 * 8000 - 500, 360000 * 8000)
    got = volts_of(device, late, index)[0]
    # The phase in whole cycles, in integers: f = 133.13 * 1.25 Hz = 1664125 / 10^4.
    cycles = (index.astype(object) * 1664125 % (10**4 * 8000)).astype(float) / (10**4 * 8000)
    gain = FirstOrderHold.of(1.25, device.tau_per_s / 8000).gain
    np.testing.assert_allclose(got, 25 * gain * np.cos(2 * np.pi * cycles), atol=25 * 1e-6)


@pytest.mark.parametrize("rate", [1500, 8000])
def test_straight_lines_between_the_samples_carry_the_envelope(rate: int) -> None:
    """A modulated carrier through a first-order hold: what a narrow band around it keeps is the envelope."""
    omega, tau_per_s, length = 1.2, 2 * math.pi * 133.13, 4.0
    hold = FirstOrderHold.of(omega, tau_per_s / rate)
    at = np.arange(int(length * rate)) / rate
    envelope = np.exp(-(((at - 2.0) / 0.4) ** 2)) * np.exp(2j * np.pi * 3 * at)
    slope = envelope * (-2 * (at - 2.0) / 0.16 + 6j * np.pi) / tau_per_s
    held = (hold.raised(envelope, slope) * np.exp(1j * omega * tau_per_s * at)).real
    fine = np.arange(int(length * 48000)) / 48000
    lines = np.interp(fine, at, held)
    spectrum = np.fft.fft(lines * np.exp(-1j * omega * tau_per_s * fine))
    spectrum[np.abs(np.fft.fftfreq(len(fine), 1 / 48000)) > 40] = 0
    kept = 2 * np.fft.ifft(spectrum)
    wanted = np.exp(-(((fine - 2.0) / 0.4) ** 2)) * np.exp(2j * np.pi * 3 * fine)
    inside = np.abs(fine - 2.0) < 1.2
    plain = np.abs(kept - wanted)[inside].max()
    assert plain < 2e-4
    assert plain < (hold.gain - 1) / 20


def test_idle_chains_are_exactly_zero_and_constant_bias_is_exact() -> None:
    device = load("paper-6x6")
    plan = Plan(device, [frame(device, 0.0, 0.01, [state(device, bias=0.05)])], {})
    volts = whole(Waveform.of(plan))
    assert np.all(volts[:, :6] == 0)
    assert np.all(volts[:, 6:] == 0.05 / device.bias_per_volt)


def test_a_ramp_without_epsilon_keeps_the_drive_at_zero_until_its_end() -> None:
    device = load("paper-6x6")
    rise = Ramp(np.array([0.0, 0.005]), bias=np.array([[0.0] * 6, [0.1] * 6]))
    held = state(device, 0.01, bias=0.1)
    volts = whole(Waveform.of(Plan(device, [frame(device, 0.0, 0.01, [held], [rise] * 6)], {})))
    assert np.all(volts[:40, :6] == 0)
    assert np.any(volts[40:, :6] != 0)
    np.testing.assert_allclose(volts[:, 6], 50 * np.minimum(1, np.arange(80) / 40), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "count", "places"),
    [
        ("linked-6x6", 6, {0: ("drive", 0, None), 5: ("drive", 5, None)}),
        ("paper-6x6", 42, {5: ("drive", 5, None), 6: ("bias", 0, 0), 41: ("bias", 5, 5)}),
        ("independent-6x6", 36, {0: ("drive", 0, 0), 7: ("drive", 1, 1), 35: ("drive", 5, 5)}),
        ("linked-40x96", 640, {1: ("drive", 0, 6), 16: ("drive", 1, 0), 639: ("drive", 39, 90)}),
    ],
)
def test_channels_come_in_the_order_of_the_design(
    name: str, count: int, places: dict[int, tuple[str, int, int]]
) -> None:
    channels = channels_of(load(name))
    assert [channel.index for channel in channels] == list(range(count))
    assert {channel.volts_per_unit for channel in channels} == {100.0}
    for index, place in places.items():
        channel = channels[index]
        assert (channel.role.value, channel.row, channel.col) == place


def test_frames_are_drawn_one_at_a_time() -> None:
    device = load("linked-6x6")
    drawn = 0

    def draw() -> Iterator[FramePlan]:
        nonlocal drawn
        for k in range(10):
            drawn += 1
            yield frame(device, k * 0.1, (k + 1) * 0.1, [state(device, 0.01)])

    blocks = Waveform.of(Plan(device, draw(), {})).blocks(800)
    assert drawn == 0
    next(blocks)
    assert drawn == 1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f: replace(f, start_s=0.01, settled_s=0.01), "frame 0: starts at 0.01 s where 0.0 s is wanted"),
        (lambda f: replace(f, end_s=-1.0), "frame 0: start_s 0.0, settled_s 0.0, end_s -1.0"),
        (lambda f: replace(f, end_s=math.nan), "end_s nan"),
        (lambda f: replace(f, states=f.states[1:]), "5 states and 6 ramps for the 6 chains of linked-6x6"),
        (lambda f: replace(f, states=tuple(replace(s, omega=0.0) for s in f.states)), "row 0: omega: .* got 0.0"),
        (lambda f: replace(f, states=tuple(replace(s, omega=31.0) for s in f.states)), "raise amplifier.rate_hz"),
        (lambda f: replace(f, states=tuple(replace(s, lam=np.zeros(4)) for s in f.states)), "lam: expected shape"),
        (lambda f: replace(f, states=tuple(replace(s, target=np.full(6, np.nan)) for s in f.states)), "target: .* nan"),
        (lambda f: replace(f, states=tuple(replace(s, bias=np.ones(6)) for s in f.states)), "has no bias channels"),
        (lambda f: replace(f, ramps=(Ramp(np.array([0.0, 0.2])),) * 6), "row 0: ramp.t_s: a ramp of 0.2 s in a frame"),
        (lambda f: replace(f, ramps=(Ramp(np.array([0.1, 0.0])),) * 6), "expected times from 0 upwards"),
        (lambda f: replace(f, ramps=(Ramp(np.zeros(0)),) * 6), "ramp.t_s: expected shape"),
        (lambda f: replace(f, ramps=(Ramp(np.zeros(2), np.zeros(3, complex)),) * 6), "ramp.epsilon: expected shape"),
        (lambda f: replace(f, ramps=(Ramp(np.zeros(2), None, np.zeros(3, complex)),) * 6), "ramp.epsilon_slope: expec"),
        (lambda f: replace(f, ramps=(Ramp(np.zeros(1), lam=np.zeros((1, 5))),) * 6), "give both or neither"),
    ],
)  # fmt: skip
def test_a_plan_that_contradicts_itself_is_refused_with_the_place(
    change: Callable[[FramePlan], FramePlan], words: str
) -> None:
    device = load("linked-6x6")
    bad = change(frame(device, 0.0, 0.1, [state(device)]))
    with pytest.raises(WaveformError, match=words) as caught:
        whole(Waveform.of(Plan(device, [bad], {})))
    assert "\n" not in str(caught.value)


def test_a_gap_between_frames_is_refused() -> None:
    device = load("linked-6x6")
    frames = [frame(device, 0.0, 0.1, [state(device)]), frame(device, 0.2, 0.3, [state(device)])]
    with pytest.raises(WaveformError, match=r"frame 1: starts at 0\.2 s where 0\.1 s is wanted"):
        whole(Waveform.of(Plan(device, frames, {})))


def test_a_block_has_at_least_one_sample() -> None:
    with pytest.raises(ValueError, match="block: expected"):
        Waveform.of(random_plan(load("linked-6x6"), 0)).blocks(0)


# Limits


def checked(device: Device, volts: NDArray[np.float64], block: int) -> LimitCheck:
    check = LimitCheck(device.amplifier, channels_of(device))
    for first in range(0, len(volts), block):
        check.check(volts[first : first + block])
    return check


@settings(deadline=None, max_examples=60)
@given(st.integers(1, 30), st.integers(0, 2**32 - 1), st.sampled_from([100.0, 300.0]))
def test_the_first_sample_over_a_limit_is_named_whatever_the_block(block: int, seed: int, top: float) -> None:
    device = load("linked-6x6")
    rng = np.random.default_rng(seed)
    volts = np.cumsum(rng.uniform(-top / 5, top / 5, (25, 6)), axis=0)
    slew = np.abs(np.diff(volts, axis=0, prepend=np.zeros((1, 6)))) * 8000
    over_volts, over_slew = np.abs(volts) > 100, slew > 3e5
    if not (over_volts.any() or over_slew.any()):
        check = checked(device, volts, block)
        np.testing.assert_array_equal(check.peak_volts, np.abs(volts).max(axis=0))
        assert check.peak_slew_v_per_s == pytest.approx(slew.max(), rel=1e-12)
        assert check.samples == 25
        return
    with pytest.raises(LimitError) as caught:
        checked(device, volts, block)
    sample, index = round(caught.value.time_s * 8000), caught.value.channel.index
    over, values = (over_volts, volts) if caught.value.limit == 100 else (over_slew, slew)
    assert over[sample, index]
    assert abs(caught.value.value) == pytest.approx(abs(values[sample, index]), rel=1e-12)
    assert not over[:sample].any()


@pytest.mark.parametrize("value", [100.0000001, -150.0, math.nan, math.inf])
def test_too_many_volts_name_channel_time_value_and_limit(value: float) -> None:
    device = load("paper-6x6")
    volts = np.zeros((40, 42))
    volts[20:, 15] = value
    with pytest.raises(LimitError, match=r"channel 15 \(bias, row 1, col 3\): .* V at 0.0025 s .* 100 V") as caught:
        checked(device, volts, 7)
    assert (caught.value.channel.row, caught.value.channel.col, caught.value.limit) == (1, 3, 100.0)
    assert caught.value.time_s == 20 / 8000
    np.testing.assert_equal(caught.value.value, value)


def test_a_jump_from_rest_at_the_first_sample_counts_as_slew() -> None:
    device = load("linked-6x6")
    volts = np.full((4, 6), 37.5)
    assert checked(device, volts, 4).peak_slew_v_per_s == 3e5
    with pytest.raises(LimitError, match=r"channel 0 \(drive, row 0\): 300800 V/s at 0 s .* 300000 V/s; lengthen"):
        checked(device, volts + 0.1, 4)


def test_the_drive_limit_itself_is_allowed() -> None:
    device = load("linked-6x6")
    gain = FirstOrderHold.of(0.9, device.tau_per_s / device.amplifier.rate_hz).gain
    held = state(device, device.epsilon_max / gain * cmath.exp(0.3j), omega=0.9)
    rise = Ramp(np.array([0.0, 0.05]), epsilon=np.array([0, held.epsilon]))
    volts = whole(Waveform.of(Plan(device, [frame(device, 0.0, 1.0, [held], [rise] * 6)], {})))
    assert checked(device, volts, 999).peak_volts.max() <= 100 * (1 + 1e-12)


# Coupling


def events_of(plan: Plan) -> list[CouplingEvent]:
    writer = CouplingWriter(plan.device)
    return [event for f in plan.frames for event in writer.events(f)]


def row_of(events: list[CouplingEvent], row: int) -> list[tuple[float, float, float]]:
    return [(e.t_s, e.lam[0], e.ramp_s) for e in events if e.row == row]


def test_a_ramp_of_links_becomes_segments_and_what_stands_is_silent() -> None:
    device = load("linked-6x6")
    nodes = np.array([0.0, 0.1, 0.25])
    ramp = Ramp(nodes, lam_t_s=nodes, lam=np.repeat([[0.1], [0.4], [0.2]], 5, axis=1))
    frames = [
        frame(device, 0.0, 1.0, [state(device, lam=0.1)]),
        frame(device, 1.0, 2.0, [state(device, lam=0.2)], [ramp, None] * 3),
        frame(device, 2.0, 3.0, [state(device, lam=0.2)]),
    ]
    events = events_of(Plan(device, frames, {}))
    assert row_of(events, 0) == [(0.0, 0.1, 0.0), (1.0, 0.4, 0.1), (1.1, 0.2, 0.15)]
    assert row_of(events, 1) == [(0.0, 0.1, 0.0), (1.0, 0.2, 0.0)]
    assert [event.t_s for event in events] == sorted(event.t_s for event in events)
    assert all(len(event.lam) == 5 for event in events)


def test_links_jump_where_a_ramp_does_not_begin_or_end_at_the_state() -> None:
    device = load("linked-6x6")
    nodes = np.array([0.0, 0.1])
    ramp = Ramp(nodes, lam_t_s=nodes, lam=np.repeat([[0.3], [0.4]], 5, axis=1))
    frames = [
        frame(device, 0.0, 1.0, [state(device, lam=0.1)]),
        frame(device, 1.0, 2.0, [state(device, lam=0.2)], [ramp] * 6),
    ]
    wanted = [(0.0, 0.1, 0.0), (1.0, 0.3, 0.0), (1.0, 0.4, 0.1), (1.1, 0.2, 0.0)]
    assert row_of(events_of(Plan(device, frames, {})), 3) == wanted


def test_chains_of_a_row_share_the_union_of_their_nodes() -> None:
    device = load("linked-40x96")
    states = [state(device, lam=0.5), *[state(device, lam=0.1)] * 15]
    one = Ramp(np.array([0.0, 0.2]), lam_t_s=np.array([0.0, 0.2]), lam=np.repeat([[0.0], [0.5]], 5, axis=1))
    two = Ramp(np.array([0.0, 0.1]), lam_t_s=np.array([0.0, 0.1]), lam=np.repeat([[0.3], [0.1]], 5, axis=1))
    ramps: list[Ramp | None] = [one, two, *[None] * 638]
    events = [e for e in events_of(Plan(device, [frame(device, 0.0, 1.0, states, ramps)], {})) if e.row == 0]
    assert [(e.t_s, e.ramp_s) for e in events] == [(0.0, 0.0), (0.0, 0.1), (0.1, 0.1)]
    assert [(e.lam[0], e.lam[6], e.lam[12]) for e in events] == [(0.0, 0.3, 0.1), (0.25, 0.1, 0.1), (0.5, 0.1, 0.1)]
    between_chains = [e.lam[index] for e in events for index in range(5, 95, 6)]
    assert set(between_chains) == {0.0}
    assert len(events[0].lam) == 95


def test_every_row_gets_an_event_at_zero_and_an_uncoupled_device_none() -> None:
    device = load("paper-6x6")
    events = events_of(Plan(device, [frame(device, 0.0, 1.0, [state(device)])], {}))
    assert events == [CouplingEvent(0.0, row, (0.0,) * 5, 0.0) for row in range(6)]
    assert events_of(random_plan(load("independent-6x6"), 1)) == []


@settings(deadline=None, max_examples=8)
@given(st.sampled_from(["linked-6x6", "linked-40x96"]), st.integers(0, 1000))
def test_lam_from_the_events_is_lam_of_the_ramps(name: str, seed: int) -> None:
    device = load(name)
    plan = random_plan(device, seed, frames=2)
    frames = list(plan.frames)
    rng = np.random.default_rng(seed)
    times = np.sort(rng.uniform(0, frames[-1].end_s, 30))
    track = LamTrack(events_of(plan), device.rows, device.cols)
    lam = track.at(times)
    assert lam.shape == (30, device.rows, device.cols)
    assert np.all(lam[:, :, :: device.chain_length] == 0)
    for t, found in zip(times, lam, strict=True):
        current = next(f for f in frames if f.start_s <= t < f.end_s)
        for index in rng.integers(0, len(current.states), 4):
            held, ramp = current.states[index], current.ramps[index]
            row, chain = divmod(int(index), device.chains_per_row)
            since = t - current.start_s
            for link in range(device.chain_length - 1):
                rising = since < ramp.lam_t_s[-1]
                wanted = between(since, ramp.lam_t_s, ramp.lam[:, link]).real if rising else held.lam[link]
                assert found[row, chain * device.chain_length + link + 1] == pytest.approx(wanted, abs=1e-10)


def test_lam_is_zero_before_the_first_event_and_an_event_takes_over_a_running_change() -> None:
    events = [
        CouplingEvent(1.0, 0, (1.0,), 1.0),
        CouplingEvent(1.5, 0, (0.0,), 0.5),
        CouplingEvent(3.0, 0, (0.7,), 0.0),
    ]
    lam = LamTrack(events, rows=2, cols=2).at(np.array([0.0, 1.25, 1.5, 1.75, 2.0, 2.9, 3.0, 9.0]))
    np.testing.assert_allclose(lam[:, 0, 1], [0, 0.25, 0.5, 0.25, 0, 0, 0.7, 0.7], atol=1e-15)
    assert np.all(lam[:, 1] == 0)
    assert np.all(lam[:, :, 0] == 0)


def test_errors_are_of_one_tree() -> None:
    assert issubclass(WaveformError, DriverError)
    assert issubclass(LimitError, ValueError)
