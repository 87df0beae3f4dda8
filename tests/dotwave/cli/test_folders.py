"""Folders of what is written: every command makes the one that is missing, and takes it away when it fails."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers import FileError, atomic_files

HEART = Path(__file__).resolve().parents[3] / "samples" / "icons" / "heart.svg"
SWEEP = """\
chain: {n: 2, delta: 5.0e-3, beta: 0.0, closure: open}
setting: {epsilon: {from: 1.0e-5, to: 1.0e-3, steps: 2}, lam: 6.0e-3, omega: {from: 0.9, to: 1.1, steps: 2}}
rung: auto
tol: 1.0e-6
"""


@pytest.fixture
def given(dotwave, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, with a job, a sweep and a written waveform."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "job.yaml").write_text("output: new/deep/x.wav\nsequence: [{text: a}]", encoding="utf-8")
    (tmp_path / "sweep.yaml").write_text(SWEEP, encoding="utf-8")
    assert dotwave("text", "a", "-o", "a.wav").code == 0
    return tmp_path


WRITERS: dict[str, list[object]] = {
    "text": ["text", "a", "-o", "new/deep/x.wav"],
    "haptic": ["text", "a", "-d", "linked-6x6", "-o", "new/deep/x.ahap"],
    "image": ["image", HEART, "-o", "new/deep/x.wav"],
    "icons": ["icons", HEART, "-o", "new/deep", "--workers", 1],
    "job": ["render", "job.yaml"],
    "render": ["render", "job.yaml", "-o", "new/deep/y.wav"],
    "preview": ["preview", "a.wav", "-o", "new/deep/x"],
    "sweep": ["sweep", "sweep.yaml", "-o", "new/deep/x.npz", "--picture", "new/deep/x.png"],
    "tradeoff": ["pareto", "a", "-d", "paper-6x6", "--picture", "new/deep/x.svg"],
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_missing_folder_is_made(given: Path, dotwave, name: str) -> None:
    ended = dotwave(*WRITERS[name])
    assert ended.code == 0, ended.err
    assert list((given / "new" / "deep").iterdir())


@pytest.mark.parametrize(
    "arguments",
    [
        ["text", "a", "-o", "new/deep/x.wav", "--tol", "1e-30", "-d", "linked-6x6"],
        ["render", "job.yaml", "--budget", "1us"],
        ["text", "a", "-o", "new/deep/x.csv", "--sample-format", "pcm24"],
    ],
)
def test_a_folder_made_for_a_run_that_fails_does_not_stay(given: Path, dotwave, arguments: list[str]) -> None:
    assert dotwave(*arguments).code in (1, 2)
    assert not (given / "new").exists()


def test_only_what_was_made_goes_again(tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()

    def fail() -> None:
        with atomic_files(tmp_path / "old" / "new" / "deep" / "x"):
            (tmp_path / "old" / "new" / "of someone else").touch()
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert [path.relative_to(tmp_path).as_posix() for path in sorted(tmp_path.rglob("*"))] == [
        "old", "old/new", "old/new/of someone else",
    ]  # fmt: skip
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="is not a folder"), atomic_files(tmp_path / "file" / "n" / "y"):
        pass
