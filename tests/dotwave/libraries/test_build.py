"""A folder of texts as one job: each file as it is alone, once, whatever ended the run before."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from chainsim import load_device
from dotwave.errors import AppError
from dotwave.libraries.build import WorkPlaces, render_library
from dotwave.libraries.report import LibraryReport
from dotwave.request import Request
from encoders import TextOptions

DEVICE = load_device("linked-6x6")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    texts = tmp_path / "texts"
    (texts / "more").mkdir(parents=True)
    (texts / "one.txt").write_text("Hello world", encoding="utf-8")
    (texts / "one.md").write_text("# Hello\n\nworld", encoding="utf-8")
    (texts / "more" / "two.txt").write_text("twice", encoding="utf-8")
    (texts / "picture.png").write_bytes(b"no text")
    return texts


def rendered(
    folder: Path, out: Path, *, options: TextOptions | None = None, workers: int = 1, waveforms: bool = True
) -> LibraryReport:
    places = WorkPlaces(workers)
    return render_library(folder, out, DEVICE, options or TextOptions(), Request(), waveforms=waveforms, places=places)


def files(out: Path, suffixes: Sequence[str] = (".wav", ".json")) -> dict[str, bytes]:
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in out.rglob("*") if path.suffix in suffixes}


@pytest.mark.slow
def test_each_file_is_rendered_as_it_is_alone(folder: Path, tmp_path: Path) -> None:
    report = rendered(folder, tmp_path / "out", workers=2)
    assert report.ok
    assert [one["name"] for one in report.texts] == ["one.md", "one.txt", "more/two.txt"]
    call = [sys.executable, "-m", "dotwave", "text", "one.txt", "-d", "linked-6x6", "-o", str(tmp_path / "one.txt.wav")]
    subprocess.run(call, cwd=folder, check=True, capture_output=True)
    for name in ("one.txt.wav", "one.txt.json"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / name).read_bytes()
    alone = rendered(folder, tmp_path / "alone", workers=1)
    assert files(tmp_path / "alone") == files(tmp_path / "out")
    assert alone.manifest() == report.manifest()


def test_nothing_is_done_twice_and_what_changed_is_done_again(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert rendered(folder, out).worked == 3
    before = files(out)
    assert rendered(folder, out).worked == 0
    (folder / "one.txt").write_text("Hello again", encoding="utf-8")
    (out / "one.md.wav").unlink()
    assert rendered(folder, out).worked == 2
    after = files(out)
    changed = {name for name in before if after[name] != before[name]}
    assert changed - {"library.json"} == {"one.txt.wav", "one.txt.json"}
    # Other options are other files; going back is too.
    slow = TextOptions(rate=2.0)
    assert rendered(folder, out, options=slow).worked == 3
    assert rendered(folder, out).worked == 3
    assert files(out) == after


def test_a_kill_between_a_waveform_and_its_record_is_seen(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    rendered(folder, out)
    whole = files(out)
    lines = (out / "journal.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    rendered(folder, out, options=TextOptions(rate=2.0))
    journal = (out / "journal.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    # As it stands when the second run is killed after its files were written and before they were noted.
    (out / "journal.jsonl").write_text("".join(journal[: len(lines) + 3]), encoding="utf-8")
    assert [json.loads(line)["made"] for line in journal[len(lines) : len(lines) + 3]] == [""] * 3
    rendered(folder, out)
    assert files(out) == whole | {"library.json": files(out)["library.json"]}


def test_files_that_cannot_be_used_are_listed_and_tried_again(folder: Path, tmp_path: Path) -> None:
    (folder / "broken.txt").write_bytes(b"a\0b")
    report = rendered(folder, tmp_path / "out", waveforms=False)
    assert not report.ok
    assert "NUL" in report.failed["broken.txt"]
    assert len(report.texts) == 3
    assert "broken.txt: could not be used: " in report.as_text()
    kept = json.loads((tmp_path / "out" / "library.json").read_text(encoding="utf-8"))
    assert kept["failed"] == [{"name": "broken.txt", "error": report.failed["broken.txt"]}]
    (folder / "broken.txt").write_text("mended", encoding="utf-8")
    again = rendered(folder, tmp_path / "out", waveforms=False)
    assert again.ok
    assert again.worked == 1
    assert not files(tmp_path / "out", (".wav",))


def test_what_cannot_be_made_is_not_ok(folder: Path, tmp_path: Path) -> None:
    report = render_library(
        folder, tmp_path / "out", DEVICE, TextOptions(), Request(tol=1e-12), waveforms=True, places=WorkPlaces(1)
    )
    assert not report.ok
    assert not any(one["ok"] or one["waveform"] for one in report.texts)
    assert "are allowed" in report.texts[0]["note"]


def test_what_dotwave_did_not_make_stays(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(AppError, match=r"out: is not empty and has no journal\.jsonl"):
        rendered(folder, out)
    assert [path.name for path in out.iterdir()] == ["mine.txt"]


def test_what_a_folder_cannot_be_asked_for(folder: Path, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(AppError, match="no texts or documents in it"):
        rendered(empty, tmp_path / "out")
    for request, out, said in (
        (Request(explain=True), tmp_path / "out", "--explain"),
        (Request(), None, "give -o FOLDER"),
    ):
        with pytest.raises(AppError, match=said):
            render_library(folder, out, DEVICE, TextOptions(), request, waveforms=True, places=WorkPlaces(1))
    assert not (tmp_path / "out").exists()


def test_its_own_output_is_not_read(folder: Path) -> None:
    out = folder / "out"
    rendered(folder, out, waveforms=False)
    (out / "left.txt").write_text("not of the library", encoding="utf-8")
    assert len(rendered(folder, out, waveforms=False).texts) == 3


@pytest.mark.slow
def test_ctrl_c_leaves_a_manifest_and_the_same_call_goes_on(folder: Path, tmp_path: Path) -> None:
    for number in range(20):
        (folder / f"{number}.txt").write_text(f"text {number} " * 20, encoding="utf-8")
    call = [sys.executable, "-m", "dotwave", "text", str(folder), "-o", str(tmp_path / "out"), "--workers", "1"]
    with subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        journal = tmp_path / "out" / "journal.jsonl"
        while process.poll() is None and not (journal.exists() and b"\n" in journal.read_bytes()[1:]):
            pass
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=120)
    assert process.returncode in (0, 130)
    kept = json.loads((tmp_path / "out" / "library.json").read_text(encoding="utf-8"))
    assert len(kept["texts"]) + len(kept["unfinished"]) == 23
    ended = subprocess.run([*call, "--json"], capture_output=True, check=True)
    report = json.loads(ended.stdout)
    assert report["ok"]
    assert report["worked"] == 23 - len(kept["texts"])


@pytest.mark.slow
@pytest.mark.filterwarnings("default:::distributed")
@pytest.mark.filterwarnings("default::ResourceWarning")
@pytest.mark.filterwarnings("default::pytest.PytestUnraisableExceptionWarning")
def test_a_cluster_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    rendered(folder, tmp_path / "here")
    with (
        warnings.catch_warnings(),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
    ):
        places = replace(WorkPlaces(), scheduler=cluster.scheduler_address)
        assert render_library(
            folder, tmp_path / "there", DEVICE, TextOptions(), Request(), waveforms=True, places=places
        ).ok
    assert files(tmp_path / "here") == files(tmp_path / "there")
