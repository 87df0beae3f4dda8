"""Names of signs in the languages of Braille tables: the short names of Unicode's CLDR, a compressed file a language.

`python -m encoders.braille.names.make FOLDER` makes the files from the unpacked npm package cldr-annotations-full
(version 48.2.0, under the Unicode License v3, see LICENSE-UNICODE in this folder).
"""

from __future__ import annotations

import json
import lzma
from functools import cache
from importlib.resources import files

__all__ = ["cldr_language", "local_name"]


def cldr_language(tag: str) -> str:
    """A BCP 47 tag without its region, the macrolanguage for Mandarin: CLDR has ``zh``."""
    language = tag.split("-")[0].casefold()
    return {"cmn": "zh"}.get(language, language)


def local_name(char: str, language: str) -> str:
    """What `char` is called in a language, empty where that is not known. English names are those of Unicode itself."""
    return _names(language).get(char, "")


@cache
def _names(language: str) -> dict[str, str]:
    file = files(__package__) / f"{language}.json.xz"
    if not language.isalpha() or not file.is_file():
        return {}
    names: dict[str, str] = json.loads(lzma.decompress(file.read_bytes()))
    return names
