"""Reports: verdicts, totals, strict JSON and plain text."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as arrays

from dotwave.reports.report import plain
from dotwave.reports.text import FrameCheck, TextReport, VerifyReport, decibels
from planner import FrameWish

GOOD = FrameCheck(
    page=0, start_s=0.0, settled_s=0.3, end_s=1.0, outcome="ok", target=np.array([[1.0, 0.1]]),
    wish=FrameWish(np.array([[1.0, 0.0]])), felt=np.array([[0.99, 0.1]]), wrong_dots=0, contrast_db=19.9,
    amplitude_error=0.01, text="a",
)  # fmt: skip
REPORT = VerifyReport("a.wav", "linked-6x6", (GOOD, GOOD), 16000, 8000, "aa", "aa", True, seconds=0.5)
TEXT = TextReport(
    device="paper-6x6", tables=("en-ueb-g2.ctb",), text="Hi", frames=1, pages=1, duration_s=1.0,
    files=("hi.wav", "hi.json"), peak_volts=12.0, limit_volts=100.0, ramp_s=0.1, error=0.001, outcomes={"ok": 1},
)  # fmt: skip


def with_frame(**changes: object) -> VerifyReport:
    return replace(REPORT, frames=(GOOD, replace(GOOD, **changes)))  # type: ignore[arg-type]


def test_all_right_is_ok() -> None:
    assert REPORT.ok
    assert replace(REPORT, text_equal=None).ok
    assert with_frame(contrast_db=None).ok


@pytest.mark.parametrize(
    "changes",
    [
        {"wrong_dots": 1},
        {"contrast_db": 11.9},
        {"amplitude_error": 0.021},
        {"amplitude_error": math.nan},
        {"contrast_db": math.nan},
        {"outcome": "unreachable"},
    ],
)
def test_one_wrong_frame_fails_the_whole(changes: dict[str, object]) -> None:
    report = with_frame(**changes)
    assert not report.ok
    assert not report.as_dict()["ok"]
    said = report.as_text()
    assert said.startswith("Verification failed")
    assert "frame 2 at 0.00 s" in said
    assert "frame 1 at" not in said


def test_text_that_does_not_come_back_fails() -> None:
    report = replace(REPORT, text_equal=False, differences=("'aa' -> 'ab'",))
    assert not report.ok
    assert "Same as the source: no." in report.as_text()
    assert "- 'aa' -> 'ab'" in report.as_text()


def test_totals() -> None:
    report = replace(REPORT, frames=(GOOD, replace(GOOD, wrong_dots=3, contrast_db=15.0, settled_s=0.35)))
    assert (report.wrong_dots, report.contrast_db, report.ramp_s) == (3, 15.0, 0.35)
    assert math.isnan(with_frame(amplitude_error=math.nan).amplitude_error)


def test_dots_start_at_half_of_full_scale() -> None:
    check = replace(GOOD, felt=np.array([[0.5, 0.4999]]))
    assert check.felt_dots.tolist() == [[True, False]]
    assert check.wanted_dots.tolist() == [[True, False]]


@given(arrays.arrays(np.float64, (2, 3)))
def test_json_is_strict_whatever_was_felt(felt: np.ndarray) -> None:
    report = replace(REPORT, frames=(replace(GOOD, felt=felt),), seconds=math.inf)
    text = json.dumps(report.as_dict(), allow_nan=False)
    again = json.loads(text)["frames"][0]["felt"]
    for number, back in zip(felt.flat, np.array(again, dtype=object).flat, strict=True):
        assert back is None if not math.isfinite(number) else back == pytest.approx(number, rel=1e-8)


@given(st.recursive(st.floats() | st.integers() | st.text() | st.none() | st.booleans(), st.lists))
def test_plain_values_are_json(value: object) -> None:
    json.dumps(plain(value), allow_nan=False)


def test_text_report() -> None:
    assert TEXT.ok
    said = TEXT.as_text().splitlines()
    assert said[0] == "Rendered 1 frame on 1 page for paper-6x6."
    assert "Peak: 12.0 V of 100 V." in said
    assert said[-3:-1] == ["Written: hi.wav", "Written: hi.json"]
    unreachable = replace(TEXT, outcomes={"ok": 2, "unreachable": 1}, frames=3)
    assert not unreachable.ok
    assert "Not every frame can be made as asked: ok 2, unreachable 1." in unreachable.as_text()


def test_long_lists_are_cut_in_text_and_whole_in_json() -> None:
    report = replace(TEXT, undefined=tuple(f"U+{n:04X}" for n in range(100)))
    assert "- and 80 more; --json lists them all" in report.as_text()
    assert len(report.as_dict()["undefined"]) == 100


def test_decibels() -> None:
    assert decibels(19.96) == "20.0 dB"
    assert decibels(None) == "not defined"
    assert decibels(210.9) == decibels(math.inf) == "over 100 dB"
    assert decibels(math.nan) == "nan dB"
