"""The registry of pattern families: which makes what, and that one line of it is all a new one takes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from chainsim import Device, load_device
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import OperatingPoint, Ramp, families as families_module, plan_scene
from planner.families import FAMILIES, Row, row_of
from planner.family import PatternFamily
from planner.planner import Planner, Transition
from planner.targets import AmplitudeTarget, ChainTarget, WalkingTarget, WaveTarget

NAMES = ("linked-6x6", "paper-6x6", "independent-6x6", "paper-6x6-ring", "paper-6x6-common")
DEVICES = {name: load_device(name) for name in NAMES}


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path))


@pytest.mark.parametrize("row", FAMILIES, ids=lambda row: row.name)
def test_every_line_names_a_family(row: Row) -> None:
    family = getattr(import_module(row.module, "planner"), row.kind)
    assert issubclass(family, PatternFamily)


@pytest.mark.parametrize(
    ("name", "amplitudes", "walking"),
    [
        ("linked-6x6", "amplitude", "walking"),
        ("paper-6x6", "deflection", "walking"),
        ("independent-6x6", "amplitude", "single"),
        ("paper-6x6-ring", "wave", "walking"),
        ("paper-6x6-common", "deflection", "walking"),
    ],
)
def test_which_family_makes_what(name: str, amplitudes: str, walking: str) -> None:
    device = DEVICES[name]
    assert row_of(AmplitudeTarget, device).name == amplitudes
    assert row_of(WalkingTarget, device).name == walking
    assert row_of(WaveTarget, device).name == "wave"


def test_points_come_in_the_order_of_their_targets() -> None:
    planner = Planner(DEVICES["paper-6x6"], 20.0)
    rest, raised = AmplitudeTarget((0.0,) * 6), AmplitudeTarget((1.0,) * 6)
    wave = WaveTarget((0.3,) * 6, phase=tuple(-m * np.pi / 2 for m in range(6)), weight=(1.0,) * 6)
    points = planner.points([wave, raised, rest, raised])
    assert [bool(point.epsilon) for point in points] == [True, False, False, False]
    assert [float(point.target.max()) for point in points] == [0.3, 1.0, 0.0, 1.0]
    # Nothing is kept of them: what was planned is planned again.
    assert planner.points([raised])[0] is not points[1]


def test_ramps_are_made_by_the_family_that_is_reached_or_left() -> None:
    planner = Planner(DEVICES["paper-6x6"], 20.0)
    rest, raised = AmplitudeTarget((0.0,) * 6), AmplitudeTarget((1.0,) * 6)
    wave = WaveTarget((0.3,) * 6, phase=tuple(-m * np.pi / 2 for m in range(6)), weight=(1.0,) * 6)
    assert planner.direct(rest, wave)
    assert planner.direct(wave, rest)
    assert planner.direct(raised, rest)
    assert not planner.direct(raised, wave)
    assert not planner.direct(wave, wave.turned(1.0))
    assert not planner.direct(raised, raised.turned(1.0))
    pairs = [(rest, raised), (wave, rest)]
    before, after = (planner.points([pair[end] for pair in pairs]) for end in (0, 1))
    lifted, let_go = planner.ramps([Transition(*pair, moves=True) for pair in pairs], before, after)
    assert lifted is not None
    assert lifted.bias is not None
    assert let_go is not None
    assert [tone.omega for tone in let_go.tones] == [before[1].omega]


class Jumps(PatternFamily):
    """Deflections that are set at once."""

    changes = True

    def points(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        n = self.device.chain_length
        lam, silence = np.full(n - 1, self.device.coupling.lam.min), np.zeros(n, dtype=np.complex128)
        return [
            OperatingPoint(0j, lam, 1.0, silence, mean=one.levels, bias=one.levels, target=one.levels)
            for one in targets
        ]  # fmt: skip

    def ramps(
        self, before: Sequence[OperatingPoint], after: Sequence[OperatingPoint], moves: bool = True
    ) -> list[Ramp | None]:
        return [Ramp(t_s=np.zeros(1)) for _ in after]


def test_a_new_family_is_one_file_and_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def biased(device: Device) -> bool:
        return device.bias == "actuator"

    module = ModuleType("jumps")
    vars(module)["Jumps"] = Jumps
    monkeypatch.setitem(sys.modules, "jumps", module)
    line = Row("jumps", (AmplitudeTarget,), biased, biased, "jumps", "Jumps")
    monkeypatch.setattr(families_module, "FAMILIES", (line, *FAMILIES))
    frame = Frame(TargetPattern(np.eye(6, dtype=np.complex128)), 1.0)
    plans = list(plan_scene(Scene(GridShape(6, 6), [frame]), DEVICES["paper-6x6"]).frames)
    assert [state.bias.tolist() for state in plans[0].states] == np.eye(6).tolist()
    assert plans[0].settled_s == 0.0
    assert len(plans) == 2
