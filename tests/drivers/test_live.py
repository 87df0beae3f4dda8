"""Live playing in virtual time: what arrives, what is passed over, limits, silence, and controllers of before."""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chainsim import load_device
from dotwave.live import core as core_module
from dotwave.verification import verify
from drivers import Capabilities, Faults, GateLimits, GateRefusal, KeyEvent, LiveEnded, LiveMessages, read_waveform
from drivers.protocol.keys import GridKey, KeyHearing, KeyPacket, KeyWaiting
from drivers.protocol.messages import VERSION, SamplesMessage, StartMessage
from drivers.protocol.outgoing import End
from drivers.protocol.packet import Kind, Packet, PacketReader, encode
from drivers.protocol.replies import Ack, State
from drivers.protocol.virtual_controller import VirtualController
from planner import frame_change
from tests.support.live_bench import LiveBench
from tests.support.wire import SPEC

ROOT = Path(__file__).resolve().parents[2]
PAPER = load_device("paper-6x6")
CHANNELS = 42


def windows(count: int, seed: int = 1) -> list[str]:
    codes = np.random.default_rng(seed).integers(1, 64, (count, 6))
    return ["".join(chr(0x2800 + int(code)) for code in row) for row in codes]


def stands(bench: LiveBench, note: str) -> Callable[[], bool]:
    return lambda: (bench.core.state.stands is not None) and bench.core.state.stands.text == note


def show(bench: LiveBench, cells: str, note: str, standing_s: float = 0.1) -> None:
    bench.show(cells, note)
    bench.run(3.0, stands(bench, note))
    assert stands(bench, note)()
    bench.run(standing_s)


def closed(bench: LiveBench) -> None:
    bench.core.close()
    bench.run(5.0, lambda: bench.session.finished)
    assert bench.session.finished
    assert not bench.last.any()


def test_what_arrives_is_a_waveform_that_verifies(tmp_path: Path) -> None:
    bench = LiveBench(PAPER, record=tmp_path / "arrived.wav")
    shown = windows(6)
    for number, cells in enumerate(shown):
        show(bench, cells, f"window {number}")
    bench.core.rest()
    bench.run(0.5)
    show(bench, shown[0], "again")
    closed(bench)
    report = verify(tmp_path / "arrived.wav")
    assert report.ok
    assert [check.text for check in report.frames] == [*(f"window {number}" for number in range(6)), "again"]
    assert all(check.wrong_dots == 0 and check.amplitude_error < 0.001 for check in report.frames)
    assert [check.wanted_cells.replace("\n", "") for check in report.frames] == [*shown, shown[0]]
    # A pattern stands until the next one begins; the rest in between belongs to none.
    ends = [(check.end_s, later.start_s) for check, later in zip(report.frames, report.frames[1:], strict=False)]
    assert all(end == begin for end, begin in ends[:5])
    assert ends[5][1] - ends[5][0] > 0.3


def test_a_session_that_is_cut_short_keeps_what_stood(tmp_path: Path) -> None:
    bench = LiveBench(PAPER, record=tmp_path / "arrived.wav")
    for number, cells in enumerate(windows(2)):
        show(bench, cells, str(number))
    bench.show(windows(3)[2], "on its way")
    bench.run(0.03)
    assert bench.recorder is not None
    bench.recorder.cut()
    manifest, _ = read_waveform(tmp_path / "arrived.wav")
    assert [mark.text for mark in manifest.frames] == ["0", "1"]
    assert verify(tmp_path / "arrived.wav").ok


def test_the_grid_follows_within_lead_and_way() -> None:
    bench = LiveBench(PAPER)
    bench.run(0.2)
    for number, cells in enumerate(windows(20)):
        show(bench, cells, str(number), 0.013 * number)
    # 60 ms of lead, a packet of 6 ms, a way of 60 ms, and the bench's own steps.
    assert max(bench.latencies_s) <= 0.13
    assert bench.session.report.underruns == 0
    assert bench.most_stored <= (0.06 + 0.007) * bench.spec.rate_hz


def test_the_latest_wins() -> None:
    bench = LiveBench(PAPER)
    shown = windows(52)
    show(bench, shown[0], "0")
    bench.show(shown[1], "1")
    bench.run(0.08)
    for number in range(2, 52):
        bench.show(shown[number], str(number))
        bench.step()
    bench.run(1.0)
    # On its way to 1 while most of the others came; what follows is the last of all.
    assert stands(bench, "51")()
    assert bench.core.state.shown <= 4
    assert bench.core.state.coalesced >= 48
    assert not bench.core.state.waiting


def test_the_same_window_again_is_no_change() -> None:
    bench = LiveBench(PAPER)
    show(bench, "⠓⠊", "hi")
    for _ in range(20):
        bench.show("⠓⠊", "hi")
        bench.run(0.02)
    assert bench.core.state.shown == 1
    show(bench, "⠓⠊", "another note")
    assert bench.core.state.shown == 2


def test_holding_plans_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = LiveBench(PAPER)
    show(bench, "⠓⠊", "hi")
    planned = list[int]()
    monkeypatch.setattr(frame_change, "moves_between", lambda *_: planned.append(1))
    bench.run(3.0)
    assert planned == []
    assert bench.controller.playout.played > 3 * bench.spec.rate_hz


def test_what_was_left_stands_and_then_rests() -> None:
    bench = LiveBench(PAPER, idle_s=0.5)
    show(bench, "⠓⠊", "hi")
    bench.run(1.0)
    assert bench.last.any(), "whoever reads may read for long"
    bench.core.hold()
    bench.run(0.4)
    assert bench.last.any()
    bench.show("⠓⠑", "he")
    bench.run(1.0)
    assert bench.last.any(), "somebody shows again"
    bench.core.hold()
    bench.run(0.8)
    assert not bench.last.any()
    assert bench.core.state.resting
    assert bench.core.state.stands is None
    assert bench.controller.playout.state is State.PLAYING
    show(bench, "⠓⠊", "back")


def test_the_end_is_the_way_to_rest() -> None:
    bench = LiveBench(PAPER)
    show(bench, windows(1)[0], "0")
    bench.peak_slew = 0.0
    closed(bench)
    playout = bench.controller.playout
    assert playout.state is State.DONE
    assert playout.played == playout.received
    # Along the planned way: the controller's own ramp would take 50 ms from anywhere.
    assert 0 < bench.peak_slew < PAPER.amplifier.slew_v_per_s / 10
    bench.core.show(bench.cells.frame("⠓", "too late"))
    assert not bench.core.state.waiting


def test_an_end_before_anything_was_shown() -> None:
    bench = LiveBench(PAPER)
    bench.run(0.1)
    closed(bench)


def test_a_killed_host_leaves_nothing_standing() -> None:
    bench = LiveBench(PAPER)
    show(bench, windows(1)[0], "0")
    bench.peak_slew = 0.0
    bench.controller.tick(bench.now + bench.spec.watchdog_s)
    assert not bench.last.any()
    assert bench.peak_slew < PAPER.amplifier.slew_v_per_s / 10


def test_a_flood_is_neither_kept_nor_felt() -> None:
    """2000 windows a second: what is stored, planned and put out stays what it is."""
    bench = LiveBench(PAPER)
    bench.run(0.2)
    shown = [bench.cells.frame(cells, str(number)) for number, cells in enumerate(windows(64))]
    for number in range(3000):
        bench.core.show(shown[2 * number % 64])
        bench.core.show(shown[(2 * number + 1) % 64])
        bench.step()
    report = bench.session.report
    assert report.underruns == 0
    assert report.lost_s == 0
    assert bench.most_stored <= (0.06 + 0.007) * bench.spec.rate_hz
    assert bench.peak_volts <= PAPER.amplifier.volts
    assert bench.peak_slew <= PAPER.amplifier.slew_v_per_s
    # A way takes 60 ms: no more patterns were shown than there was time for, and no fewer than half of that.
    assert 25 <= bench.core.state.shown <= 51
    assert bench.core.state.coalesced > 5000
    show(bench, "⠓⠊", "the next good client")


def test_planning_that_newer_windows_overtake_comes_to_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = LiveBench(PAPER)
    bench.run(0.2)
    way, came = bench.core._way, list[int]()
    frames = [bench.cells.frame(cells, str(number)) for number, cells in enumerate(windows(64))]

    def overtaken(wish: core_module._Wish) -> object:
        found = way(wish)
        came.append(1)
        bench.core.show(frames[len(came) % 64])
        return found

    monkeypatch.setattr(bench.core, "_way", overtaken)
    bench.core.show(frames[0])
    bench.run(core_module.STARVED_S / 2)
    assert bench.core.state.coming is None, "what was overtaken is true no longer"
    bench.run(0.5)
    assert bench.core.state.shown >= 1


def test_a_line_that_loses_and_spoils(tmp_path: Path) -> None:
    faults = Faults(drop=0.01, corrupt=0.01, duplicate=0.01)
    bench = LiveBench(PAPER, record=tmp_path / "arrived.wav", faults=faults, lead_s=0.2)
    for number, cells in enumerate(windows(5)):
        show(bench, cells, str(number))
    closed(bench)
    assert bench.session.report.resent > 0
    report = verify(tmp_path / "arrived.wav")
    assert report.ok
    assert [check.text for check in report.frames] == list("01234")


def test_after_an_underrun_the_lead_grows() -> None:
    bench = LiveBench(PAPER)
    show(bench, "⠓⠊", "hi")
    for _ in range(2):
        bench.controller.tick(bench.now + 0.1)
        bench.now += 0.1
        bench.run(0.5)
    assert bench.session.report.underruns == 1
    assert 0.1 * bench.spec.rate_hz <= bench.most_stored <= 0.13 * bench.spec.rate_hz
    show(bench, "⠓⠑", "he")


def test_too_much_for_a_second_waits() -> None:
    limits = GateLimits.of(PAPER, CHANNELS)
    free = LiveBench(PAPER)
    for bench in (free, LiveBench(PAPER, limits=replace(limits, energy_j=7e-6))):
        bench.run(0.2)
        for number, cells in enumerate(windows(12)):
            bench.show(cells, str(number))
            bench.run(0.12)
    assert free.core.state.shown > bench.core.state.shown >= 1
    assert not bench.core.state.refused
    bench.run(2.0)
    assert stands(bench, "11")(), "the last one stands once there was time"


def test_what_is_over_a_limit_is_refused_and_the_grid_rests() -> None:
    probe = LiveBench(PAPER)
    show(probe, "⠁", "one dot")
    volts = probe.peak_volts
    bench = LiveBench(PAPER, limits=replace(GateLimits.of(PAPER, CHANNELS), volts=0.9 * volts))
    bench.run(0.2)
    bench.show("⠁", "too much")
    bench.run(0.5)
    assert "stopped at the gate: volts" in bench.core.state.refused
    assert bench.core.state.shown == 0
    assert bench.peak_volts == 0
    closed(bench)


def test_a_sample_over_a_limit_does_not_leave(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the way was found to be before: each block is held against the gate once more."""
    bench = LiveBench(PAPER, limits=replace(GateLimits.of(PAPER, CHANNELS), volts=1.0))
    monkeypatch.setattr(LiveMessages, "_check", lambda *_: None)
    bench.run(0.2)
    bench.show("⠿⠿⠿⠿⠿⠿", "all")
    with pytest.raises(GateRefusal, match="stopped at the gate: volts"):
        bench.run(0.5)
    assert bench.peak_volts <= 1.0


def test_a_pattern_that_must_not_stand_for_long_is_refused() -> None:
    bench = LiveBench(PAPER, limits=replace(GateLimits.of(PAPER, CHANNELS), duty=0.5, duty_level=0.01))
    bench.run(0.2)
    bench.show("⠿⠿⠿⠿⠿⠿", "all")
    bench.run(1.0)
    assert not bench.core.state.refused
    bench.run(0.5)
    assert "duty" in bench.core.state.refused
    assert bench.peak_volts == 0
    closed(bench)


def test_a_pattern_that_cannot_be_made_leaves_nothing_that_is_not_true() -> None:
    ring = load_device("paper-6x6-ring")
    bench = LiveBench(ring)
    bench.run(0.2)
    bench.show("⠓⠊", "hi")
    bench.run(0.5)
    assert "cannot make this pattern" in bench.core.state.refused
    assert bench.core.state.stands is None
    assert bench.peak_volts == 0
    closed(bench)


@pytest.mark.parametrize("version", [1, 2, 3])
def test_controllers_of_before_are_served(version: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("drivers.protocol.virtual_controller.VERSION", version)
    bench = LiveBench(PAPER, buffer_s=0.2, record=tmp_path / "arrived.wav")
    for number, cells in enumerate(windows(3)):
        show(bench, cells, str(number))
    assert bench.session.report.underruns == 0
    assert bench.session.capabilities is not None
    assert bench.session.capabilities.version == version
    # Half of its buffer is filled, for it does not begin before.
    assert 0.1 <= bench.most_stored / bench.spec.rate_hz <= 0.12
    bench.core.close()
    with pytest.raises(LiveEnded):
        bench.run(5.0)
    bench.run(0)
    assert not bench.last.any()
    assert bench.recorder is not None
    bench.recorder.cut()
    report = verify(tmp_path / "arrived.wav")
    assert report.ok
    assert [check.text for check in report.frames] == list("012")


def answers(controller: VirtualController, now: float, *packets: Packet) -> list[Packet]:
    for packet in packets:
        controller.receive(encode(packet), now)
    return PacketReader().feed(controller.outgoing())


def greeted(version: int = VERSION) -> VirtualController:
    controller = VirtualController(SPEC, now=0.0)
    (said,) = answers(controller, 0.0, Packet(Kind.HELLO, 0, version.to_bytes(2, "little")))
    assert Capabilities.of(said).version == version
    return controller


def state(controller: VirtualController) -> State:
    return controller.playout.state


def samples(first: int, count: int) -> SamplesMessage:
    return SamplesMessage(first, np.full((count, SPEC.channels), 100, dtype=np.int16))


@pytest.mark.parametrize(("prefill", "enough"), [(0, 1000), (200, 200), (5000, 1000)])
def test_the_clock_starts_at_the_prefill_or_half_of_the_buffer(prefill: int, enough: int) -> None:
    controller = greeted()
    start = StartMessage(7, False, SPEC.rate_hz, 0, b"note", prefill)
    answers(controller, 0.0, start.packet(0), samples(0, enough - 1).packet(1))
    assert state(controller) is State.FILLING
    answers(controller, 0.0, samples(enough - 1, 1).packet(2))
    assert state(controller) is State.PLAYING
    # After it ran dry too, once the output is at zero.
    controller.tick(0.19)
    assert state(controller) is State.HELD
    answers(controller, 0.3, Packet(Kind.STATUS))
    answers(controller, 0.3, samples(enough, enough).packet(3))
    assert state(controller) is State.PLAYING


def test_the_end_says_how_long_an_open_session_was() -> None:
    controller = greeted()
    answers(controller, 0.0, StartMessage(7, False, SPEC.rate_hz, 0).packet(0), samples(0, 400).packet(1))
    answers(controller, 0.0, End(400).packet(2))
    answers(controller, 0.1, Packet(Kind.STATUS))
    (said,) = (Ack.of(packet) for packet in answers(controller, 0.15, Packet(Kind.STATUS)) if packet.kind is Kind.ACK)
    assert said is not None
    assert (said.state, said.played) == (State.DONE, 400)
    other = greeted()
    answers(other, 0.0, StartMessage(7, False, SPEC.rate_hz, 0).packet(0), samples(0, 400).packet(1))
    refused = answers(other, 0.0, End(399).packet(2))
    assert any(packet.kind is Kind.REFUSED for packet in refused)


def test_a_start_that_lacks_its_prefill_is_passed_over() -> None:
    start = StartMessage(7, False, SPEC.rate_hz, 0, b"", 200).packet(0)
    short = replace(start, payload=start.payload[:-1])
    assert StartMessage.of(short) is None
    controller = greeted()
    answers(controller, 0.0, short)
    assert controller.session == 0
    assert StartMessage.of(start) == StartMessage(7, False, SPEC.rate_hz, 0, b"", 200)


def test_keys_come_once_and_in_order_whatever_the_line_does() -> None:
    bench = LiveBench(PAPER, faults=Faults(drop=0.2, corrupt=0.1, duplicate=0.2, delay_s=0.01), lead_s=0.2)
    bench.run(0.5)
    pressed = list[KeyEvent]()
    for number in range(40):
        for event in (KeyEvent(1 + number % 6), KeyEvent.over(number % 6, down=False)):
            bench.controller.press(event)
            pressed.append(event)
        bench.run(0.15)
    bench.run(1.0)
    assert bench.keys == pressed
    assert pressed[1].cell == 0


def test_keys_nobody_hears_are_given_up() -> None:
    waiting, hearing = KeyWaiting(), KeyHearing()
    for code in range(20):
        waiting.press(KeyEvent(code), 0.0)
    packet = waiting.due(0.0)
    assert packet is not None
    assert [event.code for event in hearing.take(packet)] == list(range(16))
    assert waiting.due(0.04) is None
    again = waiting.due(0.05)
    assert again is not None
    assert hearing.take(again) == ()
    waiting.clear()
    waiting.press(KeyEvent(99), 0.1)
    later = waiting.due(0.1)
    assert later is not None
    assert KeyPacket.of(later).first == 16
    assert [event.code for event in hearing.take(later)] == [99]
    waiting.answered(hearing.answer)
    assert waiting.due(1.0) is None
    # An old packet, and an answer to what was given up, change nothing.
    assert hearing.take(packet) == ()
    waiting.press(KeyEvent(5), 2.0)
    waiting.answered(Packet(Kind.KEYED, 0, (3).to_bytes(4, "little")))
    assert waiting.due(2.0) is not None


def test_hosts_of_before_and_greetings_get_no_keys() -> None:
    old = greeted(3)
    old.press(KeyEvent(1))
    assert all(packet.kind is not Kind.KEY for packet in answers(old, 0.1, Packet(Kind.STATUS)))
    new = greeted()
    new.press(KeyEvent(1))
    assert [packet.kind for packet in answers(new, 0.1)] == [Kind.KEY]
    answers(new, 0.2, Packet(Kind.HELLO, 0, VERSION.to_bytes(2, "little")))
    assert answers(new, 0.4) == []


def test_numbers_of_keys_go_round() -> None:
    hearing = KeyHearing()
    top = (1 << 32) - 2
    assert len(hearing.take(KeyPacket(top, (KeyEvent(1), KeyEvent(2))).packet())) == 2
    assert hearing.take(KeyPacket(top, (KeyEvent(1), KeyEvent(2), KeyEvent(3))).packet()) == (KeyEvent(3),)
    assert hearing.answer.payload == (1).to_bytes(4, "little")


def test_the_header_does_as_python_does(tmp_path: Path) -> None:
    gcc = shutil.which("gcc")
    if gcc is None:
        pytest.skip("the C header is checked where there is a gcc")
    command = [gcc, "-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    command += ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-I", str(ROOT / "drivers" / "firmware")]
    subprocess.run([*command, ROOT / "tests" / "data" / "live_harness.c", "-o", tmp_path / "live"], check=True)

    def said(*packets: Packet) -> bytes:
        sent = b"".join(map(encode, packets))
        return subprocess.run([tmp_path / "live"], input=sent, capture_output=True, check=True).stdout

    whole = StartMessage(7, False, 8000, 0, b"note", 300).packet(0)
    short = replace(StartMessage(7, False, 8000, 0, b"", 300).packet(0), payload=whole.payload[:19])
    starts = [whole, short, StartMessage(7, False, 8000, 500).packet(0), replace(whole, payload=whole.payload[:21])]
    starts.append(StartMessage(7, False, 8000, 0, b"", 5000).packet(0))
    numbers = struct.unpack(f"<{2 * len(starts)}I", said(*starts))
    assert numbers == (1, 300, 0, 0, 1, 1001, 1, 300, 1, 1001)

    waiting, wanted = KeyWaiting(), b""
    sent = list[Packet]()
    for number in range(1, 19):
        event = KeyEvent(number if number % 2 else 256 + number, number % 3 != 0)
        waiting.press(event, number)
        told = waiting.due(number)
        sent.append(Packet(Kind.HEARTBEAT))
        wanted += struct.pack("<I", number <= 16) + (encode(told) if told is not None else b"")
    for awaited, left in ((17, 16), (10, 6), (9, 6)):
        sent.append(Packet(Kind.KEYED, 0, struct.pack("<I", awaited)))
        waiting.answered(sent[-1])
        wanted += struct.pack("<I", left)
    sent.append(Packet(Kind.HELLO, 0, b"\4\0"))
    assert said(*sent) == wanted + struct.pack("<I", 0)
    text = (ROOT / "drivers" / "firmware" / "dotwave_live.h").read_text(encoding="utf-8")
    named = {name: int(code) for name, code in re.findall(r"DW_KEY_([A-Z]+) = (\d+)", text)}
    assert named == {key.name: key.value for key in GridKey}
