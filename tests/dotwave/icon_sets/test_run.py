"""A set of icons from files to manifest: nothing lost, nothing done twice, the same bytes whoever does the work."""

from __future__ import annotations

import csv
import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from dotwave.errors import AppError
from dotwave.icon_sets import work
from dotwave.icon_sets.build import IconOptions, render_icons
from dotwave.icon_sets.journal import Journal
from dotwave.icon_sets.pool import LocalPool
from dotwave.icon_sets.work import Record, Task
from drivers import FileError
from encoders import GridShape, encode_picture

SAMPLES = Path(__file__).resolve().parents[3] / "samples" / "icons"
OUTPUTS = ("manifest.json", "manifest.csv", "contact.png", "index.html")
ONE = IconOptions(workers=1)


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The samples, rendered once."""
    out = tmp_path_factory.mktemp("icons")
    assert render_icons([str(SAMPLES)], out, ONE).ok
    return out


def manifest(out: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    return found


def journalled(out: Path) -> list[str]:
    return [json.loads(line)["key"] for line in (out / "journal.jsonl").read_bytes().splitlines() if line]


def test_the_manifest_says_what_the_encoder_says(done: Path) -> None:
    rows = manifest(done)["icons"]
    assert [row["name"] for row in rows] == sorted(path.name for path in SAMPLES.iterdir())
    for row in rows:
        scene = encode_picture(SAMPLES / row["name"], GridShape(6, 6))
        raised = np.abs(scene.frames[0].pattern.amplitude)
        assert row["pattern"] == ["".join(".o"[int(value)] for value in line) for line in raised]
        assert row["similarity"] == pytest.approx(scene.report.similarity, abs=2e-6)
        assert row["outcome"] == "ok"
        assert row["error"] < 1e-6


def test_a_budget_is_kept_by_the_clock_that_is_given(done: Path, tmp_path: Path) -> None:
    seconds = itertools.count()
    budget = replace(ONE, budget_s=4.5)
    # One reading when all begins, one when the work does; then one before each icon.
    first = render_icons([str(SAMPLES)], tmp_path, budget, clock=lambda: float(next(seconds)))
    icons = len(list(SAMPLES.iterdir()))
    assert (first.worked, len(first.unfinished), first.complete) == (4, icons - 4, False)
    assert "Budget 4.5 s: used up" in first.as_text()
    second = render_icons([str(SAMPLES)], tmp_path, budget, clock=lambda: 0.0)
    assert (second.worked, second.unfinished, second.complete) == (icons - 4, (), True)
    for name in OUTPUTS:
        assert (tmp_path / name).read_bytes() == (done / name).read_bytes()


def test_neighbours_are_the_nearest_in_dots(done: Path) -> None:
    rows = manifest(done)["icons"]
    dots = {row["name"]: "".join(row["pattern"]) for row in rows}
    for row in rows:
        apart = {
            name: sum(a != b for a, b in zip(dots[name], dots[row["name"]], strict=True))
            for name in dots
            if name != row["name"]
        }
        assert row["distance"] == min(apart.values()) == apart[row["nearest"]]


def test_csv_and_json_say_the_same(done: Path) -> None:
    with (done / "manifest.csv").open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    for row, line in zip(manifest(done)["icons"], table, strict=True):
        assert line["pattern"] == "/".join(row["pattern"])
        for name in ("name", "digest", "outcome", "nearest"):
            assert line[name] == row[name]
        assert float(line["similarity"]) == row["similarity"]
        assert int(line["distance"]) == row["distance"]


@pytest.mark.parametrize("distinct", [False, True])
def test_workers_and_order_change_nothing(tmp_path: Path, distinct: bool) -> None:
    files = [str(path) for path in sorted(SAMPLES.iterdir())]
    options = IconOptions(workers=1, distinct=distinct)
    render_icons(files, tmp_path / "one", options)
    render_icons(files[::-1], tmp_path / "two", IconOptions(workers=2, distinct=distinct))
    for name in OUTPUTS:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_a_second_run_works_on_nothing(done: Path) -> None:
    before = {name: (done / name).read_bytes() for name in OUTPUTS}
    report = render_icons([str(SAMPLES)], done, ONE)
    assert report.worked == 0
    assert before == {name: (done / name).read_bytes() for name in OUTPUTS}


@pytest.mark.parametrize("name", ["PLANS_VERSION", "PICTURES_VERSION", "WAVEFORMS_VERSION"])
def test_what_another_version_made_is_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    (tmp_path / "icons").mkdir()
    shutil.copy(SAMPLES / "heart.svg", tmp_path / "icons")
    again = [str(tmp_path / "icons")], tmp_path / "out", ONE
    assert [render_icons(*again).worked, render_icons(*again).worked] == [1, 0]
    version = getattr(work, name)
    monkeypatch.setattr(work, name, version + 1)
    assert render_icons(*again).worked == 1


def test_equal_pictures_are_told_apart_when_asked(tmp_path: Path) -> None:
    folder = tmp_path / "copies"
    folder.mkdir()
    for number in range(12):
        (folder / f"heart{number}.svg").write_bytes((SAMPLES / "heart.svg").read_bytes() + b" " * number)
    plain = render_icons([str(folder)], tmp_path / "plain", ONE)
    assert plain.pairs == (66,)
    assert plain.worked == 12
    apart = render_icons([str(folder)], tmp_path / "apart", IconOptions(workers=1, distinct=True))
    assert apart.pairs[:2] == (0, 0)
    assert apart.neighbours == 0
    assert apart.similarity > 0.9 * plain.similarity


@pytest.mark.parametrize("distinct", [False, True])
def test_one_file_is_one_icon_under_however_many_names(tmp_path: Path, distinct: bool) -> None:
    folder = tmp_path / "copies"
    folder.mkdir()
    for name in ("a", "b", "c"):
        shutil.copy(SAMPLES / "heart.svg", folder / f"{name}.svg")
    shutil.copy(SAMPLES / "sun.svg", folder)
    report = render_icons([str(folder)], tmp_path / "out", IconOptions(workers=1, distinct=distinct))
    assert [icon.same_as for icon in report.icons] == ["", "a.svg", "a.svg", ""]
    assert len({icon.pattern.amplitude.tobytes() for icon in report.icons}) == 2
    assert report.close == ()
    assert sum(report.pairs) == 1
    assert [icon.nearest for icon in report.icons] == ["sun.svg"] * 3 + ["a.svg"]


def test_what_may_not_be_known_is_said(tmp_path: Path) -> None:
    shapes = {
        "word": "".join(f'<rect x="{8 * k}" width="5" height="12"/>' for k in range(8)),
        "text": '<path d="M0 0h12v12h12v12H0z"/><text y="9">A</text>',
        "line": '<rect width="60" height="3"/>',
        "full": '<rect width="24" height="24"/><rect x="6" y="6" width="1" height="1" fill="white"/>',
        "plain": '<path d="M0 0h12v12h12v12H0z"/>',
    }
    folder = tmp_path / "set"
    folder.mkdir()
    for name, shape in shapes.items():
        (folder / f"{name}.svg").write_text(
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-2 -2 80 40">{shape}</svg>', encoding="utf-8"
        )
    report = render_icons([str(folder)], tmp_path / "out", ONE)
    said = {Path(icon.name).stem: icon.doubt for icon in report.icons}
    assert said["plain"] == ""
    for name, word in (("word", "row of signs"), ("text", "text is lost"), ("line", "straight line"), ("full", "full")):
        assert word in said[name], name
    assert report.doubted == 4
    assert [row["doubt"] for row in manifest(tmp_path / "out")["icons"]] == [icon.doubt for icon in report.icons]
    assert (tmp_path / "out/index.html").read_text(encoding="utf-8").count("<strong>Doubt:</strong>") == 4


def test_what_an_icon_font_says_of_its_icons_is_read(tmp_path: Path) -> None:
    folder = tmp_path / "font"
    (folder / "filled").mkdir(parents=True)
    for name in ("heart", "sun"):
        shutil.copy(SAMPLES / f"{name}.svg", folder / "filled")
    (folder / "codepoints.json").write_text('{"heart": 57345, "sun": true, "other": 9}')
    told = {"heart": {"category": "Health", "styles": {"filled": {"unicode": "f67c"}}}, "sun": {"label": "Sun <b>"}}
    (folder / "icons.json").write_text(json.dumps(told))
    (folder / "broken-metadata.json").write_text('{"heart": ')
    (folder / "tags.json").write_text('{"heart": 3}')
    render_icons([str(folder)], tmp_path / "out", ONE)
    rows = [(row["label"], row["code_point"], row["category"]) for row in manifest(tmp_path / "out")["icons"]]
    assert rows == [("", "U+F67C", "Health"), ("Sun <b>", "", "")]


def test_more_copies_than_dots_allow_get_textures(tmp_path: Path) -> None:
    """On four dots there are eight patterns two apart, levels make more."""
    profile = tmp_path / "small.yaml"
    text = (Path(__file__).resolve().parents[3] / "chainsim/model/profiles/paper-6x6.yaml").read_text(encoding="utf-8")
    for key in ("rows", "cols", "chain_length"):
        text = text.replace(f"\n{key}: 6", f"\n{key}: 2")
    profile.write_text(text, encoding="utf-8")
    folder = tmp_path / "copies"
    folder.mkdir()
    for number in range(14):
        (folder / f"p{number}.svg").write_bytes((SAMPLES / "pause.svg").read_bytes() + b" " * number)
    report = render_icons([str(folder)], tmp_path / "out", IconOptions(str(profile), workers=1, distinct=True))
    assert report.pairs[0] == 0
    assert any(0.5 in icon.pattern.amplitude for icon in report.icons)


def test_bad_files_are_reported_and_the_rest_is_done(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    shutil.copy(SAMPLES / "heart.svg", folder)
    (folder / "broken.png").write_bytes(b"\x89PNG\r\n\x1a\nnothing")
    (folder / "text.svg").write_bytes(b"<svg")
    Image.new("RGB", (20, 20), "white").save(folder / "white.gif")
    report = render_icons([str(folder)], tmp_path / "out", ONE)
    assert not report.ok
    assert [icon.name for icon in report.icons] == ["heart.svg"]
    assert [row["name"] for row in manifest(tmp_path / "out")["failed"]] == ["broken.png", "text.svg", "white.gif"]
    assert all("\n" not in error for error in report.failed.values())
    assert "nothing to feel" in report.failed["white.gif"]
    assert render_icons([str(folder)], tmp_path / "out", ONE).worked == 0


def test_waveforms_are_written_and_verify(tmp_path: Path) -> None:
    from dotwave.verification import verify

    files = [str(SAMPLES / name) for name in ("heart.svg", "play.svg")]
    options = IconOptions(workers=1, waveforms=True)
    report = render_icons(files, tmp_path, options)
    assert [icon.waveform for icon in report.icons] == ["waveforms/heart.svg.wav", "waveforms/play.svg.wav"]
    for icon in report.icons:
        check = verify(tmp_path / icon.waveform)
        assert check.ok
        assert np.array_equal(check.frames[0].felt_dots, icon.pattern.amplitude > 0)
    assert render_icons(files, tmp_path, options).worked == 0
    (tmp_path / "waveforms/heart.svg.wav").unlink()
    assert render_icons(files, tmp_path, options).worked == 1


def copies(folder: Path, count: int) -> Path:
    """A set of many different pictures, quick to make."""
    folder.mkdir()
    text = (SAMPLES / "sun.svg").read_text(encoding="utf-8")
    for number in range(count):
        (folder / f"{number:04d}.svg").write_text(text.replace("<svg ", f'<svg id="n{number}" ', 1), encoding="utf-8")
    return folder


def icons_command(folder: Path, out: Path) -> list[str]:
    return [sys.executable, "-m", "dotwave", "icons", str(folder), "-o", str(out), "--workers", "2"]


def started(folder: Path, out: Path) -> subprocess.Popen[bytes]:
    running = subprocess.Popen(
        icons_command(folder, out), stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    )
    journal = out / "journal.jsonl"
    until = time.monotonic() + 60
    while time.monotonic() < until and running.poll() is None and not (journal.exists() and journal.stat().st_size):
        time.sleep(0.01)
    assert running.poll() is None
    return running


def test_after_kill_9_the_next_run_goes_on_and_repeats_nothing(tmp_path: Path) -> None:
    folder, out = copies(tmp_path / "set", 240), tmp_path / "out"
    running = started(folder, out)
    os.killpg(running.pid, signal.SIGKILL)
    running.communicate()
    finished = set(journalled(out))
    assert 0 < len(finished) < 240
    # A line cut short, as a full disk leaves it, is not a record.
    with (out / "journal.jsonl").open("ab") as file:
        file.write(b'{"key":"icon:cut')
    again = subprocess.run([*icons_command(folder, out), "--json"], capture_output=True, check=True)
    report = json.loads(again.stdout)
    assert report["worked"] == 240 - len(finished)
    assert len(report["icons"]) == 240
    lines = [line for line in (out / "journal.jsonl").read_bytes().splitlines() if line and not line.endswith(b"cut")]
    assert len({json.loads(line)["key"] for line in lines}) == len(lines) == 240


def test_ctrl_c_leaves_a_manifest_of_what_is_finished(tmp_path: Path) -> None:
    folder, out = copies(tmp_path / "set", 240), tmp_path / "out"
    running = started(folder, out)
    os.killpg(running.pid, signal.SIGINT)
    _, errors = running.communicate(timeout=30)
    assert running.returncode == 130
    assert b"Traceback" not in errors
    found = manifest(out)
    assert found["complete"] is False
    assert len(found["icons"]) + len(found["unfinished"]) == 240
    assert 0 < len(found["icons"]) < 240
    assert all(row["outcome"] == "ok" for row in found["icons"])


def deadly(recipe: None, tasks: Sequence[Task]) -> list[Record]:
    """Work that ends its process for one task, as running out of memory does."""
    if any(task.key == "deadly" for task in tasks):
        os.kill(os.getpid(), signal.SIGKILL)
    return [{"key": task.key} for task in tasks]


def test_a_picture_that_ends_its_process_takes_no_other_with_it() -> None:
    tasks = [Task("deadly" if number == 7 else str(number)) for number in range(20)]
    with LocalPool(2) as pool:
        records = [record for batch in pool.run(deadly, None, iter(tasks), 4) for record in batch]
    assert sorted(record["key"] for record in records) == sorted(task.key for task in tasks)
    lost = [record for record in records if "lost" in record]
    assert [record["key"] for record in lost] == ["deadly"]
    assert "ended" in lost[0]["bad"]


def count(recipe: None, tasks: Sequence[Task]) -> list[Record]:
    return [{"key": task.key, "batch": len(tasks)} for task in tasks]


def test_large_pictures_go_in_small_batches() -> None:
    for size, batch in ((10, 4), (1 << 21, 1)):
        tasks = [Task(str(number), bytes(size)) for number in range(8)]
        with LocalPool(1) as pool:
            records = [record for part in pool.run(count, None, tasks, 4) for record in part]
        assert [record["batch"] for record in records] == [batch] * 8


def test_the_journal_keeps_what_was_added(tmp_path: Path) -> None:
    path = tmp_path / "j.jsonl"
    with Journal(path) as journal:
        journal.add({"key": "a", "x": 1}, {"key": "b"})
        journal.add({"key": "a", "x": 2})
    with path.open("ab") as file:
        file.write(b'{"key": "c"')
    with Journal(path) as journal:
        assert journal.find("a") == {"key": "a", "x": 2}
        assert journal.find("c") is None
        journal.add({"key": "d"})
    with Journal(path) as journal:
        assert journal.find("d") == {"key": "d"}


class Page(HTMLParser):
    """What someone who cannot see a page has of it."""

    def __init__(self) -> None:
        super().__init__()
        self.headings: list[str] = []
        self.labels: list[str] = []
        self.links: list[str] = []
        self.ids: list[str] = []
        self.text: list[str] = []
        self.inside: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag == "svg":
            assert given["role"] == "img"
            self.labels.append(given["aria-label"] or "")
        if tag == "img":
            assert "alt" in given
        if tag == "a":
            self.links.append(given["href"] or "")
        if tag == "html":
            assert given["lang"] == "en"
        if "id" in given:
            self.ids.append(given["id"] or "")
        self.inside.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert tag in self.inside
        while self.inside.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if self.inside and self.inside[-1] == "h3":
            self.headings.append(data)
        self.text.append(data)


def test_the_page_works_without_eyes_and_mouse(done: Path) -> None:
    page = Page()
    page.feed((done / "index.html").read_text(encoding="utf-8"))
    rows = manifest(done)["icons"]
    text = "".join(page.text)
    assert page.headings == [row["name"] for row in rows]
    assert page.text.index("Icons") < page.text.index("alarm.svg")
    for row, label in zip(rows, page.labels, strict=True):
        assert row["braille"] in text
        assert label.startswith(f"{sum(line.count('o') for line in row['pattern'])} of 36 dots raised")
        assert label in text
    assert len(set(page.ids)) == len(page.ids)
    assert {link.removeprefix("#") for link in page.links} <= set(page.ids)


def test_names_cannot_break_the_page(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    name = "<b> & \"x'.svg"
    shutil.copy(SAMPLES / "heart.svg", folder / name)
    render_icons([str(folder)], tmp_path / "out", ONE)
    page = Page()
    page.feed((tmp_path / "out/index.html").read_text(encoding="utf-8"))
    assert "".join(page.headings) == name


@pytest.mark.parametrize("content", [b"my notes\n", b'{"mine": 1}\n', b"\0" * 100, b"[]"])
def test_a_file_that_is_no_journal_is_refused_and_stays(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "journal.jsonl").write_bytes(content)
    with pytest.raises(FileError, match=r"journal\.jsonl: not a journal of dotwave; give another folder"):
        render_icons([str(SAMPLES / "heart.svg")], tmp_path, ONE)
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("journal.jsonl", content)]


def test_a_journal_is_not_looked_for_behind_a_link(tmp_path: Path) -> None:
    (tmp_path / "victim").write_bytes(b"")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "journal.jsonl").symlink_to(tmp_path / "victim")
    with pytest.raises(FileError, match=r"journal\.jsonl: "):
        render_icons([str(SAMPLES / "heart.svg")], tmp_path / "out", ONE)
    assert (tmp_path / "victim").read_bytes() == b""


@pytest.mark.parametrize("cut", [0, 1, 5, 9])
def test_a_journal_cut_short_in_its_first_line_goes_on(tmp_path: Path, cut: int) -> None:
    (tmp_path / "x.jsonl").write_bytes(b'{"key":"a"'[:cut])
    for _ in range(2):
        with Journal(tmp_path / "x.jsonl") as journal:
            journal.add({"key": "b"})
    with Journal(tmp_path / "x.jsonl") as journal:
        assert journal.find("b") == {"key": "b"}


@pytest.mark.parametrize("name", ["index.html", "manifest.json", "waveforms"])
def test_a_folder_of_others_is_left_as_it_is(tmp_path: Path, name: str) -> None:
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / name).write_text("somebody's own")
    with pytest.raises(AppError, match=f"has {name}, and no journal.jsonl that says dotwave made it; give another"):
        render_icons([str(SAMPLES)], tmp_path / "site", IconOptions(workers=1))
    assert [path.read_text() for path in (tmp_path / "site").iterdir()] == ["somebody's own"]
