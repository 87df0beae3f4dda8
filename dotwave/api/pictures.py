"""What should be felt: pictures and icons as scenes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

from encoders import PictureOptions, Scene, Style

from ..errors import AppError
from ..pictures import picture_scene, pitched
from ..scenes import joined, shape_of
from .scenes import USUAL_DEVICE, AnyDevice, device as _device

__all__ = ["icons", "image"]

Picture = str | PathLike[str] | bytes


def image(
    files: Picture | Iterable[Picture],
    device: AnyDevice = USUAL_DEVICE,
    options: PictureOptions | None = None,
    **changes: Any,
) -> Scene:
    """Pictures, one after another.

    Parameters
    ----------
    files : path or bytes, or several
        PNG, JPEG, GIF, WebP, BMP, TIFF or SVG.
    device : Device, name, file or mapping
        Whose grid and pitch the pictures are made for.
    options : encoders.PictureOptions, optional
        Style, fit, threshold and so on; the pitch is the device's.
    **changes
        Single options by their names in `encoders.PictureOptions`, such as ``style="photo"``.

    Returns
    -------
    encoders.Scene
        With a line on each picture in `parts`.

    Raises
    ------
    encoders.EncodeError
        When a picture cannot be read, or an option is out of range.

    Examples
    --------
    >>> import dotwave as dw
    >>> dw.image("samples/icons/heart.svg").parts
    ('icon: heart.svg, similarity 0.98',)
    """
    profile = _device(device)
    chosen = pitched(replace(options or PictureOptions(), **changes), profile)
    several = [files] if isinstance(files, str | bytes | PathLike) else list(files)
    if not several:
        raise AppError("image: no picture was given; give at least one")
    shape = shape_of(profile)
    return joined([picture_scene(_picture(one), shape, chosen) for one in several], shape)


def icons(
    sources: str | PathLike[str] | Iterable[str | PathLike[str]], device: AnyDevice = USUAL_DEVICE, **changes: Any
) -> Scene:
    """All icons of folders, globs, zip and tar archives, one after another, sorted by name.

    `dotwave icons` makes sets of them that are told apart, and their pages; this shows each as its best pattern.

    Parameters
    ----------
    sources : path, or several
        Folders, globs, single pictures, archives.
    device : Device, name, file or mapping
        Whose grid and pitch the icons are made for.
    **changes
        Single options by their names in `encoders.PictureOptions`; the style is ``icon``.

    Returns
    -------
    encoders.Scene
        With a line on each icon in `parts`.

    Raises
    ------
    dotwave.AppError, encoders.EncodeError
        When there is no picture, or one of them cannot be used.

    Examples
    --------
    >>> import dotwave as dw
    >>> scene = dw.icons("samples/icons/[hl]*.svg")
    >>> len(list(scene.frames)) == len(scene.parts)
    True
    """
    from ..icon_sets.sources import find_icons, read_icons

    several = [sources] if isinstance(sources, str | PathLike) else list(sources)
    files = list(read_icons(find_icons([str(one) for one in several])))
    for file in files:
        if file.error:
            raise AppError(f"{file.name}: {file.error}")
    scene = image([file.data for file in files], device, **{"style": Style.ICON} | changes)
    words = (f"icon: {file.name},{part.partition(',')[2]}" for file, part in zip(files, scene.parts, strict=True))
    return replace(scene, parts=tuple(words))


def _picture(source: Picture) -> Path | bytes:
    return source if isinstance(source, bytes) else Path(source)
