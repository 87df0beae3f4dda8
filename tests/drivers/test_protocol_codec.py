"""Both codecs, Python and C: round trips, the same verdict on the same bytes, nothing accepted that was not sent."""

from __future__ import annotations

import random
import re
import shutil
import struct
import subprocess
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, strategies as st

from drivers.protocol.cobs import FrameError, FrameSplitter, cobs_decode, cobs_encode
from drivers.protocol.messages import Bias, LinkCoupling, Mark, SamplesMessage, StartMessage, Tones, WireTone
from drivers.protocol.packet import (
    LONGEST_FRAME,
    MAX_PAYLOAD,
    ORDERED,
    SHAPES,
    Kind,
    Packet,
    PacketError,
    PacketReader,
    decode,
    encode,
)
from drivers.protocol.replies import Ack, Capabilities, Flag, Marked, Refused, State

ROOT = Path(__file__).resolve().parents[2]
SANITIZERS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

payload_bytes = st.one_of(st.binary(max_size=700), st.binary(max_size=20).map(lambda data: data * 60))


@st.composite
def packets(draw: st.DrawFn) -> Packet:
    kind = draw(st.sampled_from(Kind))
    fixed, item = SHAPES[kind]
    items = draw(st.integers(0, min(600, MAX_PAYLOAD - fixed) // item)) if item else 0
    seed = draw(payload_bytes) or b"\0"
    return Packet(kind, draw(st.integers(0, 2**32 - 1)), (seed * 4200)[: fixed + items * item])


@pytest.mark.parametrize(
    ("data", "stuffed"),
    [
        # The examples of Cheshire and Baker's paper as Wikipedia lists them.
        ("", "01"),
        ("00", "01 01"),
        ("00 00", "01 01 01"),
        ("00 11 00", "01 02 11 01"),
        ("11 22 00 33", "03 11 22 02 33"),
        ("11 22 33 44", "05 11 22 33 44"),
        ("11 00 00 00", "02 11 01 01 01"),
        (bytes(range(1, 255)).hex(), "ff" + bytes(range(1, 255)).hex()),
        (bytes(range(255)).hex(), "01 ff" + bytes(range(1, 255)).hex()),
        (bytes(range(1, 256)).hex(), "ff" + bytes(range(1, 255)).hex() + "02 ff"),
        (bytes([*range(2, 256), 0]).hex(), "ff" + bytes(range(2, 256)).hex() + "01 01"),
        (bytes([*range(3, 256), 0, 1]).hex(), "fe" + bytes(range(3, 256)).hex() + "02 01"),
    ],
)
def test_known_stuffings(data: str, stuffed: str) -> None:
    assert cobs_encode(bytes.fromhex(data)) == bytes.fromhex(stuffed)
    assert cobs_decode(bytes.fromhex(stuffed)) == bytes.fromhex(data)


@given(payload_bytes)
def test_stuffing_round_trip(data: bytes) -> None:
    stuffed = cobs_encode(data)
    assert 0 not in stuffed
    assert len(stuffed) <= len(data) + len(data) // 254 + 1
    assert cobs_decode(stuffed) == data


@given(st.binary(max_size=600))
def test_unstuffing_is_total(data: bytes) -> None:
    try:
        found = cobs_decode(data)
    except FrameError:
        return
    assert len(found) < len(data)


@given(packets())
def test_packet_round_trip(packet: Packet) -> None:
    wire = encode(packet)
    assert wire.count(0) == 1
    assert len(wire) <= LONGEST_FRAME + 1
    assert decode(wire[:-1]) == packet


@given(st.lists(packets(), max_size=5), st.lists(st.integers(0, 4000), max_size=8), st.binary(max_size=50))
def test_cutting_the_stream_changes_nothing(sent: list[Packet], cuts: list[int], noise: bytes) -> None:
    stream = noise + b"\0" + b"".join(map(encode, sent))
    reader, found, at = PacketReader(), [], 0
    for cut in [*sorted(cuts), len(stream)]:
        found += reader.feed(stream[at:cut] if cut > at else b"")
        at = max(at, cut)
    whole = PacketReader()
    assert found == whole.feed(stream)
    assert found[len(found) - len(sent) :] == sent
    assert reader.bad == whole.bad


def test_an_endless_frame_takes_no_memory_and_the_next_is_found() -> None:
    splitter = FrameSplitter(100)
    for _ in range(1000):
        assert splitter.feed(b"x" * 99) == []
    assert splitter.feed(b"\0ab\0") == [b"ab"]
    assert splitter.overlong == 1


@pytest.mark.parametrize("kind", Kind)
def test_a_payload_of_another_length_is_refused(kind: Kind) -> None:
    fixed, item = SHAPES[kind]
    for length in {fixed - 1, fixed + (item + 1 if item != 1 else MAX_PAYLOAD)} - {-1}:
        body = struct.pack("<BI", kind, 1) + bytes(length)
        with pytest.raises(PacketError, match=kind.name):
            decode(cobs_encode(body + struct.pack("<I", zlib.crc32(body))))
        with pytest.raises(PacketError, match=kind.name):
            encode(Packet(kind, 1, bytes(length)))


def test_every_message_comes_back_from_its_bytes() -> None:
    found = Capabilities(1, 6, 6, 42, 8000, 16, 4000, 256, 4096, 100.0, 0.5, 1.0, 200, 50, 9, 3, "ä board")
    ack = Ack(9, 4, 2**40, 5, 2**33, 2**33 - 1, State.PLAYING, Flag.GAP, 1, 2, 3, 2**50)
    tones = Tones(5, 1, 9, (WireTone(1.5, 133.0, 0.25), WireTone(0.5, 266.0, -1.0)))
    assert Capabilities.of(found.packet()) == found
    assert Ack.of(ack.packet()) == ack
    for kept in (0, 1, 2**32 - 1):
        assert Ack.of(replace(ack, kept=kept).packet()) == replace(ack, kept=kept)
    # What a later version adds behind is passed over.
    longer = Packet(Kind.ACK, 0, replace(ack, kept=5).packet().payload + bytes(8))
    assert Ack.of(longer) == replace(ack, kept=5)
    assert Marked.of(Marked(3, 2**40, 2**50).packet()) == Marked(3, 2**40, 2**50)
    assert Refused.of(Refused(8, "nö").packet()) == Refused(8, "nö")
    for message in (
        StartMessage(9, True, 8000, 2**40, b"note"),
        LinkCoupling(2**40, 5, 100, (0, 65535, 3)),
        Bias(7, 41, 3, -12.5),
        tones,
        Mark(2**40, 8, b"x"),
    ):
        assert type(message).of(message.packet(77)) == message
        assert message.packet(77).number == 77
    samples = SamplesMessage(2**40, np.array([[1, -2], [32767, -32767]], dtype=np.int16))
    back = SamplesMessage.of(samples.packet(1), 2)
    assert back is not None
    assert back.first == samples.first
    np.testing.assert_array_equal(back.codes, samples.codes)
    assert SamplesMessage.of(samples.packet(1), 3) is None
    full = SamplesMessage(0, np.zeros((SamplesMessage.most(42, MAX_PAYLOAD), 42), dtype=np.int16))
    assert MAX_PAYLOAD - 84 < len(full.packet(0).payload) <= MAX_PAYLOAD


def test_an_ack_of_an_unknown_state_is_no_ack() -> None:
    ack = Ack(9, 4, 1, 5, 1, 1, State.PLAYING, Flag(0), 1, 2, 3, 4).packet()
    spoiled = bytearray(ack.payload)
    spoiled[36] = 200
    assert Ack.of(Packet(Kind.ACK, 0, bytes(spoiled))) is None


def test_the_protocol_page_says_what_the_codec_does() -> None:
    page = (ROOT / "drivers" / "PROTOCOL.md").read_text(encoding="utf-8")
    (heartbeat,) = re.findall(r"A HEARTBEAT, whole: `([0-9A-F ]+)`", page)
    assert bytes.fromhex(heartbeat) == encode(Packet(Kind.HEARTBEAT))
    assert f"{zlib.crc32(b'123456789'):08X}" in page
    rows = re.findall(r"^\| ([0-9a-f]{2}) \| (\w+)(, ordered)? \| .* \| (\d+)(?: \+ \d*k)? \|$", page, re.MULTILINE)
    assert {name for _, name, *_ in rows} == set(Kind.__members__)
    for code, name, ordered, fixed in rows:
        kind = Kind[name]
        assert (int(code, 16), bool(ordered), int(fixed)) == (kind, kind in ORDERED, SHAPES[kind].fixed), name
    items = dict(re.findall(r"^\| \w+ \| (\w+)(?:, ordered)? \| .* \| \d+ \+ (\d*k) \|$", page, re.MULTILINE))
    assert items == {
        kind.name: "k" if shape.item == 1 else f"{shape.item}k" for kind, shape in SHAPES.items() if shape.item
    }
    for state in State:
        assert f"{state.value} {state.name.lower()}" in page


class Verdict(NamedTuple):
    """What a decoder makes of a case."""

    packets: list[Packet]
    bad: int


def python_verdict(case: bytes) -> Verdict:
    reader = PacketReader()
    found = reader.feed(case + b"\0")
    return Verdict(found, reader.bad)


@pytest.fixture(scope="module")
def harness(tmp_path_factory: pytest.TempPathFactory) -> Path:
    gcc = shutil.which("gcc")
    if gcc is None:
        pytest.skip("the C decoder is checked where there is a gcc")
    out = tmp_path_factory.mktemp("harness") / "decoder"
    command = [gcc, "-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror", *SANITIZERS]
    source = ROOT / "tests" / "data" / "decoder_harness.c"
    subprocess.run([*command, "-I", ROOT / "drivers" / "firmware", source, "-o", out], check=True, timeout=600)
    return out


def c_verdicts(harness: Path, cases: Iterable[bytes]) -> Iterator[Verdict]:
    """Also checks that the C encoder makes the same bytes of every packet it found."""
    sent = b"".join(struct.pack("<I", len(case)) + case for case in cases)
    ran = subprocess.run([harness], input=sent, capture_output=True, check=False, timeout=900)
    assert ran.returncode == 0, ran.stderr.decode()
    out, at, found = ran.stdout, 0, []
    while at < len(out):
        if out[at]:
            kind, number, length = struct.unpack_from("<BII", out, at + 1)
            packet = Packet(Kind(kind), number, out[at + 10 : at + 10 + length])
            at += 10 + length
            (size,) = struct.unpack_from("<I", out, at)
            assert out[at + 4 : at + 4 + size] == encode(packet)
            found.append(packet)
            at += 4 + size
        else:
            yield Verdict(found, struct.unpack_from("<I", out, at + 1)[0])
            found = []
            at += 5


def hostile(count: int, seed: int) -> Iterator[tuple[bytes, set[Packet]]]:
    """Random bytes, mutated packets and splices, each with the packets that may honestly be in it."""
    chance = random.Random(seed)
    kinds = list(Kind)

    def packet() -> Packet:
        kind = chance.choice(kinds)
        fixed, item = SHAPES[kind]
        size = fixed + (item * chance.randrange(60) if item else 0)
        data = chance.randbytes(size) if chance.random() < 0.5 else bytes(size)
        return Packet(kind, chance.getrandbits(32), data)

    def mutated(wire: bytearray) -> bytes:
        for _ in range(chance.randrange(1, 4)):
            at, how = chance.randrange(len(wire)), chance.randrange(4)
            if how == 0:
                wire[at] ^= 1 << chance.randrange(8)
            elif how == 1:
                wire[at] = chance.choice((0, 1, 2, 254, 255))
            elif how == 2:
                del wire[at : at + chance.randrange(1, 4)]
                wire += b"\1" if not wire else b""
            else:
                wire[at:at] = chance.randbytes(chance.randrange(1, 4))
        return bytes(wire)

    for _ in range(count):
        kind = chance.randrange(4)
        if kind == 0:
            yield chance.randbytes(chance.randrange(80)), set()
        elif kind == 1:
            body = chance.randbytes(chance.randrange(1, 60))
            # Well-formed and sealed, but with a random kind and length.
            sealed = body + struct.pack("<I", zlib.crc32(body))
            honest = {decode(cobs_encode(sealed))} if whole(sealed) else set()
            yield cobs_encode(sealed), honest
        else:
            sent = [packet() for _ in range(chance.randrange(1, 3))]
            yield mutated(bytearray(b"".join(map(encode, sent)))), set(sent)


def whole(sealed: bytes) -> bool:
    """Whether random bytes with a right seal are a packet, by the page: kind known and length right."""
    if len(sealed) < 9 or sealed[0] not in Kind.__members__.values():
        return False
    fixed, item = SHAPES[Kind(sealed[0])]
    items = len(sealed) - 9 - fixed
    return items % item == 0 and items >= 0 if item else items == 0


def compare(harness: Path, count: int, seed: int) -> int:
    cases = list(hostile(count, seed))
    accepted = 0
    for (case, honest), there in zip(cases, c_verdicts(harness, (case for case, _ in cases)), strict=True):
        here = python_verdict(case)
        assert here == there, case.hex()
        # A false packet needs a fitting CRC-32: one chance in 2^32 for each.
        assert set(here.packets) <= honest, case.hex()
        accepted += len(here.packets)
    return accepted


def test_both_codecs_agree_on_hostile_bytes(harness: Path) -> None:
    assert compare(harness, 20_000, 1) > 1000


@pytest.mark.slow
def test_both_codecs_agree_on_a_million_hostile_strings(harness: Path) -> None:
    accepted = sum(compare(harness, 50_000, seed) for seed in range(100, 120))
    assert accepted > 50_000


def test_both_codecs_agree_on_packets_of_every_size(harness: Path) -> None:
    rng = np.random.default_rng(5)
    sent = [Packet(Kind.MARK, n, rng.integers(0, 3, 12 + n, dtype=np.uint8).tobytes()) for n in range(600)]
    sent += [Packet(Kind.MARK, n, bytes([1]) * (12 + n)) for n in (*range(200, 1100), MAX_PAYLOAD - 12)]
    sent += [Packet(Kind.MARK, n, bytes(12 + n)) for n in (254, 508, MAX_PAYLOAD - 12)]
    cases = [encode(packet) for packet in sent]
    # One byte too many for the decoder's room, and a frame that never seems to end.
    cases += [cobs_encode(bytes([20]) * (MAX_PAYLOAD + 10)), bytes([7]) * 20_000]
    for case, there in zip(cases, c_verdicts(harness, cases), strict=True):
        assert there == python_verdict(case)
    assert [v.packets for v in c_verdicts(harness, cases)] == [[packet] for packet in sent] + [[], []]
