"""Real clients of the bridges, brltty and python3-brlapi, and a session on a thread with a grid that only listens."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from dotwave.bridges.grid_fold import GridFold
from dotwave.bridges.port import WindowPort
from dotwave.bridges.session import LiveSession
from dotwave.bridges.session_file import SessionWriter
from dotwave.bridges.window import Key
from encoders import Frame, TargetPattern

SYSTEM_PYTHON = "/usr/bin/python3"
PATIENCE_S = 30.0
# No client is to find a server of this machine: its own socket comes before any port.
_BRLAPI = Path("/usr/lib/python3/dist-packages")

needs_brltty = pytest.mark.skipif(shutil.which("brltty") is None, reason="brltty is not installed (apt install brltty)")
needs_brlapi = pytest.mark.skipif(
    not any(_BRLAPI.glob("brlapi*.so")), reason="brlapi is not installed (apt install python3-brlapi)"
)

CLIENT = """
import brlapi, json, sys
connection = brlapi.Connection(**{key: value.encode() for key, value in json.loads(sys.argv[1]).items()})
for line in sys.stdin:
    name, *words = json.loads(line)
    try:
        if name == "write":
            written = brlapi.WriteStruct()
            for key, value in words[0].items():
                setattr(written, key, value.encode("latin-1") if key in ("attrAnd", "attrOr") else value)
            answer = connection.write(written)
        elif name == "get":
            answer = getattr(connection, words[0])
            answer = answer.decode() if isinstance(answer, bytes) else answer
        elif name == "priority":
            answer = connection.setParameter(brlapi.PARAM_CLIENT_PRIORITY, 0, False, words[0])
        else:
            answer = getattr(connection, name)(*words)
        print(json.dumps({"answer": answer}), flush=True)
    except Exception as error:
        print(json.dumps({"error": str(error)}), flush=True)
"""

# Written to, it is read by BRLTTY's screen driver lx.
CONSOLE, CONSOLE_CELLS = Path("/dev/tty1"), Path("/dev/vcsa1")
needs_console = pytest.mark.skipif(
    not (os.access(CONSOLE, os.W_OK) and os.access(CONSOLE_CELLS, os.R_OK)), reason="no text console is readable here"
)


def until(found: Callable[[], Any], what: object = "") -> Any:
    """Wait for what another process brings about; what it is decides, not when."""
    end = time.monotonic() + PATIENCE_S
    while not (value := found()):
        assert time.monotonic() < end, f"it never came: {what}"
        time.sleep(0.002)
    return value


@dataclass
class ListeningGrid:
    """Stands what it is shown at once."""

    shown_cells: list[str] = field(default_factory=list)
    held: int = 0
    stands: Frame | None = None
    waiting: bool = False
    latency_s: float | None = None
    refused: str = ""

    @property
    def state(self) -> ListeningGrid:
        return self

    @property
    def shown(self) -> int:
        return len(self.shown_cells)

    @property
    def resting(self) -> bool:
        return self.held > 0

    def show(self, what: str, note: str | None = None) -> None:
        self.held = 0
        self.latency_s = 0.0
        self.stands = Frame(TargetPattern(None), 1.0, text=note or "", cells=what)  # type: ignore[arg-type]
        self.shown_cells.append(what)

    def hold(self) -> None:
        self.held += 1
        self.stands = None

    @property
    def last(self) -> str:
        return self.shown_cells[-1] if self.shown_cells else ""


@dataclass
class RunningSession:
    """A session that runs on a thread of its own."""

    session: LiveSession
    grid: ListeningGrid
    loop: asyncio.AbstractEventLoop

    def press(self, words: str) -> None:
        self.loop.call_soon_threadsafe(self.session.press, Key.of(words))


@contextmanager
def running(
    port: WindowPort, fold: GridFold, *, writer: SessionWriter | None = None, **options: Any
) -> Iterator[RunningSession]:
    """Run a session until the body is done; what goes wrong in it fails the test."""
    grid = ListeningGrid()
    session = LiveSession(port, grid, fold, blink=options.pop("blink", False), writer=writer, **options)
    opened, wrong, parts = threading.Event(), list[BaseException](), dict[str, Any]()

    async def run() -> None:
        parts["loop"], parts["task"] = asyncio.get_running_loop(), asyncio.current_task()
        await session.run(lambda line: opened.set())

    def thread() -> None:
        try:
            asyncio.run(run())
        except asyncio.CancelledError:
            pass
        except BaseException as error:
            wrong.append(error)
        finally:
            opened.set()

    running_on = threading.Thread(target=thread)
    running_on.start()
    try:
        assert opened.wait(PATIENCE_S)
        yield RunningSession(session, grid, parts["loop"])
    finally:
        if running_on.is_alive():
            with suppress(RuntimeError):
                parts["loop"].call_soon_threadsafe(parts["task"].cancel)
        running_on.join(PATIENCE_S)
    if wrong:
        raise wrong[0]


class BrlapiProcess:
    """A client in the system's own Python, line by line."""

    def __init__(self, **settings: str) -> None:
        self.process = subprocess.Popen(
            [SYSTEM_PYTHON, "-c", CLIENT, json.dumps(settings)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def send(self, *words: Any) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(words) + "\n")
        self.process.stdin.flush()

    def answer(self) -> Any:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, self.process.stderr.read() if self.process.stderr else ""
        told = json.loads(line)
        assert "error" not in told, told["error"]
        return told["answer"]

    def ask(self, *words: Any) -> Any:
        self.send(*words)
        return self.answer()

    def close(self) -> None:
        self.process.kill()
        self.process.communicate()


@contextmanager
def brlapi_client(**settings: str) -> Iterator[BrlapiProcess]:
    """A client that is ended with the body."""
    client = BrlapiProcess(**settings)
    try:
        yield client
    finally:
        client.close()


def free_number() -> int:
    """A BrlAPI number (port - 4101) that is free, away from those that dotwave takes."""
    for number in range(40, 400):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", 4101 + number)):
                return number
    raise AssertionError("no port is free")


@contextmanager
def brltty(folder: Path, *words: str) -> Iterator[subprocess.Popen[bytes]]:
    """BRLTTY as the documentation starts it, ended with the body."""
    line = ["brltty", "-n", "-e", "-q", "-f", "/dev/null", "-s", "no", "-W", str(folder), "-P", str(folder / "pid")]
    with (folder / "brltty.log").open("w") as log:
        process = subprocess.Popen([*line, *words], stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT)
    try:
        yield process
    finally:
        # Asked to end it says goodbye for seconds; killed is what a source may be at any time.
        process.kill()
        process.wait()


@contextmanager
def written_through(number: int) -> Iterator[BrlapiProcess]:
    """A client of a BRLTTY that has just been started with its own server of a number."""
    until(lambda: _listens(4101 + number), "BRLTTY's own server")
    with brlapi_client(host=f"127.0.0.1:{number}", auth="none") as client:
        yield client


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0
