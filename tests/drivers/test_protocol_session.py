"""Host and controller over a line in memory, on a clock of the test's own: every sample once and in order."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from drivers.protocol.faults import Faults, FaultWindow, FaultyLine
from drivers.protocol.host_session import STOP, ControllerRefused, HostSession, SessionLost, Timing
from drivers.protocol.messages import FULL_CODE, Bias, LinkCoupling, SamplesMessage, StartMessage, Tones, WireTone
from drivers.protocol.outgoing import End, Message
from drivers.protocol.packet import Kind, Packet, PacketReader, encode
from drivers.protocol.playout import ControllerSpec, Event, OutputBlock
from drivers.protocol.replies import Capabilities, State
from drivers.protocol.virtual_controller import VirtualController
from tests.support.known import known
from tests.support.wire import SPEC, stream

STEP_S = 0.001


@dataclass
class Kept:
    """A recorder that keeps everything."""

    starts: list[StartMessage] = field(default_factory=list)
    blocks: list[np.ndarray] = field(default_factory=list)
    events: list[Any] = field(default_factory=list)
    ends: int = 0

    def start(self, start: StartMessage) -> None:
        self.starts.append(start)

    def samples(self, codes: np.ndarray) -> None:
        self.blocks.append(codes)

    def drawn(self, volts: np.ndarray) -> None:
        pass

    def event(self, event: Event) -> None:
        self.events.append(event)

    def end(self) -> None:
        self.ends += 1


def codes_of(seconds: float, seed: int = 1) -> np.ndarray:
    """Noise with zeros in it, so that stuffing and order are both tried."""
    rng = np.random.default_rng(seed)
    codes = rng.integers(-FULL_CODE, FULL_CODE, (round(seconds * SPEC.rate_hz), SPEC.channels), dtype=np.int16)
    codes[rng.random(codes.shape) < 0.3] = 0
    return codes


class Bench:
    """A host, a controller, and the two directions of a line between them."""

    def __init__(
        self, make: Callable[[Capabilities], Iterator[Message]], *, faults: Faults | None = None, seed: int = 3,
        spec: ControllerSpec = SPEC,
    ) -> None:  # fmt: skip
        self.now = 100.0
        self.kept, self.blocks = Kept(), list[OutputBlock]()
        self.controller = VirtualController(spec, now=self.now, on_output=self.blocks.append, recorder=self.kept)
        self.session = HostSession(make, session=7, timing=Timing())
        faults = faults or Faults()
        self.there = FaultyLine(faults, seed=seed, now=self.now)
        self.back = FaultyLine(faults, seed=seed + 1, now=self.now)
        self.host_lives = True
        self.session.connected()

    def step(self) -> None:
        self.now += STEP_S
        if self.host_lives:
            self.session.receive(self.back.take(self.now), self.now)
            self.there.put(self.session.poll(self.now), self.now)
        self.controller.receive(self.there.take(self.now), self.now)
        self.back.put(self.controller.outgoing(), self.now)

    def run(self, limit_s: float) -> None:
        end = self.now + limit_s
        while not self.session.finished:
            assert self.now < end, f"stuck at {self.session.played_s} s"
            self.step()

    def played(self, *, live: bool = True) -> np.ndarray:
        return np.concatenate([block.volts for block in self.blocks if block.live == live])


def test_a_clean_line_plays_every_sample_once() -> None:
    codes, marks = codes_of(2.0), [0, 4000, 12345]
    bench = Bench(partial(stream, codes, marks))
    bench.run(3.0)
    report = bench.session.report
    np.testing.assert_array_equal(np.concatenate(bench.kept.blocks), codes)
    np.testing.assert_array_equal(bench.played(), codes * (100.0 / FULL_CODE))
    assert (report.underruns, report.resent, report.lost_s, report.samples) == (0, 0, 0.0, len(codes))
    assert (bench.kept.ends, [event.frame for event in bench.kept.events]) == (1, [0, 1, 2])
    assert report.late_s.keys() == {0, 1, 2}
    assert max(map(abs, report.late_s.values())) <= 1e-6
    assert max(map(abs, report.reported_late_s.values())) <= 2 * STEP_S


@pytest.mark.parametrize("drift_ppm", [-200.0, 200.0])
def test_the_controllers_clock_sets_the_pace(drift_ppm: float) -> None:
    codes = codes_of(3.0)
    bench = Bench(partial(stream, codes, [0, 23999]), spec=replace(SPEC, drift_ppm=drift_ppm))
    bench.run(4.0)
    assert bench.session.report.underruns == 0
    took = 23999 / SPEC.rate_hz
    late_s = -took * 1e-6 * drift_ppm
    assert bench.session.report.late_s[1] == pytest.approx(late_s, abs=2e-6)
    assert bench.session.report.reported_late_s[1] == pytest.approx(late_s, abs=2 * STEP_S)
    live = [block for block in bench.blocks if block.live]
    assert live[-1].time_s - live[0].time_s == pytest.approx(
        live[-1].played / SPEC.rate_hz / (1 + 1e-6 * drift_ppm), abs=1e-6
    )


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(
    "faults",
    [
        Faults(drop=0.01, corrupt=0.01),
        Faults(drop=0.1, corrupt=0.1, duplicate=0.1),
        Faults(delay_s=0.03, duplicate=0.5),
        Faults(drop=0.01, corrupt=0.01, disconnect=FaultWindow(0.8, 2.0)),
        Faults(stall=FaultWindow(0.5, 1.0)),
    ],
    ids=["one-percent", "bad", "late", "cut", "stall"],
)
def test_nothing_is_lost_and_nothing_comes_twice(faults: Faults, seed: int) -> None:
    codes, marks = codes_of(2.0, seed), [0, 100, 8000]
    bench = Bench(partial(stream, codes, marks), faults=faults, seed=seed)
    bench.run(20.0)
    np.testing.assert_array_equal(np.concatenate(bench.kept.blocks), codes)
    assert [event.frame for event in bench.kept.events] == [0, 1, 2]
    assert bench.session.report.samples == len(codes)
    if faults.disconnect is not None or faults.stall is not None:
        # The output was at zero for the silence, less what was in store and plus the time to fill up again.
        silence_s = known(faults.disconnect or faults.stall).length_s
        assert silence_s - 0.2 - 2 * STEP_S < bench.session.report.lost_s < silence_s + 0.5


@pytest.mark.parametrize("start_s", [0.0, 0.001, 0.003, 0.006, 0.02, 0.1, 0.3, 1.0, 1.8, 1.9, 2.0, 2.1])
@pytest.mark.parametrize("reopened", [False, True])
def test_the_cable_is_pulled_at_every_stage(start_s: float, reopened: bool) -> None:
    codes, length_s = codes_of(2.0), 0.6
    bench = Bench(partial(stream, codes, [0, 8000]), faults=Faults(disconnect=FaultWindow(start_s, length_s)))
    while bench.now < 100.0 + start_s + length_s:
        bench.step()
        if bench.now > 100.0 + start_s + SPEC.watchdog_s + STEP_S:
            assert not bench.blocks[-1].volts[-1].any()
    if reopened and not bench.session.finished:
        bench.session.connected()
    if not bench.session.finished:
        bench.run(4.0)
    np.testing.assert_array_equal(np.concatenate(bench.kept.blocks), codes)
    assert bench.session.report.samples == len(codes)
    assert [event.frame for event in bench.kept.events] == [0, 1]


def test_the_silent_host_is_ramped_to_zero_within_the_watchdog_time() -> None:
    codes = np.full((16000, 2), 20000, dtype=np.int16)
    bench = Bench(partial(stream, codes, []))
    while bench.session.played_s < 0.5:
        bench.step()
    bench.host_lives = False
    died = bench.now
    while bench.now < died + 1.0:
        bench.step()
    after = [block for block in bench.blocks if block.time_s >= died]
    volts = np.concatenate([block.volts[:, 0] for block in after])
    times = np.concatenate([block.time_s + np.arange(len(block.volts)) / SPEC.rate_hz for block in after])
    assert volts[times < died + 0.1].min() > 61
    assert not volts[times >= died + SPEC.watchdog_s].any()
    ramp = volts[np.flatnonzero(volts < volts[0])[0] - 1 :][: round(SPEC.ramp_s * SPEC.rate_hz) + 1]
    np.testing.assert_allclose(np.diff(ramp), np.diff(ramp)[0], rtol=1e-9)
    assert bench.controller.playout.state is State.HELD


def test_after_a_silence_the_stream_goes_on_where_it_stopped() -> None:
    codes = codes_of(2.0)
    bench = Bench(partial(stream, codes, []), faults=Faults(disconnect=FaultWindow(0.6, 0.7)))
    bench.run(6.0)
    whole = bench.played() * (FULL_CODE / 100.0)
    assert len(whole) == len(codes)
    touched = np.flatnonzero(~np.isclose(whole, codes, atol=1e-6).all(axis=1))
    # Only the ramp back up differs, and it does by a factor from 0 to 1.
    assert 0 < touched[-1] - touched[0] < SPEC.ramp_s * SPEC.rate_hz
    assert np.all(np.abs(whole) <= np.abs(codes) + 1e-6)
    # No step at the end of the ramp down or the beginning of the ramp up.
    everything = np.concatenate([block.volts for block in bench.blocks])
    held = np.flatnonzero(~everything.any(axis=1))
    assert np.abs(everything[held[0] - 1]).max() <= 100 / (SPEC.ramp_s * SPEC.rate_hz)


def test_stop_ramps_at_once_and_forgets() -> None:
    bench = Bench(partial(stream, codes_of(2.0), []))
    while bench.session.played_s < 0.5:
        bench.step()
    bench.controller.receive(STOP, bench.now)
    stopped = bench.now
    bench.host_lives = False
    while bench.now < stopped + 0.3:
        bench.step()
    late = [block for block in bench.blocks if block.time_s >= stopped + SPEC.ramp_s + STEP_S]
    assert late
    assert not any(block.volts.any() for block in late)
    assert bench.controller.session == 0


def test_a_controller_that_restarted_is_not_resumed() -> None:
    bench = Bench(partial(stream, codes_of(2.0), []))
    while bench.session.played_s < 0.5:
        bench.step()
    bench.controller = VirtualController(SPEC, now=bench.now)
    bench.session.connected()
    with pytest.raises(SessionLost, match="play again"):
        bench.run(1.0)


def test_a_starved_buffer_is_an_underrun_and_is_counted() -> None:
    codes = codes_of(1.0)
    calls = 0

    def halting(found: Capabilities) -> Iterator[Message]:
        nonlocal calls
        for message in stream(codes, [], found):
            calls += 1
            yield message

    bench = Bench(halting)
    while bench.session.played_s < 0.4:
        bench.step()
    # The host still beats, but has nothing to send.
    poll = bench.session.poll
    beat = encode(Packet(Kind.HEARTBEAT))
    bench.session.poll = lambda now: beat  # type: ignore[method-assign]
    for _ in range(600):
        bench.step()
    bench.session.poll = poll  # type: ignore[method-assign]
    bench.run(5.0)
    assert bench.session.report.underruns == 1
    assert bench.session.report.lost_s > 0.2
    assert bench.session.report.longest_pause_s == pytest.approx(601 * STEP_S)
    assert bench.session.report.buffer_s == SPEC.buffer_samples / SPEC.rate_hz
    np.testing.assert_array_equal(np.concatenate(bench.kept.blocks), codes)


def send(controller: VirtualController, now: float, *packets: Packet) -> list[Packet]:
    controller.receive(b"".join(map(encode, packets)), now)
    return PacketReader().feed(controller.outgoing())


@pytest.mark.parametrize(
    "message",
    [
        SamplesMessage(5, np.zeros((4, 2), dtype=np.int16)),
        SamplesMessage(0, np.zeros((2001, 1), dtype=np.int16)),
        SamplesMessage(0, np.full((1, 2), -32768, dtype=np.int16)),
        LinkCoupling(0, 2, 0, (1, 1)),
        LinkCoupling(0, 0, 0, (1, 1, 1)),
        Bias(0, 2, 0, 1.0),
        Bias(0, 0, 0, 101.0),
        Bias(0, 0, 0, float("nan")),
        Tones(0, 0, 0, (WireTone(60.0, 100.0, 0.0), WireTone(60.0, 120.0, 0.0))),
        Tones(0, 0, 0, (WireTone(1.0, float("inf"), 0.0),)),
        End(3),
    ],
    ids=str,
)
def test_what_cannot_be_carried_out_is_refused_and_the_output_stays_zero(message: Message) -> None:
    blocks: list[OutputBlock] = []
    kept = Kept()
    controller = VirtualController(SPEC, now=0.0, on_output=blocks.append, recorder=kept)
    answers = send(controller, 0.0, StartMessage(7, False, 8000, 8000).packet(0), message.packet(1))
    assert Kind.REFUSED in {packet.kind for packet in answers}
    answers = send(controller, 0.1, End(8000).packet(2), SamplesMessage(0, np.ones((9, 2), dtype=np.int16)).packet(1))
    assert Kind.REFUSED in {packet.kind for packet in answers}
    controller.tick(1.0)
    assert not any(block.volts.any() for block in blocks)
    assert not kept.events
    assert not kept.blocks


def test_the_host_says_what_was_refused() -> None:
    def wrong(_: Capabilities) -> Iterator[Message]:
        yield StartMessage(7, False, 48000, 10)

    bench = Bench(wrong)
    with pytest.raises(ControllerRefused, match="8000 Hz, not 48000"):
        bench.run(1.0)


@pytest.mark.parametrize("marks", [[], list(range(0, 12000, 25))], ids=["samples", "events"])
def test_credit_is_never_overdrawn_and_always_used(marks: list[int]) -> None:
    bench = Bench(partial(stream, codes_of(1.5), marks))
    fullest = 0
    while not bench.session.finished:
        bench.step()
        playout = bench.controller.playout
        stored = playout.received - playout.played
        assert stored <= SPEC.buffer_samples
        fullest = max(fullest, stored)
    assert bench.session.report.underruns == 0
    # Marks every 25 samples fill the 16 event slots before the buffer is full.
    assert fullest > (0.9 * SPEC.buffer_samples if not marks else 14 * 25)
    assert len(bench.kept.events) == len(marks)


def test_coupling_glides_and_holds() -> None:
    codes = np.zeros((8000, 2), dtype=np.int16)

    def coupled(found: Capabilities) -> Iterator[Message]:
        messages = stream(codes, [], found)
        yield next(messages)
        yield LinkCoupling(0, 1, 0, (6553, 13107))
        yield LinkCoupling(2000, 1, 4000, (65535, 0))
        yield from messages

    bench = Bench(coupled)
    bench.run(3.0)
    lam = np.concatenate([block.lam for block in bench.blocks if block.live])
    assert not lam[:, 0].any()
    assert not lam[:, :, 0].any()
    np.testing.assert_allclose(lam[[0, 1999, 4000, 7000], 1, 1], [0.1, 0.1, 0.55, 1.0], atol=2e-5)
    np.testing.assert_allclose(lam[[0, 4000, 6000], 1, 2], [0.2, 0.1, 0.0], atol=2e-5)


def test_parametric_tones_and_bias() -> None:
    def tones(_: Capabilities) -> Iterator[Message]:
        yield StartMessage(7, True, 8000, 4000)
        yield Tones(0, 0, 800, (WireTone(10.0, 125.0, 0.5), WireTone(5.0, 250.0, 0.0)))
        yield Bias(1000, 1, 1000, 30.0)
        yield Tones(2000, 0, 0, ())
        yield End(4000)

    bench = Bench(tones)
    bench.run(3.0)
    volts, t_s = bench.played(), np.arange(4000) / 8000
    sound = 10 * np.cos(2 * np.pi * 125 * t_s + 0.5) + 5 * np.cos(2 * np.pi * 250 * t_s)
    np.testing.assert_allclose(volts[:2000, 0], (sound * np.minimum(1, 8000 * t_s / 800))[:2000], atol=1e-5)
    assert not volts[2000:, 0].any()
    np.testing.assert_allclose(volts[[999, 1500, 2500], 1], [0, 15, 30], atol=1e-5)
    # The last volts do not stay: at the end the output ramps to zero.
    for _ in range(100):
        bench.step()
    assert not bench.blocks[-1].volts.any()


def test_a_second_session_follows_the_first() -> None:
    first, second = codes_of(0.5, 1), codes_of(0.4, 2)
    bench = Bench(partial(stream, first, []))
    bench.run(2.0)

    def another(found: Capabilities) -> Iterator[Message]:
        for message in stream(second, [], found):
            yield replace(message, session=8) if isinstance(message, StartMessage) else message

    bench.session = HostSession(another, session=8, timing=Timing())
    bench.session.connected()
    bench.run(3.0)
    np.testing.assert_array_equal(np.concatenate(bench.kept.blocks), np.concatenate([first, second]))
    assert [start.session for start in bench.kept.starts] == [7, 8]
