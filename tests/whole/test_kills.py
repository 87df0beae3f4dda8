"""Commands killed (SIGKILL) at any moment: every output is absent, old or new, and the next run makes it all well."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from drivers import read_waveform
from drivers.files.parts import part_of
from tests.support.everyday import one_in

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs kill")

ROOT = Path(__file__).resolve().parents[2]
ICONS = ROOT / "samples" / "icons"
SWEEP = """\
chain: {n: 3, delta: 6.0e-3, beta: -1.0}
setting:
  epsilon: {from: 1.0e-5, to: 1.0e-3, steps: 500, log: true}
  lam: 6.0e-3
  omega: {from: 0.99, to: 1.01, steps: 600}
rung: harmonic_balance
tol: %s
"""
JOB = """\
device: linked-6x6
output: %s
sequence:
  - text: {say: "%s", dwell_s: 1}
  - texture: {bars: {vertical: false, width: 2, gap: 1}, dwell_s: 1}
  - pause_s: 1
"""
KILLS_A_ROUND = 5


@dataclass(frozen=True)
class Case:
    """A command that is killed, and one that ran before it into the same files."""

    files: Mapping[str, str]
    old: tuple[str, ...]
    new: tuple[str, ...]
    kept: frozenset[str] = frozenset()
    """What a run that is killed may leave for the next one besides parts."""


CASES = {
    "text": Case(
        {"long.txt": "Many words for the fingers. " * 3},
        ("text", "old", "-d", "linked-6x6", "-o", "out.wav"),
        ("text", "long.txt", "-d", "linked-6x6", "-o", "out.wav"),
    ),
    "sweep": Case(
        {"old.yaml": SWEEP % "1.0e-5", "new.yaml": SWEEP % "1.0e-6"},
        ("sweep", "old.yaml", "-o", "out.npz", "--only", "epsilon,omega,outcome,phase_step_deg,stable"),
        ("sweep", "new.yaml", "-o", "out.npz", "--only", "epsilon,omega,outcome,phase_step_deg,stable,branch",
         "--picture", "map.png"),
        frozenset({"out.npz.parts"}),
    ),
    "icons": Case(
        {},
        ("icons", str(ICONS / "heart.svg"), str(ICONS / "play.svg"), "-o", "out", "--waveforms", "--workers", "1"),
        ("icons", str(ICONS / "[ahp]*"), "-o", "out", "--waveforms", "--workers", "1"),
        frozenset({"out/journal.jsonl"}),
    ),
    "render": Case(
        {"old.yaml": JOB % ("out.wav", "old"), "new.yaml": JOB % ("out.wav", "many words, one after another")},
        ("render", "old.yaml"),
        ("render", "new.yaml"),
    ),
}  # fmt: skip
FOREIGN = {
    "thesis.txt": b"precious", ".out.wav.4711.part": b"not ours", "out.wav.part": b"nor this", ".x.dotwave-1.part": b"",
    "out.txt": b"nor this",
}  # fmt: skip


@dataclass
class Harness:
    """Runs and kills of one case, each in a folder of its own."""

    case: Case
    base: Path
    seed: int
    seen: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.random = random.Random(self.seed)
        self.old, _, _ = self._made("old", self.case.old)
        # How long a run takes changes with what else the machine does: it is followed.
        self.new, first_s, self.whole_s = self._made("new", self.case.new)
        self.first = first_s / self.whole_s
        self.new_after_old = {**self.old, **self.new}

    def folder(self, name: str, old: bool = False) -> Path:
        """A folder with foreign files, and perhaps the old outputs."""
        folder = self.base / name
        folder.mkdir()
        for file, data in FOREIGN.items():
            (folder / file).write_bytes(data)
        for file, text in self.case.files.items():
            (folder / file).write_text(text, encoding="utf-8")
        if old:
            shutil.copytree(self.base / "old", folder, dirs_exist_ok=True)
        return folder

    def _made(self, name: str, command: tuple[str, ...]) -> tuple[dict[str, bytes], float, float]:
        """What an undisturbed run puts into a folder; seconds until the first change there, and until its end."""
        folder = self.folder(name)
        given = self.names(folder)
        began = time.monotonic()
        process = self.start(folder, command)
        while self.names(folder) == given and process.poll() is None:
            time.sleep(0.001)
        first_s = time.monotonic() - began
        assert process.wait(300) == 0
        whole_s = time.monotonic() - began
        made = (path for path in self.names(folder) - given if path not in self.case.kept)
        return {path: (folder / path).read_bytes() for path in made}, first_s, whole_s

    def names(self, folder: Path) -> set[str]:
        """Files of a folder and of those in it, with their paths."""
        # Folders may go while they are listed.
        return {str(Path(at, name).relative_to(folder)) for at, _, files in os.walk(folder) for name in files}

    def start(self, folder: Path, command: tuple[str, ...]) -> subprocess.Popen[bytes]:
        """A command, in a session of its own."""
        return subprocess.Popen(
            [sys.executable, "-m", "dotwave", *command],
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            start_new_session=True,
        )

    def run(self, folder: Path, command: tuple[str, ...]) -> None:
        """A command to its end."""
        assert self.start(folder, command).wait(300) == 0, command

    def killed(self, folder: Path) -> bool:
        """Run the new command and kill it at a random moment; False when it was done before."""
        # Most moments before the first file appears are alike: a few of them do.
        moment_s = self.random.uniform(0.9 * self.first, 1.02) * self.whole_s
        began = time.monotonic()
        process = self.start(folder, self.case.new)
        try:
            process.wait(moment_s)
            self.whole_s = time.monotonic() - began
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            self.whole_s *= 1.02
        return process.wait(30) == -signal.SIGKILL

    def check_killed(self, folder: Path, before: Mapping[str, bytes]) -> None:
        """Every output is absent, old or new, the two files of a waveform alike; nothing else has changed."""
        found = self.names(folder)
        parts = {name for name in found if any(part_of(Path(piece)) for piece in Path(name).parts)}
        for path in folder.rglob("*.wav"):
            if (folder / path).with_suffix(".json").exists():
                manifest, reader = read_waveform(path)
                manifest.check_digest(reader.path)
        states = set()
        for name in sorted({**self.new, **before}):
            data = (folder / name).read_bytes() if (folder / name).exists() else None
            state = "new" if data == self.expected(before).get(name) else "old" if data == before.get(name) else "torn"
            assert state != "torn", name
            states.add("absent" if data is None else state)
            self.seen["absent" if data is None else state] += 1
        # Killed while it wrote: a part is left, or of several outputs not all are there.
        self.seen["in between"] += bool(parts) or len(states) > 1
        rest = {name for name in found - parts - set(self.new) - set(before) if not self._kept(name)}
        assert rest == set(FOREIGN) | set(self.case.files)
        self.check_foreign(folder)

    def _kept(self, name: str) -> bool:
        return any(name == kept or name.startswith(f"{kept}/") for kept in self.case.kept)

    def check_foreign(self, folder: Path) -> None:
        """Files that dotwave did not make are as they were."""
        assert {name: (folder / name).read_bytes() for name in FOREIGN} == FOREIGN

    def expected(self, before: Mapping[str, bytes]) -> dict[str, bytes]:
        """What an undisturbed run leaves."""
        return self.new_after_old if before else self.new

    def check_done(self, folder: Path, before: Mapping[str, bytes]) -> None:
        """After an undisturbed run all is as if there had been no kill."""
        self.run(folder, self.case.new)
        found = {name for name in self.names(folder) if not self._kept(name) or name.startswith("out.npz.parts")}
        assert found == set(self.expected(before)) | set(FOREIGN) | set(self.case.files)
        assert {name: (folder / name).read_bytes() for name in self.expected(before)} == self.expected(before)
        assert not [path for path in folder.rglob("*") if part_of(path) and path.name not in FOREIGN]
        self.check_foreign(folder)

    def kill(self, times: int) -> None:
        """Rounds of kills into one folder, every second one without old outputs, an undisturbed run after each."""
        kills = rounds = 0
        while kills < times:
            before = {} if rounds % 2 else self.old
            folder = self.folder(f"round{rounds}", old=bool(before))
            for _ in range(min(KILLS_A_ROUND, times - kills)):
                kills += self.killed(folder)
                self.check_killed(folder, before)
            self.check_done(folder, before)
            shutil.rmtree(folder)
            rounds += 1
        self.seen |= Counter({"kills": kills, "rounds": rounds})


@pytest.mark.parametrize("name", one_in(4, CASES))
def test_killed_a_few_times(tmp_path: Path, name: str) -> None:
    harness = Harness(CASES[name], tmp_path, seed=1)
    harness.kill(2)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_killed_a_hundred_times(tmp_path: Path, name: str) -> None:
    harness = Harness(CASES[name], tmp_path, seed=2)
    harness.kill(100)
    print(name, json.dumps(harness.seen))
    assert harness.seen["in between"] > 0
    assert harness.seen["new"] > 0
