"""What a short text loads: how many modules of ours, and nothing that takes long and is not needed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
OURS = {"chainsim", "drivers", "dotwave", "encoders", "planner"}
# The goal is 45; whoever comes below this lowers it.
MOST = 109
HEAVY = {
    "PIL", "asyncio", "dask", "matplotlib", "numba", "rich", "scipy", "serial", "sounddevice", "multiprocessing",
    "chainsim.averaging", "chainsim.batch", "chainsim.continuation", "chainsim.effects", "chainsim.floquet",
    "chainsim.harmonic_balance", "chainsim.reach", "chainsim.time_domain", "drivers.protocol", "drivers.sinks",
    "encoders.picture", "planner.analysis", "planner.robustness", "planner.waves", "dotwave.icon_sets", "dotwave.jobs",
}  # fmt: skip


def loaded(folder: Path, *words: str) -> set[str]:
    """Names of the modules that a call of the command line has loaded at its end."""
    code = f"import atexit, sys; sys.argv = {['dotwave', *words]!r}; "
    code += "atexit.register(lambda: print(*sys.modules, file=sys.stderr)); from dotwave.cli.app import main; main()"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "DOTWAVE_CACHE": str(folder)}
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    return set(ran.stderr.split())


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> list[set[str]]:
    """Of a text that is planned, and of the same once its plan is kept."""
    folder = tmp_path_factory.mktemp("hello")
    return [loaded(folder, "text", "Hello", "-o", "x.wav") for _ in range(2)]


def test_a_text_loads_few_modules_of_ours(text: list[set[str]]) -> None:
    ours = sorted(name for name in text[1] if name.split(".")[0] in OURS)
    assert len(ours) <= MOST, "\n".join(ours)


def test_a_text_whose_plan_is_kept_loads_nothing_heavy(text: list[set[str]]) -> None:
    assert not HEAVY & text[1]


def test_planning_a_text_compiles_and_integrates_nothing(text: list[set[str]]) -> None:
    assert not {"numba", "scipy", "rich", "PIL", "chainsim.time_domain", "chainsim.batch"} & text[0]


def test_help_loads_no_numbers(tmp_path: Path) -> None:
    for words in (["--help"], ["text", "--help"]):
        assert not {"numpy", "yaml", "rich", "planner.plan", "encoders.scene"} & loaded(tmp_path, *words), words
