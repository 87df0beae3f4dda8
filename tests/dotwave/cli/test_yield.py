"""`--yield`, and `yield:` in a job: exit codes and the sentence follow the wish and the share that is asked for."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import dotwave as dw
from chainsim import load_device
from dotwave.reports.devices import YieldReport
from dotwave.verification import verify
from tests.conftest import Ended

Call = Callable[..., Ended]

REPORT = YieldReport(0.7249, 0.9, True, 0.62, (0.01, 0.0, 0.0, 0.02), 1000)


@pytest.fixture
def device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two rows of the linked grid, whose actuators differ by 1 %, in a file."""
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path / "cache"))
    path = tmp_path / "loose.yaml"
    profile = load_device("linked-6x6").as_dict() | {"name": "loose", "rows": 3, "spread": {"frequency": 0.01}}
    path.write_text(json.dumps(profile), encoding="utf-8")
    return path


def test_the_sentence_says_the_share_and_the_accuracy_that_more_takes() -> None:
    assert REPORT.as_text() == (
        "Ok on 72 of 100 devices; 90 wanted: that takes a calibration to frequency 0.62 %, lam 1.2 %."
    )
    assert not REPORT.met
    assert replace(REPORT, asked=False).met
    assert "90 would be usual" in replace(REPORT, asked=False).as_text()
    assert replace(REPORT, needed=0.0).as_text().endswith("no accuracy of calibration that was tried is enough.")
    good = replace(REPORT, share=0.9, needed=1.0)
    assert good.as_text() == "Ok on 90 of 100 devices; 90 wanted: a calibration to frequency 1 %, lam 2 % is enough."
    assert good.met
    # What is not reached does not look so.
    assert "Ok on 89 of 100" in replace(REPORT, share=0.8999).as_text()


@pytest.mark.slow
def test_exit_codes_follow_the_yield(dotwave: Call, device: Path, tmp_path: Path) -> None:
    reached = dotwave("text", "Hello", "-d", device, "--yield", "0.8", "-o", tmp_path / "a.wav")
    assert reached.code == 0, reached.err
    assert re.search(
        r"^Ok on \d+ of 100 devices; 80 wanted: a calibration to frequency 1 % is enough\.$", reached.out, re.M
    )
    assert "- made with omega 1.350" in reached.out
    missed = dotwave("text", "Hello", "-d", device, "--yield", "0.9999", "--json")
    assert missed.code == 1
    told = json.loads(missed.out)
    assert not told["ok"]
    assert told["yield"]["wanted"] == 0.9999
    assert told["yield"]["share"] < 0.9999
    assert 0 < told["yield"]["needed"] < 1
    assert len(told["spread"]["tried"]) > 2
    # Whatever it aims at, what it makes felt on the device as stated is what was asked for.
    assert verify(tmp_path / "a.wav").ok


def test_without_a_yield_that_is_asked_for_the_share_is_told_all_the_same(dotwave: Call, device: Path) -> None:
    ended = dotwave("text", "Hello", "-d", device)
    assert ended.code == 0
    assert re.search(r"^Ok on \d+ of 100 devices; 90 would be usual: ", ended.out, re.M)


def test_a_yield_needs_a_spread(dotwave: Call) -> None:
    ended = dotwave("text", "Hello", "-d", "linked-6x6", "--yield", "0.9")
    assert ended.code == 2
    assert "linked-6x6 says nothing of how its actuators differ; give it a spread" in ended.err
    assert dotwave("text", "Hello", "-d", "linked-6x6", "--yield", "1.5").code == 2


@pytest.mark.slow
def test_a_job_asks_for_a_yield_and_the_command_line_comes_before_it(dotwave: Call, device: Path) -> None:
    job = device.with_name("job.yaml")
    job.write_text("device: loose.yaml\nyield: 0.9999\nsequence:\n  - text: Hello\n", encoding="utf-8")
    assert dotwave("render", job).code == 1
    assert dotwave("render", job, "--yield", "0.5").code == 0
    assert not dw.plan(dw.job(job)).report().ok
    job.write_text("device: loose.yaml\nyield: 2\nsequence:\n  - text: Hello\n", encoding="utf-8")
    ended = dotwave("render", job)
    assert ended.code == 2
    assert "yield" in ended.err


def test_the_python_api_asks_for_a_yield(device: Path) -> None:
    report = dw.plan(dw.text("Hello", device), device, yield_=0.5).report()
    assert report.ok
    assert isinstance(report.beside["yield"], YieldReport)


@pytest.mark.slow
def test_a_text_may_be_shown_in_parts_for_a_yield(dotwave: Call, device: Path) -> None:
    """At 2 % fewer devices keep all dots of a page together than by row or by dot."""
    profile = json.loads(device.read_text(encoding="utf-8")) | {"spread": {"frequency": 0.02}}
    device.write_text(json.dumps(profile), encoding="utf-8")
    free, kept = (
        json.loads(dotwave("text", "Hello", "-d", device, "--yield", "0.95", "--json", *asked).out)
        for asked in ((), ("--presentation", "together"))
    )
    assert free["yield"]["share"] > kept["yield"]["share"] + 0.1
    assert free["frames"] > kept["frames"]
    said = next(note for note in free["notes"] if note.startswith("Shown by-"))
    assert re.fullmatch(r"Shown by-(row|dot); devices that keep the first pages: together \S+ %, by-row .*", said)
    assert not any(note.startswith("Shown") for note in kept["notes"])
    # Nobody is surprised by another presentation who asks for no yield.
    assert json.loads(dotwave("text", "Hello", "-d", device, "--json").out)["frames"] == kept["frames"]
