"""Reading pictures: files of seven kinds to linear light, within limits."""

from __future__ import annotations

import gzip
import io
import os
import warnings
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..reading import first_bytes
from .errors import PictureBroken, PictureError, PictureTooLarge
from .limits import BROKEN, PictureLimits
from .vector import draw_svg

if TYPE_CHECKING:
    from PIL.Image import Image

__all__ = ["Picture", "Raster", "read_picture"]

Floats = NDArray[np.float32]

FORMATS = ("PNG", "JPEG", "GIF", "WEBP", "BMP", "TIFF")
READ = "give PNG, JPEG, GIF, WebP, BMP, TIFF, SVG or SVGZ"
STRIP_PIXELS = 1 << 20
KEPT_PIXELS = 12_000_000


@dataclass(frozen=True)
class Raster:
    """One frame of a picture.

    Attributes
    ----------
    light : float32, shape (height, width, 4), read-only: red, green and blue in linear light times alpha, and
        alpha, all 0..1.
    seconds : how long the file shows it; 0 when it does not say.
    """

    light: Floats
    seconds: float = 0.0


@dataclass(frozen=True)
class Picture:
    """A picture that was read.

    Attributes
    ----------
    name : how it is called in messages.
    kind : its format.
    size : (height, width) in the file.
    frames : one, or those of an animation.
    notes : what was left out while reading, one clause each.
    """

    name: str
    kind: str
    size: tuple[int, int]
    frames: tuple[Raster, ...]
    notes: tuple[str, ...] = ()


def read_picture(
    source: str | os.PathLike[str] | bytes | Image, longest_px: int, limits: PictureLimits | None = None
) -> Picture:
    """Read a picture, upright and in linear light.

    Parameters
    ----------
    source : path, bytes of a file, or Pillow image.
    longest_px : SVG is drawn so that its longer side has as many pixels; larger pictures are averaged (in
        linear light) by the greatest whole factor that leaves at least as many.
    limits : how much is read; None means the defaults of `PictureLimits`.

    Raises
    ------
    PictureError
        When the file cannot be read or is of another kind (`PictureBroken`: malformed; `PictureTooLarge`: over
        a limit; `RendererMissing`: resvg-py, which draws SVG, is not installed).
    """
    limits = limits or PictureLimits()
    if not isinstance(source, str | os.PathLike | bytes):
        return _from_image(source, "picture", longest_px, limits)
    if isinstance(source, bytes):
        name, data = "picture", source
    else:
        name, data = str(source), _file_bytes(Path(source), limits)
    if len(data) > limits.file_bytes:
        raise PictureTooLarge(f"{name}: {len(data)} bytes; at most {limits.file_bytes} are read")
    if data.startswith(b"\x1f\x8b"):
        data = _unpacked(name, data, limits)
    if _looks_like_svg(data):
        return _from_svg(name, data, longest_px, limits)
    return _from_bytes(name, data, longest_px, limits)


def _file_bytes(path: Path, limits: PictureLimits) -> bytes:
    try:
        return first_bytes(path, limits.file_bytes + 1)
    except (OSError, ValueError) as error:
        raise PictureError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None


def _unpacked(name: str, data: bytes, limits: PictureLimits) -> bytes:
    try:
        with gzip.open(io.BytesIO(data)) as file:
            plain = file.read(limits.svg_bytes + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise PictureBroken(f"{name}: broken SVGZ: {error}; save it again") from None
    if len(plain) > limits.svg_bytes:
        raise PictureTooLarge(f"{name}: unpacks to more than {limits.svg_bytes} bytes; simplify the drawing")
    return plain


def _looks_like_svg(data: bytes) -> bool:
    start = data[:4096].removeprefix(b"\xef\xbb\xbf").lstrip()
    if start.startswith((b"\xff\xfe<\0", b"\xfe\xff\0<")):
        return True
    return start.startswith((b"<?xml", b"<svg", b"<!--", b"<!DOCTYPE svg")) or (start[:1] == b"<" and b"<svg" in start)


def _from_svg(name: str, data: bytes, longest_px: int, limits: PictureLimits) -> Picture:
    if len(data) > limits.svg_bytes:
        raise PictureTooLarge(f"{name}: {len(data)} bytes of SVG; at most {limits.svg_bytes} are read")
    drawing = draw_svg(name, data, longest_px, limits)
    raster = Raster(_frozen(_reduced(drawing.image, longest_px)))
    height, width = raster.light.shape[:2]
    return Picture(name, "SVG", (height, width), (raster,), drawing.notes)


def _from_bytes(name: str, data: bytes, longest_px: int, limits: PictureLimits) -> Picture:
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image = Image.open(io.BytesIO(data), formats=FORMATS)
    except UnidentifiedImageError:
        raise PictureError(f"{name}: not a picture of a known kind, or its start is damaged; {READ}") from None
    except Image.DecompressionBombError:
        raise PictureTooLarge(f"{name}: more pixels than the {limits.pixels} that are read; scale it down") from None
    except BROKEN as error:
        raise PictureBroken(f"{name}: broken picture: {_clause(error)}; save it again") from None
    with image:
        return _from_image(image, name, longest_px, limits)


def _from_image(image: Image, name: str, longest_px: int, limits: PictureLimits) -> Picture:
    from PIL import Image

    kind, size = image.format or "image", (image.height, image.width)
    # Photographs are JPEG. Elsewhere so many pixels are a mistake or a bomb, and take four times the memory.
    most = limits.pixels if kind in {"JPEG", "MPO"} else limits.pixels * 3 // 10
    if size[0] * size[1] > most or not all(size):
        raise PictureTooLarge(f"{name}: {size[1]} x {size[0]} pixels; from 1 to {most} are read, scale the picture")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            notes: dict[str, None] = {}
            frames = tuple(_frames(image, longest_px, limits, notes))
    except Image.DecompressionBombError:
        raise PictureTooLarge(f"{name}: more pixels than the {limits.pixels} that are read; scale it down") from None
    except MemoryError:
        raise PictureTooLarge(f"{name}: not enough memory to read it; scale the picture down") from None
    except PictureTooLarge as error:
        raise PictureTooLarge(f"{name}: {error}") from None
    except BROKEN as error:
        raise PictureBroken(f"{name}: broken {kind}: {_clause(error)}; save it again") from None
    return Picture(name, kind, size, frames, tuple(notes))


def _frames(image: Image, longest_px: int, limits: PictureLimits, notes: dict[str, None]) -> Iterator[Raster]:
    """Every frame of an animation, the first page of anything else."""
    animated = image.format in {"GIF", "WEBP", "PNG"} and getattr(image, "is_animated", False)
    count = int(getattr(image, "n_frames", 1)) if animated else 1
    if count > limits.frames:
        raise PictureTooLarge(f"{count} frames; at most {limits.frames} are read, cut the animation")
    kept = count * (image.width * image.height) // max(1, max(image.size) // longest_px) ** 2
    if count > 1 and kept > KEPT_PIXELS:
        raise PictureTooLarge(
            f"{count} frames of {image.width} x {image.height} pixels are too many; cut the animation"
        )
    if not animated and getattr(image, "n_frames", 1) > 1:
        notes["only the first page of several is shown"] = None
    total = 0
    for index in range(count):
        if animated:
            image.seek(index)
            # A frame may reach beyond the size that the file begins with, and is then as large as it says.
            total += image.width * image.height
            if total > limits.pixels * 3 // 10:
                raise PictureTooLarge(f"its {count} frames have too many pixels; cut or scale the animation")
        seconds = float(image.info.get("duration") or 0) / 1000 if animated else 0.0
        yield Raster(_frozen(_reduced(_upright_srgb(image, notes), longest_px)), seconds)


def _upright_srgb(image: Image, notes: dict[str, None]) -> Image:
    """A copy turned as EXIF says, with its colour profile converted to sRGB; mode RGB, RGBA, L, LA or 16-bit grey."""
    from PIL import ImageOps

    image.load()
    profile = image.info.get("icc_profile")
    transparency = image.info.get("transparency")
    try:
        image = ImageOps.exif_transpose(image)
    except BROKEN:
        notes["its EXIF data cannot be read, so it is not turned"] = None
    if image.mode.startswith(("I", "F")):
        return image
    if image.mode == "P" or (image.mode in {"1", "L", "RGB"} and transparency is not None):
        image = image.convert("RGBA")
    elif image.mode in {"PA", "La", "RGBa"}:
        image = image.convert("RGBA" if image.mode != "La" else "LA")
    elif image.mode == "1":
        image = image.convert("L")
    if profile and image.mode in {"RGB", "RGBA", "L", "CMYK", "LAB"}:
        image = _to_srgb(image, profile, notes)
    if image.mode not in {"RGB", "RGBA", "L", "LA"}:
        image = image.convert("RGB")
    return image


def _to_srgb(image: Image, profile: bytes, notes: dict[str, None]) -> Image:
    from PIL import ImageCms

    try:
        given = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        alpha = image.getchannel("A") if image.mode == "RGBA" else None
        plain = image.convert("RGB") if alpha is not None else image
        converted = ImageCms.profileToProfile(plain, given, ImageCms.createProfile("sRGB"), outputMode="RGB")
    except (ImageCms.PyCMSError, OSError, ValueError):
        notes["its colour profile cannot be used and is ignored"] = None
        return image
    assert converted is not None
    if alpha is not None:
        converted.putalpha(alpha)
    return converted


def _reduced(image: Image, longest_px: int) -> Floats:
    """Linear premultiplied light of a picture, averaged by the greatest whole factor that leaves `longest_px`."""
    factor = max(1, max(image.size) // longest_px)
    if image.mode.startswith(("I", "F")):
        return _means(_deep_light(image), factor)
    width, height = image.size
    rows = max(factor, STRIP_PIXELS // width // factor * factor)
    strips = [
        _means(_light(np.asarray(image.crop((0, top, width, min(top + rows, height))))), factor)
        for top in range(0, height, rows)
    ]
    return strips[0] if len(strips) == 1 else np.concatenate(strips)


def _light(pixels: NDArray[np.uint8]) -> Floats:
    table = _linear_table()
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    channels = pixels.shape[2]
    light = np.empty((*pixels.shape[:2], 4), np.float32)
    light[..., :3] = table[pixels[..., :3] if channels >= 3 else pixels[..., :1]]
    light[..., 3] = 1.0
    if channels in {2, 4}:
        light[..., 3] = pixels[..., -1] * np.float32(1 / 255)
        light[..., :3] *= light[..., 3:]
    return light


def _deep_light(image: Image) -> Floats:
    """16-bit and 32-bit whole numbers count to 65535 (or 255 when none is above); real ones to 1 or their maximum."""
    values = np.nan_to_num(np.asarray(image).astype(np.float32), nan=0.0, posinf=0.0, neginf=0.0)
    top = max(1.0, float(values.max(initial=0.0)))
    if image.mode.startswith("I"):
        top = 65535.0 if image.mode != "I" or 255 < top <= 65535 else max(top, 255.0)
    coded = np.clip(values / np.float32(top), 0, 1)
    light = np.ones((*coded.shape, 4), np.float32)
    light[..., :3] = linear(coded)[..., None]
    return light


def _means(light: Floats, factor: int) -> Floats:
    if factor == 1:
        return light
    rows, columns = (np.arange(0, size, factor) for size in light.shape[:2])
    sums = np.add.reduceat(np.add.reduceat(light, rows, axis=0), columns, axis=1)
    counts = [np.diff(np.append(starts, size)) for starts, size in zip((rows, columns), light.shape[:2], strict=True)]
    means: Floats = (sums / np.outer(*counts)[..., None]).astype(np.float32)
    return means


def linear(coded: NDArray[Any]) -> Floats:
    """Linear light of sRGB values 0..1; float32, same shape (IEC 61966-2-1)."""
    coded = np.asarray(coded, np.float32)
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4).astype(np.float32)


@cache
def _linear_table() -> Floats:
    return linear(np.arange(256) / 255)


def _frozen(light: Floats) -> Floats:
    light.flags.writeable = False
    return light


def _clause(error: BaseException) -> str:
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 120 else text[:117] + "..."
