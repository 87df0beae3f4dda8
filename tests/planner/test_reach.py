"""What devices can make: planned for real, and named from families where something cannot be made."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dotwave as dw
from chainsim import Outcome, device_names, load_device
from encoders import Frame, GridShape, Scene, bars, levels, plane_wave, walking_bars
from planner import KINDS, made_at_will, plan_scene, reach_row, wave_map

GRID = GridShape(6, 6)
KIND = {kind.name: kind for kind in KINDS}


def makers(pattern: object) -> set[str]:
    return {name for name in device_names() if made_at_will(pattern, load_device(name))}  # type: ignore[arg-type]


def test_makers_of_patterns_by_families_alone() -> None:
    any_levels = {"independent-6x6", "linked-6x6", "linked-grid-6x6", "linked-ultrasonic-6x6"}
    static = {"paper-6x6", "paper-6x6-common"}
    assert makers(levels(np.eye(6))) == any_levels | static
    waves = {"independent-6x6", "linked-6x6", "linked-ultrasonic-6x6", "paper-6x6", "ultrasonic-6x6"}
    assert makers(plane_wave(GRID, lag_deg=60)) == {*waves, "grid-6x6"}
    assert makers(walking_bars(GRID, width=2)) == waves
    assert makers(bars(GridShape(40, 96), vertical=True, width=1, gap=1)) == {"linked-40x96"}


@pytest.mark.parametrize("name", ["independent-6x6", "paper-6x6", "linked-6x6"])
def test_what_is_named_is_really_made(name: str) -> None:
    device = load_device(name)
    row = reach_row(KIND["dots"], device)
    assert (row.tried, row.made, row.lacking) == (2, 2, "")
    frame = next(iter(plan_scene(Scene(GRID, (Frame(KIND["dots"].patterns(GRID)[0], 5.0),)), device).frames))
    assert frame.outcome is Outcome.OK
    assert 0 < frame.settled_s <= row.way_in_s
    assert max(state.margins.volts for state in frame.states) <= row.volts <= 1


def test_what_is_not_made_says_what_is_lacking() -> None:
    row = reach_row(KIND["waves"], load_device("paper-6x6"))
    assert (row.tried, row.made) == (2, 1)
    assert "it lacks linearity" in row.lacking


def test_a_spread_gives_a_yield() -> None:
    row = reach_row(KIND["dots"], load_device("linked-6x6"), 0.01)
    assert row.yield_ is not None
    assert 0 < row.yield_ < 1
    assert reach_row(KIND["dots"], load_device("linked-6x6")).yield_ is None


def test_the_map_shows_the_waves_that_stand() -> None:
    found = wave_map(load_device("paper-6x6"))
    assert found is not None
    standing = dict(zip(found.lags_deg, found.stands.T, strict=True))
    # Theory 2.2: waves of 60 degrees and full scale are not stable, those of 90 are; small ones are.
    assert not standing[60][0]
    assert standing[90].all()
    assert standing[60][-1]
    assert wave_map(load_device("independent-6x6")) is None


def test_the_api_and_the_command_tell_the_same(dotwave) -> None:
    report = dw.reach("independent-6x6")
    assert [row.kind for row in report.rows] == [kind.name for kind in KINDS]
    said = json.loads(dotwave("reach", "--device", "independent-6x6", "--json").out)
    assert [row["made"] for row in said["kinds"]] == [row.made for row in report.rows]
    assert said["waves"] is None
    assert "walking bars" in report.as_text()


def test_a_scene_that_cannot_be_made_names_devices_that_can(dotwave) -> None:
    ended = dotwave("text", "Hello", "--device", "paper-6x6-ring")
    assert ended.code == 1
    assert "Built-in devices that make such patterns: independent-6x6, linked-6x6, " in ended.out


def test_a_spread_that_is_none_is_refused() -> None:
    with pytest.raises(dw.AppError, match="spread: expected a share"):
        dw.reach("independent-6x6", spread=2.0)
