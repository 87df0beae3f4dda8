"""Words of others in what people read: shown as what they are, on terminals, pages, tables and pictures."""

from __future__ import annotations

import csv
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from dotwave.figures.lettering import plain_letters
from dotwave.figures.preview import write_preview
from dotwave.icon_sets.build import IconOptions, render_icons
from dotwave.plain import csv_cell, html_words, one_line, printable
from dotwave.reports.text import FrameCheck, VerifyReport
from planner import FrameWish

ROOT = Path(__file__).resolve().parents[3]
HEART = ROOT / "samples" / "icons" / "heart.svg"
CONTROLS = [chr(code) for code in (*range(9), *range(11, 32), *range(127, 160))]
TURNING = list("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
RAW = re.compile("[" + "".join(map(re.escape, [*CONTROLS, *TURNING])) + "\ud800-\udfff]")
NASTY = "a\x1b[31mb\x9b2J\x07\u202egnp.exe\u2069\u200f"


@pytest.mark.parametrize("character", [*CONTROLS, *TURNING, "\u2028", "\u2029", "\udcff"])
def test_nothing_hidden_is_shown_as_it_is(character: str) -> None:
    escape = f"\\u{ord(character):04x}"
    for shown in (printable, one_line, html_words, csv_cell):
        assert shown(f"a{character}b") == f"a{escape}b"
    assert json.loads(printable(json.dumps(f"a{character}b", ensure_ascii=False))) == f"a{character}b"


def test_letters_of_every_script_are_left_alone() -> None:
    for words in ("السَّلامُ عَلَيْكُم", "שלום", "नमस्ते", "می\u200cخواهم", "👩\u200d💻", "Grüße, naïve"):
        assert printable(words) == one_line(words) == html_words(words) == csv_cell(words) == words


def test_only_whole_reports_have_lines() -> None:
    assert printable("a\n\tb") == "a\n\tb"
    assert one_line("a\n\tb") == "a\\u000a\\u0009b"


@given(st.text(st.characters(exclude_categories=["Cs", "Cc", "Cf", "Zl", "Zp"])))
def test_cells_are_no_formulas_and_can_be_read_back(words: str) -> None:
    cell = csv_cell(words)
    assert not cell.startswith(("=", "+", "-", "@", "\t", "\r"))
    assert (cell[1:] if cell.startswith("'") else cell) == words


NAME = "=a$\\frac{$b\x1b[31m\u202ex\nOK"


def nasty_profile(folder: Path) -> Path:
    """A profile whose name would colour a terminal, turn a page, and begins as a formula; JSON strings are YAML."""
    text = (ROOT / "chainsim/model/profiles/paper-6x6.yaml").read_text(encoding="utf-8").splitlines()
    lines = [f"name: {json.dumps(NAME)}" if line.startswith("name:") else line for line in text]
    path = folder / "nasty.yaml"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_a_set_of_icons_shows_nothing_raw(tmp_path: Path) -> None:
    folder, out = tmp_path / "set", tmp_path / "out"
    folder.mkdir()
    for name in (NASTY, "=1+1", "-x", "@y", "'z", "שלום"):
        shutil.copy(HEART, folder / f"{name}.svg")
    (folder / f"=bad{NASTY}.png").write_bytes(b"nothing")
    report = render_icons([str(folder)], out, IconOptions(str(nasty_profile(tmp_path)), workers=1))
    for name in ("index.html", "manifest.csv", "manifest.json"):
        assert not RAW.search((out / name).read_text(encoding="utf-8")), name
    assert not RAW.search(printable(report.as_text()))
    assert "\nOK" not in report.as_text()
    assert "שלום.svg" in (out / "index.html").read_text(encoding="utf-8")
    with (out / "manifest.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 7
    assert not [cell for row in rows for cell in row.values() if cell.startswith(("=", "+", "-", "@"))]
    assert {"'=1+1.svg", "'-x.svg", "'@y.svg", "''z.svg", "שלום.svg"} <= {row["name"] for row in rows}
    shown = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    assert {icon["name"] for icon in shown["icons"]} >= {"=1+1.svg", "-x.svg", "@y.svg", "'z.svg", "שלום.svg"}


def test_names_on_a_page_turn_nothing_beside_them(tmp_path: Path) -> None:
    folder, out = tmp_path / "set", tmp_path / "out"
    folder.mkdir()
    for name in ("שלום", "سلام"):
        shutil.copy(HEART, folder / f"{name}.svg")
    (folder / "אבג.png").write_bytes(b"nothing")
    render_icons([str(folder)], out, IconOptions(workers=1))
    page = (out / "index.html").read_text(encoding="utf-8")
    for name in ("שלום.svg", "سلام.svg", "אבג.png"):
        found = re.findall(rf"<([^<>]*)>{name}<", page)
        assert found
        assert all(tag == "bdi" or 'dir="auto"' in tag for tag in found), found


def check(text: str) -> FrameCheck:
    target = np.full((6, 6), 0.1)
    target[0, 0] = 1.0
    return FrameCheck(
        0, 0.0, 0.3, 1.0, f"odd{NASTY}", target, FrameWish(target), target.copy(), 0, 20.0, 0.0,
        "⠁⠀⠀\n⠀⠀⠀", "⠁⠀⠀\n⠀⠀⠀", text,
    )  # fmt: skip


def test_the_text_of_a_preview_shows_nothing_raw(tmp_path: Path) -> None:
    text = f"one{NASTY}\nFrame 9 of 9\u0085שלום"
    report = VerifyReport(
        f"x{NASTY}\n.wav", f"dev\n{NASTY}", (check(text),), 8000, 8000, text, text, True, notes=(NASTY,)
    )
    made = write_preview(report, tmp_path / "x")
    spelled = (tmp_path / "x.txt").read_text(encoding="utf-8")
    assert not RAW.search(spelled.replace("\n", ""))
    assert "\\u001b[31m" in spelled
    assert "שלום" in spelled
    lines = spelled.split("\n")
    assert "Frame 9 of 9" not in lines
    assert not RAW.search(printable(made.as_text()))
    whole = replace(made, files=("a\nVerified: b",))
    assert "Verified: b" not in whole.as_text().split("\n")


def test_words_on_pictures_show_nothing_raw() -> None:
    shown = plain_letters(f"one{NASTY}\ttwo")
    assert not RAW.search(shown)
    assert shown.endswith("\\u200f two")


def test_a_terminal_gets_nothing_raw(dotwave: Callable[..., Any], tmp_path: Path) -> None:
    profile = nasty_profile(tmp_path)
    for arguments in (("devices", profile), ("text", "Hi", "--device", profile)):
        ended = dotwave(*arguments)
        assert ended.code == 0
        assert not RAW.search(ended.out.replace("\n", ""))
        data = dotwave(*arguments, "--json")
        assert not RAW.search(data.out.replace("\n", ""))
        assert NAME in every_string(json.loads(data.out))
    missing = dotwave("image", tmp_path / f"no{NASTY}.png")
    assert missing.code == 2
    assert not RAW.search(missing.err.replace("\n", ""))
    assert missing.err.count("\n") == 1


def every_string(data: Any) -> set[str]:
    if isinstance(data, dict | list):
        return {one for part in (data.values() if isinstance(data, dict) else data) for one in every_string(part)}
    return {data} if isinstance(data, str) else set()


@pytest.mark.parametrize("command", ["tradeoff", "pareto"])
def test_a_name_with_dollars_is_no_formula(dotwave: Callable[..., Any], tmp_path: Path, command: str) -> None:
    more = ("--tol", "1e-2") if command == "tradeoff" else ()
    picture = tmp_path / "x.png"
    ended = dotwave(command, "Hi", "--device", nasty_profile(tmp_path), "--picture", picture, *more)
    assert ended.code == 0, ended.err
    assert picture.is_file()
