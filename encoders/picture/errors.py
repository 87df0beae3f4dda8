"""Errors of picture encoding, each with the situations in which it is met."""

from __future__ import annotations

from ..errors import EncodeError

__all__ = ["EmptyPicture", "PictureBroken", "PictureError", "PictureTooLarge", "RendererMissing"]


class PictureError(EncodeError, ValueError):
    """A picture, or an option for one, cannot be used.

    Examples: a file of another kind; an unknown background colour; a zoom of 0.
    """


class PictureBroken(PictureError):
    """The file is of a kind that is read, but malformed.

    Examples: a truncated PNG; an SVG that is not XML.
    """


class PictureTooLarge(PictureError):
    """Reading the picture would take more than the limits allow.

    Examples: a decompression bomb; a photograph of 100 megapixels; an SVG with a million shapes.
    """


class EmptyPicture(PictureError):
    """The picture has nothing that could be felt.

    Examples: it is one flat tone; it is fully transparent; an SVG in which only text is drawn.
    """


class RendererMissing(PictureError, ImportError):
    """A library that reads this kind of picture is not installed."""
