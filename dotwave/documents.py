"""Documents whose images are felt as pictures, between the texts around them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from chainsim import Device
from encoders import EmptyText, EncodeError, ImageSpan, PictureOptions, Scene, TextOptions, TextSource, encode_text

from .pictures import picture_scene, pitched
from .scenes import joined, shape_of, text_scene

__all__ = ["illustrated_scene"]


def illustrated_scene(source: TextSource, device: Device, options: TextOptions) -> Scene:
    """A document, each of its images as a picture in its place; one that cannot be felt is left as its words.

    Raises
    ------
    encoders.EncodeError
        As `encoders.encode_text` does.
    """
    shape = shape_of(device)
    whole = encode_text(source, shape, options).text_frames.source
    # What is shown is chosen by now.
    rest = replace(options, start_at=None, pages=None)
    scenes: list[Scene] = []
    at, failed = 0, list[str]()
    for span in whole.document.images if whole.document else ():
        try:
            picture = _picture(span, device)
        except EncodeError as error:
            failed.append(f"image left out: {error}")
            continue
        scenes += (text_scene(part, shape, rest) for part in _texts(whole, at, span.start))
        scenes.append(picture)
        at = span.end
    scenes += (text_scene(part, shape, rest) for part in _texts(whole, at, len(whole.text)))
    scene = joined(scenes, shape)
    return replace(scene, parts=(*scene.parts, *failed))


def _picture(span: ImageSpan, device: Device) -> Scene:
    if span.image.load is None:
        raise EmptyText(f"{span.image.name or 'an image without a name'}: is not in the document")
    return picture_scene(span.image.load(), shape_of(device), pitched(PictureOptions(), device))


def _texts(source: TextSource, start: int, end: int) -> Iterator[TextSource]:
    """The text from `start` to `end`, if there is any."""
    try:
        yield source.part(start, end)
    except EmptyText:
        return
