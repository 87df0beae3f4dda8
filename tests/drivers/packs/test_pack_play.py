"""A firmware plays from packs, in its memory or sent by a host, and what goes out is felt as the pack says."""

from __future__ import annotations

import subprocess
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import dotwave as dw
from drivers import Pack, read_waveform, write_pack
from drivers.packs.opened import PackSession
from drivers.packs.sounding import PackSamples
from drivers.protocol.faults import Faults
from drivers.protocol.vectors import write_vectors
from tests.drivers.protocol.test_firmware import FirmwareBench
from tests.support.firmware import LINKED, PAPER, SANITIZED, GivenProgram, built, need

GRIDS = {"paper-6x6": PAPER, "linked-6x6": LINKED}
ROOM = "-DDW_BUFFER_SAMPLES=0u -DDW_EVENT_SLOTS=1024u -DDW_MAX_PAYLOAD=512u"
SAMPLES = Path(__file__).parents[3] / "samples" / "icons"


@pytest.fixture(scope="module")
def hello(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """ "Hello world" for each device, as a pack."""
    folder = tmp_path_factory.mktemp("hello")
    for device in GRIDS:
        write_pack(dw.plan(dw.text("Hello world", device), device), folder / f"{device}.dwp")
    return {device: folder / f"{device}.dwp" for device in GRIDS}


def played(device: str, pack: Path, name: str, folder: Path, flags: str = "") -> Path:
    """What the firmware on POSIX puts out of an entry, as a waveform."""
    record, program = folder / "record", built("posix", GRIDS[device].name, flags=flags)
    done = subprocess.run(
        [program, "--pack", pack, "--icon", name, "--record", record],
        capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    manifest, reader = read_waveform(pack, name)
    assert write_vectors(record, manifest, folder / "played.wav") == reader.samples
    return folder / "played.wav"


@pytest.mark.parametrize("device", GRIDS)
def test_a_firmware_plays_from_its_memory(device: str, hello: dict[str, Path], tmp_path: Path) -> None:
    felt = dw.verify(played(device, hello[device], device, tmp_path, SANITIZED))
    assert (felt.ok, felt.text) == (True, "Hello world")
    assert sum(frame.wrong_dots for frame in felt.frames) == 0


def test_what_it_cannot_play_is_told_in_a_line(hello: dict[str, Path], tmp_path: Path) -> None:
    program = built("posix", PAPER.name, flags=SANITIZED)
    spoiled = tmp_path / "spoiled.dwp"
    spoiled.write_bytes(hello["paper-6x6"].read_bytes()[:-1])
    for pack, name, why in (
        (hello["paper-6x6"], "nothing", "has no icon of this name"), (spoiled, "paper-6x6", "is no whole pack"),
        (tmp_path / "nowhere.dwp", "x", "is no whole pack"), (hello["linked-6x6"], "linked-6x6", "is for another grid"),
    ):  # fmt: skip
        done = subprocess.run(
            [program, "--pack", pack, "--icon", name], capture_output=True, text=True, timeout=100, check=False
        )
        assert (done.returncode, done.stderr) == (1, f"{pack} {name}: the pack {why}\n")


@pytest.mark.parametrize("device", GRIDS)
def test_a_host_sends_the_events_of_a_pack(device: str, hello: dict[str, Path]) -> None:
    manifest, reader = read_waveform(hello[device])
    assert isinstance(reader, PackSamples)
    session, grid = PackSession(manifest, reader), GRIDS[device]
    with GivenProgram(built("given", grid.name, ROOM), grid) as program:
        bench = FirmwareBench(partial(session.messages, session=7), program, Faults(drop=0.01))
        bench.run(10.0)
    assert bench.session.report.underruns == 0
    codes = np.concatenate([answer.codes for answer in bench.answers])
    drawn = np.concatenate(list(reader.blocks(4096))) * (32767 / manifest.device.amplifier.volts)
    # A few thousand vectors tell with which of them the session began.
    middle = slice(len(drawn) // 2, len(drawn) // 2 + 3000)
    found = [
        np.abs(codes[first + middle.start : first + middle.stop] - drawn[middle]).max()
        for first in range(len(codes) - len(drawn) + 1)
    ]
    began = int(np.argmin(found))
    assert np.abs(codes[began : began + len(drawn)] - drawn).max() <= 3


@pytest.mark.slow
@pytest.mark.parametrize("device", GRIDS)
def test_the_twenty_icons_are_felt_from_a_pack(device: str, tmp_path: Path, dotwave) -> None:
    pack = tmp_path / "icons.dwp"
    assert dotwave("icons", SAMPLES, "-d", device, "-o", tmp_path / "out", "--pack", pack).code == 0
    names = list(Pack(pack).names())
    assert len(names) == 20
    for name in names:
        felt = dw.verify(played(device, pack, name, tmp_path))
        assert felt.ok, (name, felt.as_text())
        assert sum(frame.wrong_dots for frame in felt.frames) == 0


@pytest.mark.slow
@pytest.mark.parametrize("device", GRIDS)
def test_an_emulated_cortex_m_plays_from_its_memory(device: str, hello: dict[str, Path], tmp_path: Path) -> None:
    need("qemu-system-arm")
    record, image = tmp_path / "record", built("cortex-m", GRIDS[device].name)
    config = f"enable=on,target=native,arg=dotwave,arg={record},arg={device}"
    loaded = f"loader,file={hello[device]},addr=0x21000000,force-raw=on"
    command = ["qemu-system-arm", "-M", "mps2-an386", "-display", "none", "-monitor", "none", "-serial", "none"]
    done = subprocess.run(
        [*command, "-semihosting-config", config, "-device", loaded, "-kernel", image],
        capture_output=True, timeout=900, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    manifest, reader = read_waveform(hello[device])
    assert write_vectors(record, manifest, tmp_path / "played.wav") == reader.samples
    felt = dw.verify(tmp_path / "played.wav")
    assert (felt.ok, felt.text) == (True, "Hello world")
    assert sum(frame.wrong_dots for frame in felt.frames) == 0
