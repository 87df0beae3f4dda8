"""Jobs of other people: nothing foreign is quoted, with --root nothing outside is touched, errors keep their line."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from dotwave.rendering.job import render_job

ROOT = Path(__file__).resolve().parents[3]
SECRET = "hunter2:x:0:0\n"


@pytest.fixture
def house(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for jobs with a secret beside it, and a current folder that is neither."""
    (tmp_path / "jobs").mkdir()
    (tmp_path / "cwd").mkdir()
    (tmp_path / "secret").write_text(SECRET, encoding="utf-8")
    (tmp_path / "secret.yaml").write_text(SECRET, encoding="utf-8")
    (tmp_path / "jobs" / "link.txt").symlink_to(tmp_path / "secret")
    (tmp_path / "jobs" / "links").symlink_to(tmp_path)
    (tmp_path / "jobs" / "own.txt").write_text("Hello", encoding="utf-8")
    (tmp_path / "jobs" / "own.utb").write_text("include ../secret\n", encoding="utf-8")
    (tmp_path / "jobs" / "heart.svg").write_bytes((ROOT / "samples" / "icons" / "heart.svg").read_bytes())
    profile = (ROOT / "chainsim" / "model" / "profiles" / "linked-6x6.yaml").read_text(encoding="utf-8")
    (tmp_path / "jobs" / "mine.yaml").write_text(profile.replace("name: linked-6x6", "name: mine"), encoding="utf-8")
    os.mkfifo(tmp_path / "jobs" / "pipe")
    monkeypatch.chdir(tmp_path / "cwd")
    return tmp_path


def job(house: Path, text: str) -> Path:
    path = house / "jobs" / "job.yaml"
    path.write_text(text, encoding="utf-8")
    return path


OUTSIDE = {
    "sequence:\n  - text: {file: ../secret}": "2: sequence.0.text.file: ../secret is outside --root",
    "sequence:\n  - text: a\n  - text: {file: /etc/passwd}": "3: sequence.1.text.file: /etc/passwd is outside",
    "sequence:\n  - text: {file: link.txt}": "2: sequence.0.text.file: link.txt is outside",
    "sequence:\n  - text:\n      file: links/secret": "3: sequence.0.text.file: links/secret is outside",
    "sequence:\n  - image: ../secret": "2: sequence.0.image.file: ../secret is outside",
    "sequence:\n  - icon: {file: links/jobs/../secret}": "2: sequence.0.icon.file: links/jobs/../secret is outside",
    "device: ../secret.yaml\nsequence: [{text: a}]": "1: device.base: ../secret.yaml is outside",
    "device:\n  base: links/secret.yaml\nsequence: [{text: a}]": "2: device.base: links/secret.yaml is outside",
    "output: ../x.wav\nsequence: [{text: a}]": "1: output: ../x.wav is outside",
    "output: links/new/x.wav\nsequence: [{text: a}]": "1: output: links/new/x.wav is outside",
    "output: link.txt\nsequence: [{text: a}]": "1: output: link.txt is outside",
    "sequence:\n  - text: {say: a, table: /etc/passwd}": "2: sequence.0.text.table: /etc/passwd is not one of liblouis",
    "sequence:\n  - text: {say: a, table: own.utb}": "2: sequence.0.text.table: own.utb is not one of liblouis",
    "sequence:\n  - text: {say: a, table: 'en-ueb-g2.ctb,../secret'}": "2: sequence.0.text.table: ../secret is not one",
}


@pytest.mark.parametrize("text", OUTSIDE)
def test_a_job_cannot_lead_out_of_its_root(house: Path, dotwave, text: str) -> None:
    ended = dotwave("render", job(house, text), "--root", house / "jobs")
    assert (ended.code, ended.out) == (2, "")
    assert ended.err.startswith(f"dotwave: {house / 'jobs' / 'job.yaml'}:{OUTSIDE[text]}")
    assert "hunter2" not in ended.err
    assert sorted(path.name for path in house.iterdir()) == ["cwd", "jobs", "secret", "secret.yaml"]


def test_a_job_file_that_is_a_link_is_outside_too(house: Path, dotwave) -> None:
    path = house / "jobs" / "job.yaml"
    path.symlink_to(house / "secret")
    ended = dotwave("render", path, "--root", house / "jobs")
    assert ended.code == 2
    assert "outside --root" in ended.err
    assert "hunter2" not in ended.err


@pytest.mark.parametrize("item", ["text: {file: pipe}", "image: pipe", "image: ."])
def test_below_the_root_only_files_are_read(house: Path, dotwave, item: str) -> None:
    ended = dotwave("render", job(house, f"sequence: [{{{item}}}]"), "--root", house / "jobs")
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert "is not a file" in ended.err


def test_a_table_of_the_current_folder_does_not_stand_in_for_one_of_liblouis(house: Path, dotwave) -> None:
    (house / "cwd" / "en-ueb-g2.ctb").write_text(f"include {house / 'secret'}\n", encoding="utf-8")
    ended = dotwave("render", job(house, "sequence: [{text: a}]"), "--root", house / "jobs")
    assert ended.code == 2
    assert "en-ueb-g2.ctb is not one of liblouis's own" in ended.err


def test_a_job_below_its_root_is_carried_out(house: Path) -> None:
    text = (
        "device: mine.yaml\noutput: new/../deep/x.wav\nsequence:\n"
        "  - text: {file: own.txt, table: 'language:en grade:2'}\n  - icon: heart.svg\n"
        "  - text: {file: links/jobs/own.txt}\n"
    )
    report = render_job(job(house, text), root=house / "jobs")
    assert report.ok
    assert report.device == "mine"
    assert (house / "jobs" / "deep" / "x.json").is_file()
    free = render_job(job(house, text), house / "free.wav")
    assert free.ok
    assert (house / "free.wav").read_bytes() == (house / "jobs" / "deep" / "x.wav").read_bytes()


@pytest.mark.parametrize(
    "text",
    [
        "sequence: [{text: {say: a, table: SECRET}}]",
        "device: ../secret\nsequence: [{text: a}]",
        "sequence: [{image: SECRET}]",
        "sequence: [{text: {say: a, table: ../jobs/own.utb}}]",
    ],
)
def test_without_a_root_errors_quote_no_file_either(house: Path, dotwave, text: str) -> None:
    ended = dotwave("render", job(house, text.replace("SECRET", str(house / "secret"))))
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert "hunter2" not in ended.err


LATER = {
    "device: linked-6x6\nsequence:\n  - text: a\n  - text:\n      say: b\n      dwell_s: 0.1": "4: sequence.1.text: ",
    "device: linked-6x6\nsequence:\n  - text: {say: b, dwell_s: 0.1}": "3: sequence.0.text: ",
    "sequence:\n  - text: ''": "2: sequence.0.text: ",
    "sequence:\n  - texture:\n      regions: [{top: 0, bottom: 9, left: 0, right: 1, bars: {width: 1, gap: 1}}]": (
        "2: sequence.0.texture: "
    ),
    "sequence:\n  - pause_s: 1\n  - image: nowhere.png": "3: sequence.1.image: ",
    "output: x.mp3\nsequence:\n  - text: a": "1: output: ",
}


@pytest.mark.parametrize("text", LATER)
def test_what_turns_out_wrong_later_keeps_its_line(house: Path, dotwave, text: str) -> None:
    path = job(house, text)
    ended = dotwave("render", path, "-o" if "output" not in text else "--tol", "x.wav" if "output" not in text else "1")
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert ended.err.startswith(f"dotwave: {path}:{LATER[text]}")
