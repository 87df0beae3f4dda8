"""One list of exchanges, three controllers: Python's, the firmware as a program, and the firmware on a Cortex-M."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.protocol.keys import KeyPacket
from drivers.protocol.packet import Kind, Packet, PacketReader
from drivers.protocol.playout import OutputBlock
from drivers.protocol.replies import Ack, Capabilities, Flag, Marked, Refused
from drivers.protocol.virtual_controller import VirtualController
from tests.drivers.protocol.exchanges import EXCHANGES
from tests.support.firmware import SANITIZED, TRIAL, Answer, GivenProgram, Request, built, run_in_emulator
from tests.support.wire import SPEC

ANSWERS = Path(__file__).with_name("answers.json")
# A drive is rounded to within two steps, and the synthesis is a little beside the truth.
MOST_CODES = 2.6

Played = tuple[NDArray[np.float64], NDArray[np.float64]]


def told(data: bytes) -> list[str]:
    """What a controller says, for people to read."""
    reader = PacketReader()
    return [_line(packet) for packet in reader.feed(data)] + ["spoiled"] * reader.bad


def _line(packet: Packet) -> str:
    if packet.kind is Kind.CAPABILITIES:
        found = Capabilities.of(packet)
        grid = f"{found.rows} x {found.cols}, {found.channels} channels, {found.rate_hz} Hz, {found.bits} bits"
        room = f"{found.buffer_samples} samples {found.event_slots} events {found.max_payload} bytes"
        lam = f"{found.full_volts:g} V, lam {found.lam_step * 65535:.6g} {found.lam_max:.6g}"
        ends = f"{found.watchdog_ms} {found.ramp_ms} ms, measures {found.measures}, {found.name}"
        return f"CAPABILITIES {found.version}: {grid}, {room}, {lam}, {ends}; at {found.session} {found.next_number}"
    if packet.kind is Kind.ACK:
        ack = Ack.of(packet)
        assert ack is not None
        gap = " GAP" if Flag.GAP in ack.flags else ""
        room = f"room {ack.accept_samples} {ack.accept_events}, {ack.received} here, {ack.played} played"
        rest = f"{ack.underruns} underruns, {ack.bad} bad, held {ack.held_ms} ms, kept {ack.kept}"
        return f"ACK {ack.session} {ack.next_number} {ack.state.name}{gap}: {room}, {rest}; {ack.clock_us} us"
    if packet.kind is Kind.MARKED:
        marked = Marked.of(packet)
        return f"MARKED {marked.frame} at {marked.at}; {marked.clock_us} us"
    if packet.kind is Kind.KEY:
        keys = KeyPacket.of(packet)
        return f"KEY {keys.first}: {' '.join(f'{key.wire:04x}' for key in keys.events)}"
    refused = Refused.of(packet)
    return f"REFUSED {refused.number}: {refused.why}"


def virtual(requests: list[Request]) -> tuple[list[list[str]], Played]:
    """What Python's controller answers and puts out: codes (S, channels) and links (S, rows, links)."""
    blocks = list[OutputBlock]()
    controller = VirtualController(SPEC, now=0.0, name="trial", on_output=blocks.append)
    lines = []
    for request in requests:
        controller.tick(request.now_us * 1e-6)
        for key in request.keys:
            controller.press(key)
        controller.receive(request.data, request.now_us * 1e-6)
        lines.append(told(controller.outgoing()))
    codes = np.concatenate([np.zeros((0, SPEC.channels)), *(block.volts for block in blocks)]) * 32767 / SPEC.full_volts
    lam = np.concatenate([np.zeros((0, SPEC.rows, SPEC.cols)), *(block.lam for block in blocks)])
    return lines, (codes, lam[:, :, 1:] / SPEC.lam_step)


def played(answers: list[Answer]) -> Played:
    """What a firmware put out."""
    codes = np.concatenate([answer.codes for answer in answers]).astype(np.float64)
    return codes, np.concatenate([answer.links for answer in answers]).astype(np.float64)


@pytest.fixture(scope="module")
def program() -> Iterator[GivenProgram]:
    """The firmware as a program of this machine, with its reads and writes watched."""
    with GivenProgram(built("given", "trial", flags=SANITIZED), TRIAL) as running:
        yield running


@pytest.fixture(scope="module")
def by_emulator(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Answer]]:
    """What the firmware on an emulated Cortex-M answers to all of them."""
    image, talks = built("cortex-m-given", "trial"), [talk().requests for talk in EXCHANGES.values()]
    answers = run_in_emulator(image, TRIAL, talks, tmp_path_factory.mktemp("emulated"))
    return dict(zip(EXCHANGES, answers, strict=True))


def expected(name: str) -> list[list[str]]:
    kept: list[list[str]] = json.loads(ANSWERS.read_text(encoding="utf-8"))[name]
    return kept


def compare(name: str, answers: list[Answer]) -> None:
    requests = EXCHANGES[name]().requests
    assert [told(answer.sent) for answer in answers] == expected(name)
    wanted_codes, wanted_links = virtual(requests)[1]
    codes, links = played(answers)
    assert codes.shape == wanted_codes.shape
    assert np.abs(codes - wanted_codes).max(initial=0.0) <= MOST_CODES
    assert np.abs(links - wanted_links).max(initial=0.0) <= 0.51


def test_every_exchange_has_its_answers() -> None:
    assert set(json.loads(ANSWERS.read_text(encoding="utf-8"))) == set(EXCHANGES)


@pytest.mark.parametrize("name", EXCHANGES)
def test_python_answers_so(name: str) -> None:
    assert virtual(EXCHANGES[name]().requests)[0] == expected(name)


@pytest.mark.parametrize("name", EXCHANGES)
def test_the_program_answers_so(name: str, program: GivenProgram) -> None:
    program.restart()
    compare(name, [program.ask(request) for request in EXCHANGES[name]().requests])


@pytest.mark.parametrize("name", EXCHANGES)
def test_the_cortex_m_answers_so(name: str, by_emulator: dict[str, list[Answer]]) -> None:
    compare(name, by_emulator[name])


if __name__ == "__main__":
    kept = {name: virtual(talk().requests)[0] for name, talk in EXCHANGES.items()}
    ANSWERS.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    sys.exit(0)
