"""Pictures to scenes: frames, levels, textures, parts of big pictures, and what the report says."""

from __future__ import annotations

import gzip
import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw

from encoders.picture.errors import EmptyPicture, PictureError
from encoders.picture.options import Fit, Invert, Output, PictureOptions, RegionsBy, Style
from encoders.picture.pictures import PictureScene, encode_picture, explain_picture
from encoders.scene import GridShape, PatternKind, Scene

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
HEART = SAMPLES / "icons" / "heart.svg"
SIX = GridShape(6, 6)


def drawn(scene: PictureScene, frame: int = 0) -> list[str]:
    rows = np.abs(scene.frames[frame].pattern.amplitude) > 0
    return ["".join(".#"[int(dot)] for dot in row) for row in rows]


def bars(*columns: int, background: str = "white", ink: str = "black") -> Image.Image:
    """Bars ten pixels wide in an area of 60 x 60, with 10 pixels of ground around it."""
    image = Image.new("RGB", (80, 80), background)
    for column in columns:
        ImageDraw.Draw(image).rectangle((column * 10 + 10, 10, column * 10 + 19, 69), fill=ink)
    return image


def test_a_scene_of_one_frame() -> None:
    scene = encode_picture(HEART, SIX, PictureOptions(dwell_s=2.5))
    assert isinstance(scene, Scene)
    assert scene.shape == SIX
    (frame,) = scene.frames
    assert (frame.dwell_s, frame.page, frame.cells, frame.text) == (2.5, 0, "", "")
    pattern = frame.pattern
    assert (pattern.kind, pattern.phase_matters, pattern.weight) == (PatternKind.ON_OFF, False, None)
    assert pattern.amplitude.dtype == np.complex128
    assert not pattern.amplitude.flags.writeable
    assert set(pattern.amplitude.ravel()) == {0, 1}
    assert scene.report.similarity == scene.report.frames[0].candidates[0].similarity
    assert json.loads(json.dumps(dict(scene.encoding)))["picture"] == "heart.svg"


def test_what_a_finger_should_find() -> None:
    assert drawn(encode_picture(HEART, SIX)) == [".#..#.", "######", "######", ".####.", "..##..", "......"]
    pause = [".#..#."] * 6
    assert drawn(encode_picture(SAMPLES / "icons" / "pause.svg", SIX)) == pause
    assert drawn(encode_picture(bars(0, 1, 4, 5), SIX)) == ["##..##"] * 6


@pytest.mark.parametrize("kind", ["PNG", "GIF", "BMP", "TIFF", "WEBP"])
def test_every_kind_of_file_gives_the_same_pattern(kind: str) -> None:
    buffer = io.BytesIO()
    bars(0, 1, 4, 5).save(buffer, kind, **({"lossless": True} if kind == "WEBP" else {}))
    assert drawn(encode_picture(buffer.getvalue(), SIX)) == ["##..##"] * 6


def test_svg_and_svgz_and_bytes_are_one() -> None:
    data = HEART.read_bytes()
    assert drawn(encode_picture(data, SIX)) == drawn(encode_picture(gzip.compress(data), SIX))
    assert encode_picture(data, SIX).report.kind == "SVG"


def test_white_on_black_black_on_white_and_white_on_nothing_are_one() -> None:
    clear = bars(1, 2).convert("L").point([255, *[0] * 255])
    white = Image.new("LA", (80, 80), (255, 0))
    white.putalpha(clear)
    pictures = bars(1, 2), bars(1, 2, background="black", ink="white"), white
    first, *others = [drawn(encode_picture(picture, SIX)) for picture in pictures]
    assert [first, first] == others
    turned = PictureOptions(invert=Invert.NO, crop=False, style=Style.ICON)
    assert drawn(encode_picture(bars(1, 2).crop((10, 10, 70, 70)), SIX, turned)) == ["#..###"] * 6


def test_a_flat_picture_is_refused_but_a_blank_frame_is_not() -> None:
    flat = Image.new("RGB", (20, 20), "gray")
    for picture in (flat, Image.new("RGBA", (20, 20), (0, 0, 0, 0)), Image.new("L", (1, 1))):
        with pytest.raises(EmptyPicture, match="nothing to feel"):
            encode_picture(picture, SIX)
    buffer = io.BytesIO()
    Image.new("L", (80, 80), 255).save(
        buffer, "GIF", save_all=True, append_images=[bars(0, 1).convert("L")], duration=[50, 900]
    )
    scene = encode_picture(buffer.getvalue(), SIX, PictureOptions(style=Style.ICON, crop=False))
    assert [frame.dwell_s for frame in scene.frames] == [0.6, 0.9]
    assert [frame.page for frame in scene.frames] == [0, 1]
    assert drawn(scene, 0) == ["......"] * 6
    assert drawn(scene, 1)[2].startswith(".#") or drawn(scene, 1)[2].startswith("##")


def test_crop_and_fit() -> None:
    image = Image.new("L", (120, 120), 255)
    image.paste(bars(0, 1, 4, 5).convert("L"), (50, 30))
    assert drawn(encode_picture(image, SIX)) == ["##..##"] * 6
    assert drawn(encode_picture(image, SIX, PictureOptions(crop=False, style=Style.ICON))) != ["##..##"] * 6
    wide = bars(0, 1, 4, 5).resize((480, 80))
    with pytest.raises(EmptyPicture):
        encode_picture(wide, SIX, PictureOptions(fit=Fit.COVER, style=Style.ICON, crop=False))
    middle = bars(3).resize((320, 80))
    assert (
        drawn(encode_picture(middle, SIX, PictureOptions(fit=Fit.COVER, style=Style.ICON, crop=False)))[3][2:5] == ".##"
    )
    assert drawn(encode_picture(wide, SIX, PictureOptions(fit=Fit.STRETCH))) == ["##..##"] * 6
    assert drawn(encode_picture(wide, SIX, PictureOptions(fit=Fit.CONTAIN, style=Style.ICON)))[0] == "......"


def test_a_tile_is_dropped_only_where_it_hides_its_sign() -> None:
    """A plus cut out of a tile: wide arms are shown in the tile, thin ones by themselves."""
    found = []
    for width in (16, 2):
        tile = Image.new("L", (96, 96), 255)
        ImageDraw.Draw(tile).rectangle((6, 6, 89, 89), fill=0)
        for box in ((48 - width / 2, 24, 47 + width / 2, 71), (24, 48 - width / 2, 71, 47 + width / 2)):
            ImageDraw.Draw(tile).rectangle(box, fill=255)
        found.append(drawn(encode_picture(tile, SIX)))
    assert found[0][0] == "######"
    assert "##..##" in found[0]
    assert found[1][0] == "..##.."
    assert found[1][2] == "######"


def test_the_true_pitch_is_used() -> None:
    square = Image.new("L", (100, 100), 255)
    ImageDraw.Draw(square).rectangle((20, 20, 79, 79), outline=0, width=12)
    tall = drawn(encode_picture(square, GridShape(12, 6), PictureOptions(pitch_m=(4e-3, 8e-3))))
    assert all("#" in row for row in tall)
    even = drawn(encode_picture(square, GridShape(12, 6), PictureOptions(pitch_m=(8e-3, 8e-3))))
    assert sum("#" in row for row in even) <= 7


def test_levels_are_three_decibels_apart_or_more() -> None:
    slope = Image.fromarray(np.broadcast_to(np.linspace(0, 255, 60).astype(np.uint8), (60, 60)))
    options = PictureOptions(output=Output.LEVELS, levels=3, level_step_db=6, style=Style.PHOTO, contrast=False)
    scene = encode_picture(slope, SIX, options)
    amplitude = np.abs(scene.frames[0].pattern.amplitude)
    levels = 10 ** (-6 / 20 * np.arange(3))
    assert np.isclose(amplitude[..., None], np.append(levels, 0)).any(axis=-1).all()
    assert len(np.unique(amplitude)) == 4
    steps = np.diff(amplitude, axis=1)
    assert (steps >= 0).all() or (steps <= 0).all()
    assert (
        scene.report.similarity > encode_picture(slope, SIX, PictureOptions(style=Style.PHOTO)).report.similarity - 0.2
    )


def test_texture_gives_each_field_its_own() -> None:
    scene = encode_picture(SAMPLES / "textures" / "fields.png", SIX, PictureOptions(output=Output.TEXTURE))
    pattern, report = scene.frames[0].pattern, scene.report.frames[0]
    assert pattern.phase_matters
    assert pattern.kind is PatternKind.SINE
    textures = [region.texture for region in report.regions if region.texture]
    assert len(textures) == 3 == len(set(textures))
    assert sum(region.dots for region in report.regions) == 36
    assert np.abs(pattern.amplitude).max() <= 1
    grey = PictureOptions(output=Output.TEXTURE, regions=1, regions_by=RegionsBy.LUMINANCE)
    assert len(encode_picture(SAMPLES / "textures" / "fields.png", SIX, grey).report.frames[0].regions) == 1


def test_a_big_picture_is_an_overview_and_its_parts() -> None:
    image = Image.new("L", (240, 240), 255)
    for place, columns in (((0, 0), (0, 1)), ((120, 0), (2, 3)), ((0, 120), (4, 5)), ((120, 120), (0, 5))):
        image.paste(bars(*columns).convert("L").crop((10, 10, 70, 70)).resize((120, 120)), place)
    scene = encode_picture(image, SIX, PictureOptions(zoom=2, overlap=0, style=Style.ICON, crop=False))
    names = ["overview", *(f"row {i} of 2, column {j} of 2" for i in (1, 2) for j in (1, 2))]
    assert [report.view for report in scene.report.frames] == names
    assert [drawn(scene, k)[2] for k in range(1, 5)] == ["##....", "..##..", "....##", "#....#"]
    assert [frame.page for frame in scene.frames] == list(range(5))


def test_gap_and_stroke_on_a_fine_grid() -> None:
    image = Image.new("L", (240, 240), 255)
    ImageDraw.Draw(image).rectangle((20, 20, 115, 219), fill=0)
    ImageDraw.Draw(image).rectangle((124, 20, 219, 219), fill=0)
    fine = PictureOptions(pitch_m=(2e-3, 2e-3), style=Style.ICON, gap_m=6e-3)
    row = drawn(encode_picture(image, GridShape(16, 16), fine))[8]
    assert "##..." in row
    assert "...##" in row
    assert "..." not in drawn(encode_picture(image, GridShape(16, 16), PictureOptions(style=Style.ICON)))[8]
    line = Image.new("L", (240, 240), 255)
    ImageDraw.Draw(line).rectangle((20, 20, 219, 27), fill=0)
    ImageDraw.Draw(line).rectangle((20, 20, 27, 219), fill=0)
    thick = PictureOptions(pitch_m=(2e-3, 2e-3), style=Style.ICON, stroke_m=6e-3)
    assert drawn(encode_picture(line, GridShape(16, 16), thick))[12].startswith("##")


def test_explain_shows_each_step_as_a_picture() -> None:
    steps = explain_picture(SAMPLES / "photos" / "ball.jpg", SIX)
    assert (
        tuple(step.name for step in steps)
        == encode_picture(SAMPLES / "photos" / "ball.jpg", SIX).report.frames[0].steps
    )
    assert [step.name for step in steps] == [
        "composite", "luminance", "local contrast", "threshold (otsu)", "invert", "fit (contain)", "on/off",
    ]  # fmt: skip
    for step in steps:
        assert step.image.dtype == np.float32
        assert step.image.min() >= 0
        assert step.image.max() <= 1 + 1e-6
        pixels = step.pixels()
        assert pixels.dtype == np.uint8
        assert Image.fromarray(pixels).size == step.image.shape[1::-1]


def test_the_same_picture_gives_the_same_scene() -> None:
    path = SAMPLES / "photos" / "lighthouse.jpg"
    options = PictureOptions(output=Output.TEXTURE, candidates=20)
    first, second = (encode_picture(path, SIX, options) for _ in range(2))
    assert first.frames[0].pattern.amplitude.tobytes() == second.frames[0].pattern.amplitude.tobytes()
    assert [c.dots.tobytes() for c in first.report.frames[0].candidates] == [
        c.dots.tobytes() for c in second.report.frames[0].candidates
    ]


@pytest.mark.parametrize("size", [(1, 40), (40, 1), (1, 2000), (3000, 2), (2, 2)])
def test_odd_sizes(size: tuple[int, int]) -> None:
    values = np.zeros(size[::-1], np.uint8)
    values[: max(1, size[1] // 2), : max(1, size[0] // 2)] = 255
    try:
        scene = encode_picture(Image.fromarray(values), SIX)
    except PictureError as error:
        pytest.fail(str(error))
    assert np.isfinite(scene.report.similarity)


def test_samples_are_small_and_written_by_their_script(tmp_path: Path) -> None:
    files = [*(SAMPLES / "textures").iterdir(), *(SAMPLES / "photos").iterdir()]
    assert len(files) == 5
    assert all(file.stat().st_size < 100_000 for file in files)


def test_a_photograph_is_shown_whole_and_what_is_cut_is_said() -> None:
    wide = GridShape(10, 24)
    path = SAMPLES / "photos" / "lighthouse.jpg"
    whole, cut = (encode_picture(path, wide, PictureOptions(fit=fit)).report for fit in (None, Fit.COVER))
    height, width = whole.size
    window = cut.frames[0].candidates[0].window
    share = (window.bottom - window.top) * (window.right - window.left) / (height * width)
    assert whole.notes == ()
    (note,) = cut.notes
    assert note.startswith(f"cover cuts {round(100 * (1 - share))} % of the picture away")


def test_a_texture_has_a_legend_in_words() -> None:
    scene = encode_picture(SAMPLES / "textures" / "fields.png", SIX, PictureOptions(output=Output.TEXTURE))
    report = scene.report.frames[0]
    assert len(report.legend) == len(report.regions)
    assert any(line.endswith(": all together") for line in report.legend)
    assert sum(int(line.split(" ")[0]) for line in report.legend) == pytest.approx(100, abs=2)
    assert encode_picture(HEART, SIX).report.frames[0].legend == ()
