"""The firmware of drivers/firmware built for tests, and run with its time given."""

from __future__ import annotations

import shutil
import struct
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Self

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.protocol.keys import KeyEvent

ROOT = Path(__file__).parents[2] / "drivers" / "firmware"
SANITIZED = "-O1 -g -fsanitize=address,undefined -fno-sanitize-recover=all"
LIMIT_S = 600


@dataclass(frozen=True)
class Grid:
    """What the records of a build look like: its name in boards/, rows, links a row and channels."""

    name: str
    rows: int
    links: int
    channels: int
    rate_hz: int


TRIAL = Grid("trial", 2, 2, 2, 8000)
PAPER = Grid("paper_6x6", 6, 5, 42, 8000)
LINKED = Grid("linked_6x6", 6, 5, 6, 24000)


@dataclass(frozen=True)
class Answer:
    """What came back of one request: bytes, output codes (int16, (S, channels)) and links (int64, (S, rows, links))."""

    sent: bytes
    codes: NDArray[np.int16]
    links: NDArray[np.int64]


@dataclass(frozen=True)
class Request:
    """Time goes on to `now_us`, keys go down or up, then `data` comes."""

    now_us: int
    data: bytes = b""
    keys: tuple[KeyEvent, ...] = ()

    def packed(self) -> bytes:
        """As a build with its time given reads it."""
        keys = [key.wire for key in self.keys]
        return struct.pack(f"<QII{len(keys)}H", self.now_us, len(self.data), len(keys), *keys) + self.data


OFF_AND_ON = struct.pack("<QII", 0, 0xFFFFFFFF, 0)


def need(*programs: str) -> None:
    """Skip the test where one of these is not installed."""
    for program in programs:
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed")


@lru_cache
def _folder() -> Path:
    folder = tempfile.TemporaryDirectory(prefix="dotwave-firmware-")
    _KEPT.append(folder)
    return Path(folder.name)


_KEPT: list[tempfile.TemporaryDirectory[str]] = []


@lru_cache
def built(target: str, grid: str, options: str = "", flags: str = "") -> Path:
    """The program that `make TARGET GRID=grid` makes."""
    need("make", "cc")
    if target.startswith("cortex-m"):
        need("arm-none-eabi-gcc")
    out = _folder() / f"{abs(hash((options, flags))):x}"
    command = ["make", "-s", "-C", str(ROOT), target, f"GRID={grid}", f"OUT={out}", f"OPTIONS={options}"]
    done = subprocess.run(
        [*command, *([f"CFLAGS={flags}"] if flags else [])],
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return out / target / (grid if target in ("posix", "given", "read-pack") else f"{grid}.elf")


class GivenProgram:
    """The POSIX build whose time is given, request by request."""

    def __init__(self, program: Path, grid: Grid) -> None:
        self._grid = grid
        self._links = np.zeros((grid.rows, grid.links), dtype=np.int64)
        self._process = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.close()
        self._process.stdout.close()
        assert self._process.wait(LIMIT_S) == 0

    def restart(self) -> None:
        """Switch the controller off and on."""
        assert self._process.stdin
        self._process.stdin.write(OFF_AND_ON)
        self._links[:] = 0

    def ask(self, request: Request) -> Answer:
        """One request and its answer."""
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.write(request.packed())
        self._process.stdin.flush()
        return _answer(self._process.stdout.read, self._grid, self._links)


def run_in_emulator(image: Path, grid: Grid, talks: Sequence[Sequence[Request]], folder: Path) -> list[list[Answer]]:
    """All requests at once to the Cortex-M image whose time is given, under QEMU; it is restarted before each talk."""
    need("qemu-system-arm")
    asked, answered = folder / "requests", folder / "answers"
    asked.write_bytes(b"".join(OFF_AND_ON + b"".join(one.packed() for one in talk) for talk in talks))
    config = f"enable=on,target=native,arg=given,arg={asked},arg={answered}"
    command = ["qemu-system-arm", "-M", "mps2-an386", "-display", "none", "-serial", "none", "-monitor", "none"]
    done = subprocess.run(
        [*command, "-semihosting-config", config, "-kernel", image], capture_output=True, timeout=LIMIT_S, check=False
    )
    assert done.returncode == 0, done.stderr
    with answered.open("rb") as file:
        return [_answers(file.read, grid, len(talk)) for talk in talks]


def _answers(read: Callable[[int], bytes], grid: Grid, count: int) -> list[Answer]:
    links = np.zeros((grid.rows, grid.links), dtype=np.int64)
    return [_answer(read, grid, links) for _ in range(count)]


def _answer(read: Callable[[int], bytes], grid: Grid, links: NDArray[np.int64]) -> Answer:
    sent = read(struct.unpack("<I", read(4))[0])
    codes, all_links = [], []
    for _ in range(struct.unpack("<I", read(4))[0]):
        for _ in range(read(1)[0]):
            row = read(1)[0]
            links[row] = np.frombuffer(read(2 * grid.links), dtype="<u2")
        codes.append(np.frombuffer(read(2 * grid.channels), dtype="<i2"))
        all_links.append(links.copy())
    if not codes:
        return Answer(sent, np.zeros((0, grid.channels), np.int16), np.zeros((0, *links.shape), np.int64))
    return Answer(sent, np.stack(codes), np.stack(all_links))


def hear(target: str, grid: str, *words: Path | str) -> subprocess.CompletedProcess[str]:
    """What a program of the firmware says, its reads and writes watched."""
    program = built(target, grid, flags=SANITIZED)
    return subprocess.run(
        [program, *words], capture_output=True, text=True, timeout=LIMIT_S, check=False, errors="replace"
    )
