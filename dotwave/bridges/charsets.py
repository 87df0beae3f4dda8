"""Names of character sets as clients send them, and the characters of bytes in one."""

from __future__ import annotations

import sys
from encodings.aliases import aliases

__all__ = ["characters"]

_NATIVE = "utf_32_le" if sys.byteorder == "little" else "utf_32_be"
# What iconv calls it, and what Python does.
_ICONV = {
    "ucs_4le": "utf_32_le", "ucs_4be": "utf_32_be", "ucs_4": "utf_32_be", "ucs_4_internal": _NATIVE,
    "ucs4": "utf_32_be", "wchar_t": _NATIVE, "ucs_2le": "utf_16_le", "ucs_2be": "utf_16_be", "ucs_2": "utf_16_be",
    "ucs2": "utf_16_be", "iso_10646": "utf_32_be",
}  # fmt: skip
# Only names that are known here are looked up: Python keeps every name it was ever asked for.
_KNOWN = set(aliases) | set(aliases.values())
_NO_TEXT = {"base64_codec", "bz2_codec", "hex_codec", "quopri_codec", "rot_13", "uu_codec", "zlib_codec"}


def characters(data: bytes, charset: str | None) -> str:
    """The characters of `data`.

    Parameters
    ----------
    data : as it came.
    charset : its name, in any spelling; None where the client names none, which means UTF-8, else Latin-1.

    Raises
    ------
    ValueError
        When there is no such character set, or the bytes are not of it.
    """
    if charset is None:
        try:
            return data.decode("utf-8")
        except UnicodeDecodeError:
            return data.decode("latin-1")
    name = charset.strip().lower().replace("-", "_").replace(" ", "_").removesuffix("//translit")
    name = _ICONV.get(name, name)
    codec = aliases.get(name, name)
    if (name not in _KNOWN and name not in _ICONV.values()) or codec in _NO_TEXT:
        raise ValueError(f"no character set is called {charset[:40]!r}")
    try:
        return data.decode(codec)
    except LookupError as error:
        raise ValueError(str(error)) from None
