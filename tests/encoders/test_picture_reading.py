"""Reading pictures: every kind and mode to the same linear light, and refusals in one line."""

from __future__ import annotations

import gzip
import io
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms

from encoders.picture.errors import EmptyPicture, PictureBroken, PictureError, PictureTooLarge
from encoders.picture.limits import PictureLimits
from encoders.picture.reading import linear, read_picture

RED_LEFT = np.zeros((8, 12, 3), np.uint8)
RED_LEFT[:, :6] = (200, 30, 10)
RED_LEFT[:, 6:] = (20, 60, 240)


def saved(image: Image.Image, kind: str, **options: object) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return buffer.getvalue()


def light_of(data: bytes | Image.Image) -> np.ndarray:
    return read_picture(data, 100).frames[0].light


@pytest.mark.parametrize(
    ("kind", "options", "off"),
    [
        ("PNG", {}, 0), ("BMP", {}, 0), ("TIFF", {}, 0), ("WEBP", {"lossless": True}, 0),
        ("GIF", {}, 0), ("JPEG", {"quality": 98, "subsampling": 0}, 0.04),
    ],
)  # fmt: skip
def test_every_kind_gives_the_same_light(kind: str, options: dict[str, object], off: float) -> None:
    picture = read_picture(saved(Image.fromarray(RED_LEFT), kind, **options), 100)
    assert (picture.kind, picture.size) == (kind, (8, 12))
    light = picture.frames[0].light
    assert light.dtype == np.float32
    assert not light.flags.writeable
    np.testing.assert_allclose(light[..., :3], linear(RED_LEFT / 255), atol=off + 1e-6)
    assert (light[..., 3] == 1).all()


def test_linear_light_is_the_standard_curve() -> None:
    np.testing.assert_allclose(linear(np.array([0.0, 0.04045, 0.5, 1.0])), [0, 0.0031308, 0.2140411, 1], atol=1e-6)


def test_means_are_taken_in_linear_light() -> None:
    board = np.indices((64, 64)).sum(axis=0) % 2 * 255
    light = read_picture(Image.fromarray(board.astype(np.uint8)), 8).frames[0].light
    assert light.shape == (8, 8, 4)
    np.testing.assert_allclose(light[..., :3], 0.5, atol=1e-6)


def test_means_of_a_size_that_no_factor_divides() -> None:
    values = np.random.default_rng(1).integers(0, 256, (37, 53), np.uint8)
    light = read_picture(Image.fromarray(values), 10).frames[0].light
    full = linear(values / 255)
    assert light.shape == (8, 11, 4)
    assert light[0, 0, 0] == pytest.approx(full[:5, :5].mean(), abs=1e-6)
    assert light[-1, -1, 0] == pytest.approx(full[35:, 50:].mean(), abs=1e-6)


@pytest.mark.parametrize("mode", ["RGBA", "LA", "P"])
def test_alpha_is_kept_and_multiplied_in(mode: str) -> None:
    rgba = np.full((4, 4, 4), 255, np.uint8)
    rgba[:2, :, 3] = 0
    image = Image.fromarray(rgba)
    if mode == "LA":
        image = image.convert("LA")
    data = saved(image.quantize(4) if mode == "P" else image, "PNG")
    light = light_of(data)
    np.testing.assert_allclose(light[:2], 0, atol=1e-6)
    np.testing.assert_allclose(light[2:], 1, atol=1e-2)


def test_transparent_colour_of_a_grey_png() -> None:
    image = Image.fromarray(np.repeat(np.array([[0, 255]], np.uint8), 4, axis=0))
    light = light_of(saved(image, "PNG", transparency=255))
    assert light[0, 0, 3] == 1
    assert light[0, 1, 3] == 0


def test_one_bit() -> None:
    bits = np.eye(8, dtype=bool)
    np.testing.assert_array_equal(light_of(saved(Image.fromarray(bits), "PNG"))[..., 0], bits)


@pytest.mark.parametrize("kind", ["PNG", "TIFF"])
def test_sixteen_bits(kind: str) -> None:
    values = np.linspace(0, 65535, 64).astype(np.uint16).reshape(8, 8)
    light = light_of(saved(Image.fromarray(values), kind))
    np.testing.assert_allclose(light[..., 1], linear(values / 65535), atol=1e-6)


def test_cmyk() -> None:
    cmyk = np.zeros((4, 4, 4), np.uint8)
    cmyk[:2, :, 3] = 255
    light = light_of(saved(Image.fromarray(cmyk, "CMYK"), "JPEG", quality=98))
    assert light[:2, :, :3].max() < 0.02
    assert light[2:, :, :3].min() > 0.9


@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientation(orientation: int) -> None:
    upright = Image.fromarray(RED_LEFT)
    stored = {
        1: None, 2: Image.Transpose.FLIP_LEFT_RIGHT, 3: Image.Transpose.ROTATE_180, 4: Image.Transpose.FLIP_TOP_BOTTOM,
        5: Image.Transpose.TRANSPOSE, 6: Image.Transpose.ROTATE_90, 7: Image.Transpose.TRANSVERSE,
        8: Image.Transpose.ROTATE_270,
    }[orientation]  # fmt: skip
    image = upright if stored is None else upright.transpose(stored)
    exif = Image.Exif()
    exif[0x0112] = orientation
    np.testing.assert_allclose(
        light_of(saved(image, "PNG", exif=exif.tobytes()))[..., :3], linear(RED_LEFT / 255), atol=1e-6
    )


def test_an_srgb_profile_changes_nothing() -> None:
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    light = light_of(saved(Image.fromarray(RED_LEFT), "PNG", icc_profile=srgb))
    np.testing.assert_allclose(light[..., :3], linear(RED_LEFT / 255), atol=0.01)


def test_a_profile_of_other_numbers_is_converted() -> None:
    lab = ImageCms.createProfile("LAB")
    to_lab = ImageCms.profileToProfile(Image.fromarray(RED_LEFT), ImageCms.createProfile("sRGB"), lab, outputMode="LAB")
    assert to_lab is not None
    data = saved(to_lab, "TIFF", icc_profile=ImageCms.ImageCmsProfile(lab).tobytes())
    np.testing.assert_allclose(light_of(data)[..., :3], linear(RED_LEFT / 255), atol=0.02)


def test_a_broken_profile_is_noted() -> None:
    picture = read_picture(saved(Image.fromarray(RED_LEFT), "PNG", icc_profile=b"nonsense"), 100)
    assert picture.notes == ("its colour profile cannot be used and is ignored",)
    np.testing.assert_allclose(picture.frames[0].light[..., :3], linear(RED_LEFT / 255), atol=1e-6)


def test_animation() -> None:
    pictures = [Image.fromarray(np.full((8, 8), level, np.uint8)) for level in (0, 128, 255)]
    data = saved(pictures[0], "GIF", save_all=True, append_images=pictures[1:], duration=[100, 200, 300])
    frames = read_picture(data, 100).frames
    assert [frame.seconds for frame in frames] == [0.1, 0.2, 0.3]
    np.testing.assert_allclose(
        [float(f.light[4, 4, 0]) for f in frames], linear(np.array([0, 128, 255]) / 255), atol=0.02
    )
    with pytest.raises(PictureTooLarge, match="3 frames; at most 2"):
        read_picture(data, 100, PictureLimits(frames=2))


def test_paths_and_their_errors(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(saved(Image.fromarray(RED_LEFT), "PNG"))
    assert read_picture(path, 100).name == read_picture(str(path), 100).name == str(path)
    with pytest.raises(PictureError, match=r"none\.png: cannot be read: No such file"):
        read_picture(tmp_path / "none.png", 100)
    with pytest.raises(PictureError, match="cannot be read: Is a directory"):
        read_picture(tmp_path, 100)


@pytest.mark.parametrize("data", [b"", b"hello", b"%PDF-1.4", b"\0" * 100, b"<html></html>", b"\x89PNG\r\n\x1a\n"])
def test_other_kinds_are_refused(data: bytes) -> None:
    with pytest.raises(PictureError) as caught:
        read_picture(data, 100)
    assert "\n" not in str(caught.value)


def test_a_cut_file_is_refused() -> None:
    noise = np.random.default_rng(1).integers(0, 256, (50, 50, 3), np.uint8)
    for kind in ("PNG", "JPEG", "GIF", "WEBP", "BMP", "TIFF"):
        data = saved(Image.fromarray(noise), kind)
        with pytest.raises(PictureError, match="picture: "):
            read_picture(data[: len(data) // 2], 100)


def test_a_decompression_bomb_is_refused_by_its_header() -> None:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return len(body).to_bytes(4, "big") + kind + body + zlib.crc32(kind + body).to_bytes(4, "big")

    for side in (7000, 12000, 60000):
        header = side.to_bytes(4, "big") * 2 + b"\x08\x00\x00\x00\x00"
        body = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")
        with pytest.raises(PictureTooLarge, match="pixels"):
            read_picture(b"\x89PNG\r\n\x1a\n" + body, 100)
    with pytest.raises(PictureTooLarge, match="unpacks to more than"):
        read_picture(gzip.compress(b"<svg>" + bytes(5_000_000)), 100)
    with pytest.raises(PictureTooLarge, match="bytes; at most 10"):
        read_picture(b"x" * 11, 100, PictureLimits(file_bytes=10))


def test_a_broken_svgz_is_refused() -> None:
    with pytest.raises(PictureBroken, match="broken SVGZ"):
        read_picture(gzip.compress(b"<svg/>")[:12], 100)


def test_the_errors_are_value_errors_of_the_encoders() -> None:
    from encoders import EncodeError

    for error in (PictureError, PictureBroken, PictureTooLarge, EmptyPicture):
        assert issubclass(error, EncodeError)
        assert issubclass(error, ValueError)


def test_importing_pictures_imports_no_library() -> None:
    code = "import sys, encoders.picture.pictures; print(sorted({'PIL', 'resvg_py', 'scipy'} & set(sys.modules)))"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"
