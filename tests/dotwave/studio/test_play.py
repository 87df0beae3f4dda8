"""Playing from the pages: a dry run, the switch, STOP, a second tab, a closed tab and a killed server."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="needs the extra studio")
pytest.importorskip("httpx2", reason="needs httpx2: the client of the tests")

from starlette.testclient import TestClient

import dotwave as dw
from dotwave.studio.results import Results
from dotwave.studio.tasks import LEFT_S, UNSEEN_S, Running, Tasks
from tests.support.studio import inside

PATIENCE_S = 120.0


def until(met: Callable[[], bool]) -> None:
    """Wait for what another process does."""
    end, tick = time.monotonic() + PATIENCE_S, threading.Event()
    while not met():
        assert time.monotonic() < end, "waited in vain"
        tick.wait(0.02)


class Pages:
    """The page *Play*, with a stand-in to play to."""

    def __init__(self, folder: Path) -> None:
        made = Results(folder).begin("write", "a long pattern", {})
        dw.plan(
            dw.texture({"levels": [[1.0] + [0.0] * 5] * 6}, "linked-6x6", dwell_s=20.0), "linked-6x6"
        ).waveform().write(made.folder / "text.wav")
        self.waveform = made.name
        self.client: TestClient = inside(folder)
        self.tasks: Tasks = self.client.app.state.studio.tasks  # type: ignore[attr-defined]
        self.stand_in = self.begun(work="emulator", device="linked-6x6")
        until(lambda: "port" in self.stand_in.shown)

    def begun(self, **typed: str) -> Running:
        answer = self.client.post("/play", data=typed)
        assert answer.status_code == 303, answer.text
        running = self.tasks.of(answer.headers["location"].rsplit("/", 1)[1])
        assert running is not None
        return running

    def playing(self) -> Running:
        """Something that really plays, and is felt."""
        sink = f"controller:{self.stand_in.shown['port']}"
        running = self.begun(work="play", result=self.waveform, sink=sink, live="yes")
        until(lambda: self.stand_in.shown["volts"] > 0)
        return running

    def at_zero(self) -> bool:
        return bool(self.stand_in.shown["volts"] == 0.0)


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pages]:
    pages = Pages(tmp_path_factory.mktemp("play"))
    yield pages
    pages.tasks.close(20)


def test_without_the_switch_nothing_is_sent(pages: Pages) -> None:
    running = pages.begun(work="play", result=pages.waveform, sink=f"controller:{pages.stand_in.shown['port']}")
    assert not running.plays
    until(lambda: running.over)
    assert not running.error
    address = f"/play/{pages.client.app.state.studio.results.latest(1)[0].name}"  # type: ignore[attr-defined]
    assert "Nothing was sent." in pages.client.get(address).text
    assert pages.at_zero()


@pytest.mark.parametrize(
    "typed", [{"sink": ""}, {"sink": "elsewhere:x"}, {"sink": "controller:x", "result": "../x"}, {"work": "other"}]
)
def test_what_cannot_be_played_is_said(pages: Pages, typed: dict[str, str]) -> None:
    asked = {"work": "play", "result": pages.waveform, "live": "yes", **typed}
    answer = pages.client.post("/play", data=asked)
    assert answer.status_code == 400
    assert 'role="alert"' in answer.text


def test_stop_from_any_tab_goes_to_zero_and_two_do_not_play(pages: Pages) -> None:
    running = pages.playing()
    second = pages.client.post(
        "/play", data={"work": "play", "result": pages.waveform, "sink": "audio:", "live": "yes"}
    )
    assert second.status_code == 400
    assert "something plays already" in second.text
    assert "something plays" in pages.client.get("/").text
    assert pages.client.post("/stop").status_code == 303
    until(lambda: running.over)
    assert running.error == "Cancelled."
    until(pages.at_zero)
    assert pages.client.get("/watch").json() == {"playing": False}


def test_a_page_that_was_closed_ends_what_plays(pages: Pages) -> None:
    running = pages.playing()
    assert pages.client.post("/left").status_code == 204
    assert running.unseen_until <= time.monotonic() + LEFT_S
    # Another page is there, or was only opened anew.
    pages.client.get("/watch")
    assert running.unseen_until > time.monotonic() + UNSEEN_S / 2
    running.unseen_until = time.monotonic()
    until(lambda: running.over)
    until(pages.at_zero)


def test_a_killed_server_ends_what_plays(pages: Pages) -> None:
    running = pages.playing()
    # All that a worker sees of it: nobody holds the other end of its standard input.
    assert running.process.stdin is not None
    running.process.stdin.close()
    until(lambda: running.over)
    until(pages.at_zero)
