"""`dotwave.open`: addresses, dry runs of waveforms on disk and in memory, and what reaches the player."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dotwave as dw
from dotwave.playing import play as module
from drivers import read_waveform


@pytest.mark.parametrize(
    "address", ["controller:/dev/ttyACM0", "controller:socket://host:9", "drv2667:/dev/ttyUSB0", "audio:"]
)
def test_an_address_says_what_plays(monkeypatch: pytest.MonkeyPatch, address: str) -> None:
    seen: list[Any] = []
    monkeypatch.setattr(module, "play", lambda path, **options: seen.append((path, options)))
    with dw.open(address, patience_s=3.0) as sink:
        sink.check("x.wav")
        sink.play(Path("x.wav"))
    common = {"to": address, "patience_s": 3.0}
    assert seen == [(Path("x.wav"), common | {"live": False}), (Path("x.wav"), common | {"live": True})]


@pytest.mark.parametrize("address", ["", "controller", "/dev/ttyACM0", "printer:x"])
def test_other_addresses_are_refused_with_those_that_are_known(address: str) -> None:
    with pytest.raises(dw.AppError, match=r"expected one of controller:\.\.\., drv2667:\.\.\., audio:\.\.\."):
        dw.open(address)


def test_what_is_in_memory_is_played_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6")
    played = []
    plain = module.play

    def play(path: Path, **options: Any) -> Any:
        played.append(np.concatenate(list(read_waveform(path)[1].blocks(4096))))
        return plain(path, **options)

    monkeypatch.setattr(module, "play", play)
    report = dw.open("controller:/dev/nowhere").check(plan.waveform())
    assert (report.ok, report.live, report.path) == (True, False, "a waveform in memory")
    assert np.array_equal(played[0], plan.waveform().samples(0.0, 100.0))
