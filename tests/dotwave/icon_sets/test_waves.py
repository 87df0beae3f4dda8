"""Waveforms of a set of icons: what the journal says of a file holds, whenever a run ended."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dotwave.icon_sets.build import IconOptions, render_icons
from dotwave.icon_sets.journal import Journal

ICON = str(Path(__file__).resolve().parents[3] / "samples" / "icons" / "heart.svg")
SHORT = IconOptions(device="independent-6x6", workers=1, waveforms=True, dwell_s=0.2)
LONG = replace(SHORT, dwell_s=0.4)


@pytest.mark.parametrize("at", [1, *(pytest.param(at, marks=pytest.mark.slow) for at in (2, 3))])
def test_a_run_that_ends_before_it_is_noted_misleads_none(
    at: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = [tmp_path / "waveforms" / f"heart.svg.{kind}" for kind in ("wav", "json")]
    render_icons([ICON], tmp_path, SHORT)
    short = [file.read_bytes() for file in files]
    add, calls = Journal.add, []

    def cut_off(self: Journal, *records: dict[str, Any]) -> None:
        calls.append(records)
        if len(calls) == at:
            raise KeyboardInterrupt
        add(self, *records)

    # It encodes the icon, then puts the waveform in place and notes it.
    monkeypatch.setattr(Journal, "add", cut_off)
    with pytest.raises(KeyboardInterrupt):
        render_icons([ICON], tmp_path, LONG)
    monkeypatch.setattr(Journal, "add", add)
    assert ([file.read_bytes() for file in files] != short) == (at == 3)
    render_icons([ICON], tmp_path, SHORT)
    assert [file.read_bytes() for file in files] == short
