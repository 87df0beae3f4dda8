"""Pictures and their text: what is drawn is what was measured."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw
from PIL.GifImagePlugin import GifImageFile

from dotwave.errors import AppError
from dotwave.figures.card import CardShape, draw_card, draw_disc
from dotwave.figures.lettering import PAPER, cells_width, draw_cells, fit, font, has_glyphs
from dotwave.figures.preview import FRAMES_PER_PICTURE, write_preview
from dotwave.reports.spoken import spoken
from dotwave.reports.text import FrameCheck, VerifyReport
from drivers import DriverError
from planner import FrameWish


def frame(number: int = 0, *, text: str = "He", dwell_s: float = 1.0, shape: tuple[int, int] = (6, 6)) -> FrameCheck:
    target = np.full(shape, 0.1)
    target[0, 0] = 1.0
    start = number * dwell_s
    return FrameCheck(
        number, start, start + 0.3, start + dwell_s, "ok", target, FrameWish(target), target.copy(), 0, 20.0, 0.0,
        "⠁⠀⠀\n⠀⠀⠀", "⠁⠀⠀\n⠀⠀⠀", text,
    )  # fmt: skip


def report(*frames: FrameCheck) -> VerifyReport:
    return VerifyReport("hello.wav", "linked-6x6", frames, 8000, 8000, "He", "He", True)


def ink(picture: Image.Image, background: str = PAPER) -> int:
    """How many pixels differ from the background."""
    plain = np.asarray(Image.new("RGB", picture.size, background))
    return int(np.any(np.asarray(picture) != plain, axis=2).sum())


@pytest.mark.parametrize("amplitude", [1.0, 0.5, 0.1])
def test_the_area_of_a_disc_is_the_amplitude(amplitude: float) -> None:
    areas = []
    for each in (0.0, amplitude, 1.0):
        picture = Image.new("RGB", (400, 400), PAPER)
        draw_disc(ImageDraw.Draw(picture), (200, 200), 180, each)
        grey = np.asarray(picture.convert("L"))
        areas.append(int((grey < 180).sum()))
    assert areas[0] == 0
    assert areas[1] / areas[2] == pytest.approx(amplitude, rel=0.02)


def crosses(card: Image.Image) -> np.ndarray:
    pixels = np.asarray(card, dtype=int)
    return (pixels[..., 0] > 150) & (pixels[..., 1] < 80)


def test_a_wrong_dot_is_marked_by_form() -> None:
    shape, right = CardShape(6, 6), frame()
    felt = right.felt.copy()
    felt[0, 0] = 0.1
    wrong = crosses(draw_card(shape, replace(right, felt=felt), 1))
    assert not crosses(draw_card(shape, right, 1)).any()
    rows, cols = np.nonzero(wrong)
    assert wrong.sum() > 20
    assert rows.max() - rows.min() <= shape.pitch
    assert cols.max() - cols.min() <= shape.pitch
    assert cols.min() > shape.panel_x[1]


def test_not_a_number_is_drawn_as_wrong() -> None:
    felt = frame().felt.copy()
    felt[2, 2] = np.nan
    assert draw_card(CardShape(6, 6), replace(frame(), felt=felt), 1).size == CardShape(6, 6).size


def test_letters_the_font_lacks_are_shown_as_cells() -> None:
    assert has_glyphs("Hello, world 123!")
    assert not any(map(has_glyphs, ("Καλημέρα", "नमस्ते", "你好", "é")))
    shape = CardShape(6, 6)
    top = (0, 44, shape.size[0], 80)
    greek = draw_card(shape, frame(text="Καλημέρα"), 1).crop(top)
    drawn = Image.new("RGB", shape.size, PAPER)
    draw_cells(drawn, (20, 46), "⠁⠀⠀\n⠀⠀⠀", 8)
    assert greek.tobytes() == drawn.crop(top).tobytes()


def test_cells_are_drawn_dot_by_dot() -> None:
    inks = []
    for cells in ("⠀", "⠁", "⠿", "⣿"):
        picture = Image.new("RGB", (80, 80), PAPER)
        draw_cells(picture, (0, 0), cells, 16)
        inks.append(int((np.asarray(picture.convert("L")) < 100).sum()))
    assert inks[0] == 0
    assert inks[2] == pytest.approx(6 * inks[1], rel=0.02)
    assert inks[3] == pytest.approx(8 * inks[1], rel=0.02)
    assert cells_width("⠿⠿\n⠿", 5) > cells_width("⠿⠿⠿", 5)


def test_words_are_cut_to_the_room() -> None:
    assert fit("short", font(20), 500) == "short"
    cut = fit("a very long line of words", font(20), 100)
    assert cut.endswith("...")
    assert font(20).getlength(cut) <= 100


def test_files(tmp_path: Path) -> None:
    made = write_preview(report(*(frame(n, dwell_s=0.605) for n in range(4))), tmp_path / "hello.preview")
    assert [Path(name).name for name in made.files] == ["hello.preview.png", "hello.preview.gif", "hello.preview.txt"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(Path(name).name for name in made.files)
    with Image.open(made.files[0]) as picture:
        assert picture.format == "PNG"
        assert ink(picture.convert("RGB"), "#E3E7EC") > 10_000


def test_the_animation_lasts_as_long_as_the_frames(tmp_path: Path) -> None:
    start = tmp_path / "x"
    write_preview(report(*(frame(n, text=f"part {n}", dwell_s=0.605) for n in range(5))), start)
    with Image.open(f"{start}.gif") as animation:
        assert isinstance(animation, GifImageFile)
        lengths = []
        for number in range(animation.n_frames):
            animation.seek(number)
            lengths.append(animation.info["duration"])
        assert animation.info["loop"] == 0
    assert len(lengths) == 5
    assert sum(lengths) == pytest.approx(5 * 605, abs=10)


def test_a_long_file_is_paged_and_says_so(tmp_path: Path) -> None:
    made = write_preview(report(*(frame(n) for n in range(FRAMES_PER_PICTURE + 1))), tmp_path / "long")
    assert [name for name in made.files if name.endswith(".png")] == [
        str(tmp_path / "long.png"),
        str(tmp_path / "long-2.png"),
    ]
    assert any("2 pictures" in note for note in made.notes)


def test_a_large_grid_stays_within_bounds(tmp_path: Path) -> None:
    made = write_preview(report(*(frame(n, shape=(40, 96)) for n in range(2))), tmp_path / "large")
    with Image.open(made.files[0]) as picture:
        assert picture.width * picture.height < 20_000_000


def test_nothing_is_left_when_writing_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", full)
    with pytest.raises((AppError, DriverError), match=r"x\.png"):
        write_preview(report(frame()), tmp_path / "x")
    assert not list(tmp_path.iterdir())


def test_no_frames_and_no_folder_are_bad_input(tmp_path: Path) -> None:
    with pytest.raises(AppError, match="no frames"):
        write_preview(report(), tmp_path / "x")
    (tmp_path / "file").touch()
    with pytest.raises((AppError, DriverError), match="file is not a folder"):
        write_preview(report(frame()), tmp_path / "file" / "x")


def test_the_text_says_what_the_picture_shows() -> None:
    lines = list(spoken(report(frame(0), frame(1))))
    said = "\n".join(lines)
    assert "Frame 2 of 2, page 2." in said
    assert "Time: 1.00 to 2.00 s, settled at 1.30 s." in said
    assert "Cells wanted: ⠁⠀⠀ / ⠀⠀⠀" in said
    assert "o . . . . .\n. . . . . ." in said
    assert "0.0 -20.0 -20.0 -20.0 -20.0 -20.0" in said
    assert "Levels where a dot should be flat: -20.0 to -20.0 dB." in said


def test_the_text_shows_wrong_dots_and_silence() -> None:
    right = frame()
    felt = np.zeros_like(right.felt)
    felt[5, 5] = 1.0
    said = "\n".join(spoken(report(replace(right, felt=felt, wrong_dots=2, felt_cells="⠀⠀⠀\n⠀⠀⠠"))))
    assert "Dots felt, 2 wrong:" in said
    assert ". . . . . o" in said
    assert "Cells felt: ⠀⠀⠀ / ⠀⠀⠠" in said
    assert "silent" in said


def test_the_text_is_made_for_listening() -> None:
    """No box drawing, no escape codes, no block characters: Braille and plain letters only."""
    said = "\n".join(spoken(report(frame(text="déjà vu"))))
    assert not re.search(r"[\u2500-\u25ff\x1b\t]", said)


def test_the_files_of_a_preview_are_all_old_or_all_new(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_preview(report(frame()), tmp_path / "x")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("dotwave.figures.preview._spell", full)
        with pytest.raises(DriverError, match=r"x\.txt: the disk is full"):
            write_preview(report(frame(text="other")), tmp_path / "x")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    write_preview(report(frame(text="other")), tmp_path / "x")
    after = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert after.keys() == before.keys()
    assert all(after[name] != before[name] for name in before)
