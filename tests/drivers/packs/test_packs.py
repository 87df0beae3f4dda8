"""Packs: what is drawn of them is the plan, they are small, a name is found without the rest, and damage is told."""

from __future__ import annotations

import random
import struct
import zlib
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import dotwave as dw
from chainsim import Device, load_device
from drivers import (
    DriverError,
    FileError,
    LimitError,
    NotInPack,
    Pack,
    PackWriter,
    UnreadableWaveform,
    WaveformError,
    read_waveform,
    write_pack,
)
from drivers.packs.layout import Header
from drivers.packs.opened import PackSession
from drivers.packs.sounding import PackSamples
from drivers.protocol.envelope import Envelope
from drivers.protocol.messages import Links, Mark, StartMessage
from drivers.protocol.outgoing import End
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import Plan, plan_scene
from tests.support.firmware import hear
from tests.support.wire import capabilities_of

TEXT = "Hello world, it rains again and nobody is out"
DEVICES = ("paper-6x6", "linked-6x6")


@pytest.fixture(scope="module")
def texts(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A text for each device, as a pack."""
    folder = tmp_path_factory.mktemp("texts")
    for device in DEVICES:
        write_pack(dw.plan(dw.text(TEXT, device), device), folder / f"{device}.dwp")
    return {device: folder / f"{device}.dwp" for device in DEVICES}


@cache
def profile(device: str) -> Device:
    return load_device(device)


def icon_plan(device: str, dots: np.ndarray) -> Plan:
    frame = Frame(TargetPattern(dots.astype(complex)), dwell_s=1.0)
    return plan_scene(Scene(GridShape(6, 6), (frame,), {"kind": "icon"}), profile(device))


def icons(device: str, count: int, path: Path, seed: int = 1) -> Path:
    """A pack of so many icons of dots at random."""
    writer, chance = PackWriter(load_device(device)), np.random.default_rng(seed)
    for number in range(count):
        plan = icon_plan(device, chance.random((6, 6)) < 0.4)
        writer.add(plan, f"icon {number:04}", spoken=f"number {number}", code_point=0xE000 + number)
    with path.open("wb") as file:
        writer.write(file, path)
    return path


@pytest.mark.parametrize("device", DEVICES)
def test_what_is_drawn_is_what_was_planned(device: str, texts: dict[str, Path]) -> None:
    _, reader = read_waveform(texts[device])
    drawn = np.concatenate(list(reader.blocks(1000)))
    planned = np.concatenate(list(dw.plan(dw.text(TEXT, device), device).waveform().blocks(4096)))
    assert drawn.shape == planned.shape == (reader.samples, drawn.shape[1])
    assert np.abs(drawn - planned).max() <= 2e-7 * load_device(device).amplifier.volts
    np.testing.assert_array_equal(drawn, np.concatenate(list(reader.blocks(7777))))


@pytest.mark.parametrize("device", DEVICES)
def test_a_text_is_felt_as_from_samples(device: str, texts: dict[str, Path]) -> None:
    felt = dw.verify(texts[device])
    assert (felt.ok, felt.text) == (True, TEXT)
    assert max(frame.amplitude_error for frame in felt.frames) <= 0.02


@pytest.mark.parametrize(("device", "share"), [("paper-6x6", 1 / 500), ("linked-6x6", 1 / 9)])
def test_a_text_takes_little(device: str, share: float, texts: dict[str, Path]) -> None:
    manifest, reader = read_waveform(texts[device])
    assert texts[device].stat().st_size <= share * 4 * reader.samples * len(manifest.channels)


def test_the_same_plan_gives_the_same_bytes(texts: dict[str, Path], tmp_path: Path) -> None:
    again = tmp_path / "paper-6x6.dwp"
    write_pack(dw.plan(dw.text(TEXT, "paper-6x6"), "paper-6x6"), again)
    assert again.read_bytes() == texts["paper-6x6"].read_bytes()


def test_what_was_there_before_takes_no_room(tmp_path: Path) -> None:
    sizes = []
    for times in (1, 2):
        path, words = tmp_path / f"{times}.dwp", " ".join(["again and again"] * times * 5)
        write_pack(dw.plan(dw.text(words, "linked-6x6"), "linked-6x6"), path)
        sizes.append(path.stat().st_size)
    assert sizes[1] < 1.02 * sizes[0]


def test_the_manifest_is_that_of_the_waveform(texts: dict[str, Path], tmp_path: Path) -> None:
    wave = tmp_path / "out.wav"
    dw.plan(dw.text(TEXT, "linked-6x6"), "linked-6x6").waveform().write(wave)
    written, packed = read_waveform(wave)[0], read_waveform(texts["linked-6x6"])[0]
    assert (packed.device, packed.channels, packed.encoding) == (written.device, written.channels, written.encoding)
    assert packed.samples == written.samples
    for mine, its in zip(packed.frames, written.frames, strict=True):
        assert (mine.text, mine.cells, mine.page, mine.span, mine.moving, mine.outcome) == (
            its.text, its.cells, its.page, its.span, its.moving, its.outcome,
        )  # fmt: skip
        np.testing.assert_allclose(mine.target, its.target, rtol=1e-6)
        np.testing.assert_array_equal(mine.wish.level, its.wish.level)
        np.testing.assert_array_equal(mine.omega, its.omega)
        assert (mine.start_s, mine.end_s) == pytest.approx((its.start_s, its.end_s), abs=1e-9)
        assert 0 <= mine.settled_s - its.settled_s <= 1 / written.rate_hz


def test_a_session_of_a_pack_goes_by_time_and_draws_what_the_pack_does(texts: dict[str, Path]) -> None:
    manifest, reader = read_waveform(texts["linked-6x6"])
    assert isinstance(reader, PackSamples)
    session = PackSession(manifest, reader)
    start, *events, end = session.messages(capabilities_of(manifest.device), session=7)
    assert isinstance(start, StartMessage)
    assert isinstance(end, End)
    assert (start.parametric, start.total, end.total) == (True, reader.samples, reader.samples)
    times = [event.at for event in events if isinstance(event, Envelope | Links | Mark)]
    assert times == sorted(times)
    assert len(times) == len(events)
    assert sum(isinstance(event, Mark) for event in events) == len(manifest.frames)
    assert sum(isinstance(event, Envelope) for event in events) == session.pieces
    assert sum(isinstance(event, Links) for event in events) == len(manifest.coupling)


def test_a_name_is_found_by_few_looks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pack = Pack(icons("paper-6x6", 60, tmp_path / "icons.dwp"))
    looks, plain = list[int](), Pack._name

    def counted(self: Pack, index: int) -> bytes:
        looks.append(index)
        return plain(self, index)

    monkeypatch.setattr(Pack, "_name", counted)
    for number in range(60):
        looks.clear()
        entry = pack.find(f"icon {number:04}")
        assert (entry.spoken, entry.code_point) == (f"number {number}", 0xE000 + number)
        assert len(looks) <= 7
    target = pack.target("icon 0007")
    np.testing.assert_array_equal(target.amplitude.real, pack.pattern(pack.find("icon 0007")))
    assert target.weight is None or (np.asarray(target.weight) == 1).all()
    with pytest.raises(NotInPack, match="it has no 'icon 1'; like it: icon 0"):
        pack.find("icon 1")
    with pytest.raises(NotInPack, match="it has 60 icons; name one with --icon, such as icon 0000"):
        read_waveform(pack.path)


def test_an_icon_of_a_pack_is_its_pattern(tmp_path: Path) -> None:
    path = icons("linked-6x6", 3, tmp_path / "icons.dwp")
    pack = Pack(path)
    for name in pack.names():
        felt = dw.verify(path, icon=name)
        assert felt.ok
        wanted = pack.pattern(pack.find(name))
        np.testing.assert_array_equal(felt.frames[0].amplitude >= 0.5, wanted >= 0.5)


@pytest.mark.slow
@pytest.mark.parametrize(("device", "most_bytes"), [("paper-6x6", 2_000_000), ("linked-6x6", 10_000_000)])
def test_five_thousand_icons_take_little(device: str, most_bytes: int, tmp_path: Path) -> None:
    path = icons(device, 5000, tmp_path / "icons.dwp")
    assert path.stat().st_size <= most_bytes
    pack = Pack(path)
    for number in random.Random(1).sample(range(5000), 3):
        assert dw.verify(path, icon=pack.entry(number).name).ok


def test_two_of_one_name_and_nothing_at_all_are_refused(tmp_path: Path) -> None:
    writer = PackWriter(load_device("paper-6x6"))
    with (tmp_path / "empty.dwp").open("wb") as file, pytest.raises(WaveformError, match="nothing can be put"):
        writer.write(file, tmp_path / "empty.dwp")
    plan = icon_plan("paper-6x6", np.eye(6))
    writer.add(plan, "eye")
    with pytest.raises(WaveformError, match="eye: there are two of this name"):
        writer.add(plan, "eye")
    with pytest.raises(WaveformError, match="too long"):
        writer.add(plan, "x" * 70000)


def test_more_than_the_amplifier_gives_is_refused(tmp_path: Path) -> None:
    plan = icon_plan("paper-6x6", np.eye(6))
    frames = list(plan.frames)
    state = frames[0].states[0]
    loud = replace(frames[0], states=(replace(state, bias=10 * state.bias), *frames[0].states[1:]))
    with pytest.raises(LimitError, match=r"channel 6 .*over the amplifier's 100 V"):
        write_pack(replace(plan, frames=[loud]), tmp_path / "loud.dwp")
    assert not list(tmp_path.iterdir())


def test_a_file_that_is_no_pack_is_told_in_a_line(tmp_path: Path, texts: dict[str, Path]) -> None:
    whole, path = texts["paper-6x6"].read_bytes(), tmp_path / "spoiled.dwp"
    for spoiled, why in (
        (b"", "no pack"), (b"RIFF" * 40, "no pack"), (whole[:50], "no pack"), (whole[:-1], "not whole"),
        (whole[:8] + b"\x02" + whole[9:], "version 2"), (whole[:30] + b"\x09" + whole[31:], "damaged"),
        (whole[:200] + bytes([whole[200] ^ 1]) + whole[201:], "damaged"),
    ):  # fmt: skip
        path.write_bytes(spoiled)
        with pytest.raises(UnreadableWaveform, match=rf"spoiled\.dwp: .*{why}"):
            read_waveform(path)
    with pytest.raises(FileError, match=r"only a pack \(\.dwp\) has icons"):
        read_waveform(tmp_path / "hello.wav", "heart")


def sealed(raw: bytearray) -> bytes:
    """With checks that are right for what is in it now."""
    raw[52:56] = struct.pack("<I", zlib.crc32(raw[Header.size :]))
    raw[56:60] = struct.pack("<I", zlib.crc32(raw[:56]))
    return bytes(raw)


def hostile(whole: bytes, count: int, seed: int) -> list[bytes]:
    """Packs with some numbers of theirs overwritten, and checks that are right all the same."""
    chance, found = random.Random(seed), []
    for _ in range(count):
        raw = bytearray(whole)
        for _ in range(chance.choice([1, 1, 2, 5])):
            size = chance.choice([1, 2, 4, 8])
            top = chance.choice([Header.size, len(raw), len(raw)])
            at = chance.randrange(10, top - 8) if chance.random() < 0.6 else len(raw) - 8 - chance.randrange(60)
            raw[at : at + size] = chance.choice(
                [chance.randbytes(size), b"\xff" * size, bytes(size), (len(raw) - 1).to_bytes(8, "little")[:size]]
            )
        raw[48:52] = struct.pack("<I", len(raw))
        found.append(sealed(raw))
    return found


def test_hostile_packs_end_in_a_line(tmp_path: Path) -> None:
    whole, path = icons("linked-6x6", 2, tmp_path / "icons.dwp").read_bytes(), tmp_path / "hostile.dwp"
    said = []
    for raw in hostile(whole, 300, seed=5):
        path.write_bytes(raw)
        try:
            manifest, reader = read_waveform(path, "icon 0001")
            assert isinstance(reader, PackSamples)
            if reader.samples < 1 << 20:
                for block in reader.blocks(4096):
                    assert np.isfinite(block).all()
                list(PackSession(manifest, reader).messages(capabilities_of(manifest.device), session=1))
        except DriverError as error:
            said.append(str(error))
    assert len(said) > 100
    assert not any("\n" in one for one in said)


def test_the_reader_in_c_finds_the_same(tmp_path: Path) -> None:
    path = icons("linked-6x6", 9, tmp_path / "icons.dwp")
    pack, told = Pack(path), hear("read-pack", "linked_6x6", path)
    assert told.returncode == 0
    lines = iter(told.stdout.splitlines())
    for name in pack.names():
        entry = pack.find(name)
        title, spoken, code_point, pattern = next(lines).split("|")
        assert (title, spoken, int(code_point, 16)) == (name, entry.spoken, entry.code_point)
        assert [int(one) / 100 for one in pattern.split()] == pack.pattern(entry).ravel().tolist()
        for frame in pack.frames(entry).tolist():
            settled, samples, parts, pieces, _ = map(int, next(lines).split())
            ways = [pack.way(at) for at in frame[2]]
            assert (settled, samples) == frame[:2]
            assert parts == sum(len(way.channels) + (way.links is not None) for way in ways)
            curves = [len(pack.curve(at).at) for way in ways for _, at in way.channels]
            links = [len(pack.link_curve(way.links).at) for way in ways if way.links is not None]
            assert pieces == sum(curves) + sum(links)


def test_hostile_packs_lead_the_reader_in_c_nowhere(tmp_path: Path) -> None:
    whole = icons("paper-6x6", 2, tmp_path / "icons.dwp").read_bytes()
    paths = []
    for number, raw in enumerate(hostile(whole, 1500, seed=6)):
        paths.append(tmp_path / f"{number}.dwp")
        paths[-1].write_bytes(raw)
    told = hear("read-pack", "paper_6x6", *paths)
    assert (told.returncode, told.stderr) == (1, "")


def test_links_downwards_are_refused() -> None:
    with pytest.raises(WaveformError, match="linked-grid-6x6: a pack sets links along rows only"):
        PackWriter(load_device("linked-grid-6x6"))
