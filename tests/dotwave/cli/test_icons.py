"""The commands image, icons, render and schema: exit codes, JSON, one line on stderr."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

SAMPLES = Path(__file__).resolve().parents[3] / "samples"
HEART = SAMPLES / "icons" / "heart.svg"


def test_image_writes_a_waveform_that_verifies(dotwave: Callable[..., Any], tmp_path: Path) -> None:
    out = tmp_path / "heart.wav"
    ended = dotwave("image", HEART, "-o", out, "--explain", tmp_path / "steps", "--json")
    assert ended.code == 0
    report = json.loads(ended.out)
    assert report["ok"] is True
    assert report["files"][:2] == [str(out), str(out.with_suffix(".json"))]
    assert len(list((tmp_path / "steps").iterdir())) == len(report["files"]) - 2 >= 5
    assert dotwave("verify", out).code == 0


def test_image_takes_the_options_of_the_encoder(dotwave: Callable[..., Any]) -> None:
    plain = dotwave("image", SAMPLES / "photos" / "ball.jpg", "--json")
    zoomed = dotwave(
        "image", SAMPLES / "photos" / "ball.jpg", "--zoom", 2, "--as", "levels", "--fit", "stretch", "--json"
    )
    assert json.loads(plain.out)["frames"] == 1 < json.loads(zoomed.out)["frames"]


def test_icons_reports_bad_files_with_exit_code_1(dotwave: Callable[..., Any], tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    shutil.copy(HEART, folder)
    good = dotwave("icons", folder, "-o", tmp_path / "good", "--workers", 1)
    assert good.code == 0
    assert "Icons: 1 for paper-6x6, 1 ok." in good.out
    (folder / "bad.png").write_bytes(b"nothing")
    bad = dotwave("icons", folder, "-o", tmp_path / "good", "--workers", 1, "--json")
    assert bad.code == 1
    report = json.loads(bad.out)
    assert [row["name"] for row in report["icons"]] == ["heart.svg"]
    assert [row["name"] for row in report["failed"]] == ["bad.png"]


def test_what_cannot_be_used_is_one_line_and_exit_code_2(dotwave: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "j.yaml").write_text("sequence: [{text: a}]\ndevice: {grid: {rows: six}}\n", encoding="utf-8")
    for arguments, words in (
        (("image", tmp_path / "none.png"), "cannot be read"),
        (("image", HEART, "--fit", "tight"), "--fit: expected one of contain, cover, stretch"),
        (("image", HEART, "--explain", HEART), "heart.svg"),
        (("icons", tmp_path / "none", "-o", tmp_path / "out"), "no such file or folder"),
        (("icons", SAMPLES / "texts", "-o", tmp_path / "out"), "no pictures found"),
        (("icons", HEART, "-o", HEART), "heart.svg"),
        (("icons", HEART, "-o", tmp_path / "out", "--device", "none"), "not a built-in profile"),
        (("render", tmp_path / "none.yaml"), "No such file"),
        (
            ("render", tmp_path / "j.yaml"),
            "j.yaml:2: device.grid.rows: expected a whole number from 1 to 1024, got 'six'",
        ),
    ):
        ended = dotwave(*arguments)
        assert ended.code == 2, arguments
        assert words in ended.err
        assert ended.err.count("\n") == 1


def test_render_says_what_cannot_be_made_with_exit_code_1(dotwave: Callable[..., Any], tmp_path: Path) -> None:
    job = tmp_path / "job.yaml"
    job.write_text("device: paper-6x6-ring\nsequence: [{texture: {bars: {width: 1, gap: 1}}}]", encoding="utf-8")
    ended = dotwave("render", job, "-o", tmp_path / "x.wav")
    assert ended.code == 1
    assert "Nothing was written." in ended.out
    assert list(tmp_path.iterdir()) == [job]


def test_render_and_schema(dotwave: Callable[..., Any], tmp_path: Path) -> None:
    out = tmp_path / "text.wav"
    ended = dotwave("render", SAMPLES / "jobs" / "text.yaml", "-o", out)
    assert ended.code == 0
    assert f"Written: {out}" in ended.out
    assert "Hello" in dotwave("verify", out).out
    assert json.loads(dotwave("schema").out)["title"] == "Job"


def test_a_set_of_icons_becomes_a_pack(dotwave: Callable[..., Any], tmp_path: Path) -> None:
    folder, pack = tmp_path / "set", tmp_path / "icons.dwp"
    (folder / "more").mkdir(parents=True)
    for name in ("heart.svg", "lock.svg", "more/lock.svg", "paper-plane_2.svg"):
        shutil.copy(HEART, folder / name)
    made = dotwave("icons", folder, "-o", tmp_path / "out", "--workers", 1, "--pack", pack, "--json")
    report = json.loads(made.out)
    assert made.code == 0
    assert report["files"][-1] == str(pack)
    assert report["reached"] == [f"Pack: 4 icons in {pack.stat().st_size} bytes."]
    from drivers import Pack

    opened = Pack(pack)
    assert sorted(opened.names()) == ["heart", "lock.svg", "more/lock.svg", "paper-plane_2"]
    assert opened.find("paper-plane_2").spoken == "paper plane 2"
    felt = dotwave("verify", pack, "--icon", "heart", "--json")
    assert (felt.code, json.loads(felt.out)["wrong_dots"]) == (0, 0)
    for given, why in (
        (["verify", pack, "--icon", "hart"], "it has no 'hart'; like it: heart"),
        (["play", pack], "it has 4 icons; name one with --icon"),
        (["verify", folder / "heart.svg", "--icon", "heart"], "only a pack (.dwp) has icons"),
        (
            ["icons", folder, "-o", tmp_path / "two", "--pack", tmp_path / "icons.zip"],
            "expected a name that ends in .dwp",
        ),
    ):
        refused = dotwave(*given)
        assert (refused.code, refused.err.count("\n")) == (2, 1)
        assert why in refused.err
    assert not (tmp_path / "two").exists()
    drawn = dotwave("preview", pack, "--icon", "heart", "-o", tmp_path / "heart")
    assert (drawn.code, (tmp_path / "heart.png").is_file()) == (0, True)
    played = dotwave("play", pack, "--icon", "heart", "--json")
    assert (played.code, json.loads(played.out)["live"]) == (0, False)
