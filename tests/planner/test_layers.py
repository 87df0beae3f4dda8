"""What planning imports: nothing that takes long to load."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HEAVY = {"PIL", "dask", "louis", "matplotlib", "numba", "rich", "scipy", "typer"}

WAYS = {"planner.amplitudes.vibration", "planner.amplitudes.deflection", "planner.waves.wave_state"}

PLAN = """
import numpy as np
from chainsim import load_device
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import plan_scene
dots = np.random.default_rng(0).integers(0, 2, (4, 6, 6)).astype(complex)
scene = Scene(GridShape(6, 6), [Frame(TargetPattern(d), 1.0) for d in dots])
assert len(list(plan_scene(scene, load_device({name!r})).frames)) == {frames}
"""


def loaded_by(code: str) -> set[str]:
    shown = code + "\nimport sys; print(*sorted(sys.modules))"
    ran = subprocess.run([sys.executable, "-c", shown], cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    return set(ran.stdout.split())


def test_importing_the_planner_loads_nothing_heavy() -> None:
    loaded = loaded_by("from planner import plan_scene")
    assert "planner.scene_plan" in loaded
    assert not {name.split(".")[0] for name in loaded} & HEAVY
    # Ways to make patterns are loaded for the device that has them.
    assert not WAYS & loaded


@pytest.mark.parametrize(
    ("name", "frames", "way", "compiled"),
    [
        ("paper-6x6", 5, "amplitudes.deflection", False),
        ("linked-6x6", 5, "amplitudes.vibration", True),
        ("independent-6x6", 5, "amplitudes.vibration", False),
        pytest.param("paper-6x6-ring", 4, "waves.wave_state", False, marks=pytest.mark.slow),
    ],
)
def test_planning_loads_nothing_heavy(
    name: str, frames: int, way: str, compiled: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With an empty cache, so everything is computed; what changes of chains leave is integrated by compiled code."""
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path))
    loaded = loaded_by(PLAN.format(name=name, frames=frames))
    assert {module.split(".")[0] for module in loaded} & HEAVY <= ({"numba", "scipy"} if compiled else set())
    ways = {module for module in loaded if module in WAYS}
    assert ways == {f"planner.{way}"}
