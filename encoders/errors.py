"""Errors of the encoders, each with the situations in which it is met."""

from __future__ import annotations

__all__ = [
    "DocumentsMissing",
    "EmptyText",
    "EncodeError",
    "InvalidText",
    "LayoutError",
    "LouisMissing",
    "TableMissing",
    "UndefinedCharacter",
    "UnsupportedSource",
]


class EncodeError(Exception):
    """Root of everything `encoders` raises on purpose.

    Examples
    --------
    >>> from encoders import EncodeError, GridShape, TextOptions, encode_text
    >>> try:
    ...     encode_text("Hello", GridShape(6, 6), TextOptions(rate=0.0))
    ... except EncodeError as error:
    ...     print(error)
    rate: expected a number > 0, got 0.0
    """


class LouisMissing(EncodeError, ImportError):
    """The Braille library cannot be used.

    Examples: python3-louis is not installed; the `louis` that is found is another package.
    """


class DocumentsMissing(EncodeError, ImportError):
    """A document cannot be read for want of a library, or a program, that reads such.

    Examples: an EPUB without lxml; a formula without a converter of MathML.
    """


class TableMissing(EncodeError, LookupError):
    """A translation table cannot be used.

    Examples: no table has that name; no table answers the query; the table does not compile.
    """


class UnsupportedSource(EncodeError, ValueError):
    """The input is of a kind that is not read.

    Examples: an old Office document, a picture; an archive that would fill the memory.
    """


class InvalidText(EncodeError, ValueError):
    """The input is text, but broken.

    Examples: a byte that is not UTF-8; a NUL byte; a byte that is not ASCII Braille in a BRF file.
    """


class EmptyText(EncodeError, ValueError):
    """The input has nothing that could be shown.

    Examples: an empty file; white space only; nothing is left after undefined characters were dropped.
    """


class UndefinedCharacter(EncodeError, ValueError):
    """A character the table cannot write was met, and the policy is `error`."""


class LayoutError(EncodeError, ValueError):
    """Cells do not fit the grid as wished.

    Examples: a grid smaller than one cell; an 8-dot table on a grid with cells of three rows; a rate of 0.
    """
