"""`dotwave.Live` on its threads: over a pseudo-terminal to an emulated controller, and what goes wrong on the way."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import dotwave as dw
from chainsim import load_device
from drivers import ControllerSpec, Emulator, KeyEvent, LoopLine, PortUnavailable, VirtualController
from drivers.protocol.replies import State
from encoders import LayoutError, TargetPattern
from tests.support.playing import serving

PATIENT_S = 120.0

needs_pty = pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")


def until(there: Callable[[], bool]) -> None:
    """Wait for what comes in any case; how long it takes is another test's question."""
    end = time.monotonic() + PATIENT_S
    while not there() and time.monotonic() < end:
        time.sleep(0.002)
    assert there()


def says(live: dw.Live, note: str) -> Callable[[], bool]:
    return lambda: live.state.stands is not None and live.state.stands.text == note


@contextmanager
def emulated(record: Path | None = None) -> Iterator[Emulator]:
    device = load_device("paper-6x6")
    with serving(Emulator(device, ControllerSpec.of(device), record=record)) as emulator:
        yield emulator


@needs_pty
def test_windows_and_keys_over_a_line(tmp_path: Path) -> None:
    keys = list[KeyEvent]()
    with emulated(tmp_path / "arrived.wav") as emulator:
        with dw.Live("paper-6x6", f"controller:{emulator.port}", on_key=keys.append) as live:
            for cells, note in (("⠓⠊", "hi"), ("⠓⠑⠇⠇⠕", "hello")):
                live.show(cells, note)
                until(says(live, note))
            state = live.state
            assert state.connected
            assert state.shown == 2
            assert state.latency_s is not None
            assert state.stands is not None
            assert state.stands.cells == "⠓⠑⠇\n⠇⠕⠀"
            emulator.controller.press(KeyEvent(2))
            until(lambda: keys == [KeyEvent(2)])
        # When `Live` has closed, the output is at zero.
        assert emulator.controller.playout.state is State.DONE
        assert emulator.controller.playout.silent
    assert dw.verify(tmp_path / "arrived.wav").frames[-1].wrong_dots == 0


class Broken(RuntimeError):
    """What a program that plays live may raise."""


def break_while_it_stands(sink: str) -> None:
    with dw.Live("paper-6x6", sink) as live:
        live.show("⠿")
        until(lambda: live.state.stands is not None)
        raise Broken


@needs_pty
def test_an_error_in_the_program_takes_the_output_to_rest() -> None:
    with emulated() as emulator:
        with pytest.raises(Broken):
            break_while_it_stands(f"controller:{emulator.port}")
        assert emulator.controller.playout.state is State.DONE
        assert emulator.controller.playout.silent


def test_ctrl_c_while_it_closes_stops_the_controller(monkeypatch: pytest.MonkeyPatch) -> None:
    device = load_device("paper-6x6")
    controller = VirtualController(ControllerSpec.of(device), now=time.monotonic())
    live = dw.Live(device, lambda: LoopLine(controller, time.monotonic))
    live.show("⠿")
    until(lambda: live.state.stands is not None)

    def interrupted(timeout: float | None = None) -> bool:
        raise KeyboardInterrupt

    monkeypatch.setattr(live._ended, "wait", interrupted)
    with pytest.raises(KeyboardInterrupt):
        live.close()
    assert controller.playout.state in (State.STOPPED, State.DONE)
    controller.tick(time.monotonic() + 1.0)
    assert controller.playout.silent
    assert not any(thread.is_alive() for thread in live._threads)


def test_a_controller_that_loses_the_session_is_told_of() -> None:
    device = load_device("paper-6x6")
    controllers = [VirtualController(ControllerSpec.of(device), now=time.monotonic())]
    live = dw.Live(device, lambda: LoopLine(controllers[-1], time.monotonic))
    live.show("⠿")
    until(lambda: live.state.stands is not None)
    controllers[-1].session = 99
    until(lambda: not live.state.connected)
    with pytest.raises(dw.DriverError, match="play again"):
        live.show("⠓")
    with pytest.raises(dw.DriverError, match="play again"):
        live.close()


def test_what_is_shown() -> None:
    with dw.Live("paper-6x6") as live:
        assert (live.lines, live.cells_per_line) == (2, 3)
        live.show("hello there, all of you")
        until(lambda: live.state.stands is not None)
        assert live.state.stands is not None
        assert live.state.stands.text.startswith("hello")
        live.show(TargetPattern(np.eye(6, dtype=complex)), "diagonal")
        until(lambda: getattr(live.state.stands, "text", "") == "diagonal")
        live.show("⠓⠊\n⠓⠑")
        until(lambda: getattr(live.state.stands, "cells", "") == "⠓⠊⠀\n⠓⠑⠀")
        live.show("")
        until(lambda: getattr(live.state.stands, "cells", "") == "⠀⠀⠀\n⠀⠀⠀")
        live.rest()
        until(lambda: live.state.stands is None)
        with pytest.raises(LayoutError, match="7 do not fit into 2 x 3"):
            live.show("⠓" * 7)
        with pytest.raises(dw.AppError, match=r"expected 6 x 6 numbers, got \(2, 3\)"):
            live.show(TargetPattern(np.ones((2, 3), dtype=complex)))


def test_what_is_no_place_to_play_live() -> None:
    for sink in ("audio:", "controller:", "/dev/ttyACM0"):
        with pytest.raises(dw.AppError, match="expected controller:PORT or none:"):
            dw.Live("paper-6x6", sink)
    with pytest.raises(dw.AppError, match=r"sound card plays written files \(dotwave play OUT --audio CARD\)$"):
        dw.Live("paper-6x6", "audio:0")
    with pytest.raises(dw.AppError, match=r"lead_s: expected 0\.02 to 1 s"):
        dw.Live("paper-6x6", lead_s=2.0)
    with pytest.raises(dw.AppError, match="idle_s"):
        dw.Live("paper-6x6", idle_s=-1.0)
    if sys.platform != "win32":
        with pytest.raises(PortUnavailable, match="there is no such port"):
            dw.Live("paper-6x6", "controller:/dev/nowhere")
