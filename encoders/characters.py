"""Bytes to characters: byte order marks, a given encoding, UTF-8; what is neither gets a likely name."""

from __future__ import annotations

import codecs

from .errors import InvalidText

__all__ = ["declared", "decoded"]

_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32"), (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"),
)  # fmt: skip
LOOKED_AT = 4096
LIKELY = ("cp1252", "cp1251", "cp1250", "shift_jis", "gb18030", "big5", "euc_kr")


def decoded(data: bytes, encoding: str | None = None) -> str:
    """The characters of a file.

    Parameters
    ----------
    data : its bytes. A byte order mark says UTF-8 or UTF-16.
    encoding : name of an encoding as Python has it, before anything the file says; None for UTF-8.

    Raises
    ------
    InvalidText
        With the offset of the first byte that does not fit and, of bytes that are not UTF-8, a likely encoding;
        also when there is no such encoding, or a NUL.
    """
    marked = next((name for mark, name in _MARKS if data.startswith(mark)), "")
    name = encoding or marked or "utf-8"
    if not _is_encoding(name):
        raise InvalidText(f"no encoding is called {name!r}; give one such as utf-16, cp1252 or iso8859-15")
    if not name.lower().replace("_", "-").startswith(("utf-16", "utf-32", "utf16", "utf32")):
        nul = data.find(b"\0")
        if nul >= 0:
            raise InvalidText(f"a NUL byte at byte {nul}; remove it (is this really a text?){_wide(data, encoding)}")
    try:
        return data.decode(name)
    except UnicodeDecodeError as error:
        bad = data[error.start] if error.start < len(data) else 0
        where = f"at byte {error.start} (0x{bad:02x})"
        if encoding:
            raise InvalidText(f"not {encoding} {where}; give another --encoding, or save it as UTF-8") from None
        if marked:
            raise InvalidText(f"not {marked.upper()} {where}, as its byte order mark says; save it as UTF-8") from None
        raise InvalidText(f"not UTF-8 {where}; save it as UTF-8{_guess(data)}") from None


def declared(data: bytes, encoding: str | None, said: str) -> str:
    """The same of a file that declares its encoding; one that Python does not know counts for nothing."""
    marked = any(data.startswith(mark) for mark, _ in _MARKS)
    if encoding or marked or not said:
        return decoded(data, encoding)
    return decoded(data, said if _is_encoding(said) and codecs.lookup(said).name != "utf-8" else None)


def _is_encoding(name: str) -> bool:
    try:
        # Not every codec of Python is one of text.
        "".encode(name)
    except (LookupError, ValueError):
        return False
    return True


def _wide(data: bytes, encoding: str | None) -> str:
    """A hint where every second byte of a text is NUL."""
    start = data[:LOOKED_AT]
    for name, zeros in (("utf-16-le", start[1::2]), ("utf-16-be", start[::2])):
        if encoding is None and zeros.count(0) > 0.4 * len(zeros) > 0:
            return f"; or give --encoding {name}, which it seems to be"
    return ""


def _guess(data: bytes) -> str:
    """The encoding whose letters make the most words, where one does."""
    best, name = 0.0, ""
    for one in LIKELY:
        try:
            text = data[:LOOKED_AT].decode(one, "strict" if len(data) <= LOOKED_AT else "ignore")
        except UnicodeDecodeError:
            continue
        beyond = [char for char in text if char > "\x7f"]
        if not beyond or any(char < " " and char not in "\t\n\r\f\x1a" for char in text):
            continue
        score = sum(_likely(one, char) for char in beyond) / len(beyond)
        if score > best:
            best, name = score, one
    return f", or give --encoding {name}, which it may be" if best > 0.5 else ""


def _likely(encoding: str, char: str) -> float:
    """How usual a character is in texts of an encoding, 0 to 1."""
    if encoding == "cp1252":
        return 1.0 if char in "äöüßÄÖÜéèêàâçñáíóúôîïëûœ’‘“”–—«»…°§ØøÅåÆæ¿¡ìòùã" else 0.2
    if encoding == "cp1251":
        # Mostly small letters: capitals alone are what western letters look like in it.
        return 0.9 if "а" <= char <= "я" else 0.3 if "А" <= char <= "Я" else 0.1
    if encoding == "cp1250":
        return 0.95 if char in "ąćęłńśźżčřšžýáíéúůěďťňőűĄĆĘŁŃŚŹŻČŘŠŽ„”–" else 0.1
    ranges = {
        "shift_jis": (("\u3040", "\u30ff", 0.97), ("\u4e00", "\u9fff", 0.88)),
        "gb18030": (("\u4e00", "\u9fff", 0.85), ("\u3000", "\u3020", 0.8), ("\uff00", "\uff20", 0.8)),
        "big5": (("\u4e00", "\u9fff", 0.84), ("\u3000", "\u3020", 0.8)),
        "euc_kr": (("\uac00", "\ud7a3", 0.96),),
    }
    return next((weight for low, high, weight in ranges[encoding] if low <= char <= high), 0.0)
