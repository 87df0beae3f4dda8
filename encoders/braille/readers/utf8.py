"""UTF-8 text, Unicode Braille among it."""

from __future__ import annotations

from ...errors import InvalidText

__all__ = ["utf8_to_text"]


def utf8_to_text(data: bytes) -> str:
    """The characters of a UTF-8 file.

    Raises
    ------
    InvalidText
        With the offset of the first byte that is not UTF-8, or of a NUL.
    """
    nul = data.find(b"\0")
    if nul >= 0:
        raise InvalidText(f"a NUL byte at byte {nul}; remove it (is this really a text?)")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        bad = data[error.start]
        raise InvalidText(f"not UTF-8 at byte {error.start} (0x{bad:02x}); save it as UTF-8") from None
