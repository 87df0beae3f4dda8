"""Makes the files of names: ``python -m encoders.braille.names.make FOLDER``, the unpacked cldr-annotations-full."""

from __future__ import annotations

import json
import lzma
import sys
from pathlib import Path

from ..table_queries import list_tables
from . import cldr_language

__all__ = ["main"]

HERE = Path(__file__).parent


def main(folder: Path) -> None:
    """Write a file for each language of a Braille table that CLDR has names in.

    Parameters
    ----------
    folder : with ``annotations/LANGUAGE/annotations.json`` and ``LICENSE``.
    """
    languages = {cldr_language(info.language) for info in list_tables()} - {"", "en"}
    for language in sorted(languages):
        source = folder / "annotations" / language / "annotations.json"
        if not source.is_file():
            continue
        found = json.loads(source.read_text(encoding="utf-8"))["annotations"].get("annotations", {})
        names = {char: about["tts"][0] for char, about in sorted(found.items()) if len(char) == 1 and about.get("tts")}
        if names:
            data = json.dumps(names, ensure_ascii=False, separators=(",", ":")).encode()
            (HERE / f"{language}.json.xz").write_bytes(lzma.compress(data, preset=9))
    (HERE / "LICENSE-UNICODE").write_bytes((folder / "LICENSE").read_bytes())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
