"""The firmware on a pseudo-terminal in real time: a minute over a bad line, and a host that is killed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dotwave as dw
from drivers import Manifest, SampleReader, read_waveform
from drivers.protocol.faults import Faults, FaultyLine
from drivers.protocol.messages import SamplesMessage
from drivers.protocol.outgoing import session_messages
from drivers.protocol.pty_line import PtyLine
from tests.support.firmware import PAPER, built
from tests.support.wire import capabilities_of

pytestmark = pytest.mark.slow

RATE_HZ, CHANNELS = PAPER.rate_hz, PAPER.channels
LIMIT_S = 600.0
WATCHDOG, RAMP = round(0.2 * RATE_HZ), round(0.05 * RATE_HZ)
# Bytes that still wait in the line, and steps of the port; see LONGEST_STEP_US in posix.c.
BESIDE = round(0.05 * RATE_HZ)


@contextmanager
def controller(*words: str | Path) -> Iterator[str]:
    """The port of the firmware, while it runs."""
    command = [str(built("posix", PAPER.name)), *map(str, words)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        try:
            yield program.stdout.readline().strip()
        finally:
            program.terminate()
    assert program.returncode == 0


def host(path: Path, port: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "dotwave", "play", str(path), "--port", port, "--live", "--json"]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait_for(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + LIMIT_S
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def written(words: str, dwell_s: float, path: Path) -> tuple[Manifest, SampleReader]:
    scene = dw.text(words, "paper-6x6", dwell_s=dwell_s)
    dw.plan(scene, "paper-6x6").waveform().write(path)
    return read_waveform(path)


class Relay:
    """A host's port and a controller's, with a bad line between them."""

    def __init__(self, port: str, faults: Faults) -> None:
        self.line, self._file = PtyLine(None), os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        now = time.monotonic()
        self.there, self.back = FaultyLine(faults, seed=1, now=now), FaultyLine(faults, seed=2, now=now)
        self._waiting = b""

    def step(self) -> None:
        """What is there goes on."""
        now = time.monotonic()
        with suppress(BlockingIOError):
            self.back.put(os.read(self._file, 1 << 16), now)
        self.there.put(self.line.exchange(self.back.take(now), 0.001), now)
        self._waiting += self.there.take(now)
        with suppress(BlockingIOError):
            self._waiting = self._waiting[os.write(self._file, self._waiting[: 1 << 12]) :] if self._waiting else b""

    def close(self) -> None:
        self.line.close()
        os.close(self._file)


def test_a_minute_over_a_bad_line_arrives_whole(tmp_path: Path) -> None:
    manifest, reader = written("It rains. " * 12, 3.0, tmp_path / "minute.wav")
    assert manifest.duration_s >= 60
    record = tmp_path / "record"
    with controller("--record", record) as port:
        relay = Relay(port, Faults(drop=0.01, corrupt=0.01))
        playing = host(tmp_path / "minute.wav", relay.line.name)
        try:
            end = time.monotonic() + LIMIT_S
            while playing.poll() is None and time.monotonic() < end:
                relay.step()
        finally:
            playing.kill()
            relay.close()
        said, why = playing.communicate()
    assert playing.returncode in (0, 1), why
    stream = json.loads(said)["stream"]
    assert relay.there.dropped > 50
    assert relay.there.corrupted > 50
    vectors = np.fromfile(record, dtype=[("at", "<u8"), ("links", "<u2", (6, 5)), ("codes", "<i2", CHANNELS)])
    np.testing.assert_array_equal(vectors["at"], np.arange(manifest.samples))
    found = replace(capabilities_of(manifest.device), buffer_samples=4000, max_payload=4096)
    messages = session_messages(manifest, reader, found, session=7)
    sent = np.concatenate([one.codes for one in messages if isinstance(one, SamplesMessage)])
    beside = int((vectors["codes"] != sent).any(axis=1).sum())
    # A machine that is busy lets it run dry; then it comes up again by a ramp, and nothing is left out either.
    assert beside <= RAMP * (stream["underruns"] + round(stream["lost_s"] / 0.05))


def test_a_host_that_is_killed_leaves_zero_within_the_watchdog_time(tmp_path: Path) -> None:
    written("Hello", 30.0, tmp_path / "hello.wav")
    output = tmp_path / "output"

    def codes() -> np.ndarray:
        raw = output.read_bytes()
        return np.frombuffer(raw[: len(raw) // (2 * CHANNELS) * 2 * CHANNELS], "<i2").reshape(-1, CHANNELS)

    with controller("--output", output) as port:
        playing = host(tmp_path / "hello.wav", port)
        # More than three seconds of it, so that it stands; and now, for a machine that is busy lets it run dry.
        wait_for(lambda: int(codes().any(axis=1).sum()) > 3 * RATE_HZ and bool(codes()[-1].any()))
        alive = len(codes())
        playing.kill()
        playing.communicate()
        known = len(codes())
        wait_for(lambda: len(codes()) > known + 2 * RATE_HZ)
    out = np.abs(codes()).max(axis=1)
    assert not out[known + WATCHDOG + BESIDE :].any()
    # It went there by a ramp.
    zero = int(np.flatnonzero(out)[-1]) + 1
    assert zero >= alive
    ramp = out[zero - RAMP : zero].astype(int)
    assert (np.diff(ramp) <= 0).all()
    assert ramp[0] >= 0.95 * out.max()
