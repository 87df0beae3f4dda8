"""Documents that tests read: made by real producers where they are installed, else built here."""

from __future__ import annotations

import io
import shutil
import subprocess
import zipfile
from collections.abc import Mapping
from pathlib import Path

import pytest

from encoders import TextSource

__all__ = [
    "BLOCKS", "EMPHASES", "MASTER", "blocks_of", "by_libreoffice", "by_pandoc", "emphases_of", "package", "zipped",
]  # fmt: skip

MASTER = """\
# First chapter

A paragraph with *leaning words* and **heavy** text
on two lines.

- one
- two

1. first
2. second

| Letter | Sound |
|---|---|
| a | short |
| b | |

## The second

No more than a line\\
and one under it.
"""
BLOCKS = [
    ("heading", 1, "First chapter"),
    ("paragraph", 0, "A paragraph with leaning words and heavy text on two lines."),
    ("list-item", 1, "one"),
    ("list-item", 1, "two"),
    ("list-item", 1, "1. first"),
    ("list-item", 1, "2. second"),
    ("table-row", 0, "Letter; Sound"),
    ("table-row", 0, "a; short"),
    ("table-row", 0, "b;"),
    ("heading", 2, "The second"),
    ("verse", 0, "No more than a line\nand one under it."),
]
"""Kind, level and text of the blocks of `MASTER`."""
EMPHASES = [("leaning words", 1), ("heavy", 4)]


def blocks_of(source: TextSource) -> list[tuple[str, int, str]]:
    """Kind, level and text of every block."""
    assert source.document is not None
    return [(one.kind.value, one.level, source.text[one.start : one.end]) for one in source.document.blocks]


def emphases_of(source: TextSource) -> list[tuple[str, int]]:
    """What stands out, and how."""
    assert source.document is not None
    return [(source.text[start:end], form) for start, end, form in source.document.emphases]


def by_pandoc(text: str, folder: Path, ending: str, *options: str) -> Path:
    """A document made of Markdown by pandoc."""
    if shutil.which("pandoc") is None:
        pytest.skip("pandoc is not installed")
    path = folder / f"made.{ending}"
    command = ["pandoc", "--from", "markdown", "--output", str(path), *options]
    subprocess.run(command, input=text.encode(), check=True, cwd=folder)
    return path


def by_libreoffice(path: Path, folder: Path, ending: str) -> Path:
    """A document made of another by LibreOffice."""
    if shutil.which("soffice") is None:
        pytest.skip("LibreOffice is not installed")
    profile = f"-env:UserInstallation=file://{folder}/profile"
    command = ["soffice", profile, "--headless", "--convert-to", ending, "--outdir", str(folder), str(path)]
    subprocess.run(command, check=True, capture_output=True)
    return folder / f"{path.stem}.{ending}"


def zipped(files: Mapping[str, bytes | str]) -> bytes:
    """A zip archive of files by name."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name, (2026, 1, 1, 0, 0, 0)), content, zipfile.ZIP_DEFLATED)
    return out.getvalue()


def package(pages: dict[str, str], *, root: str = "package.opf") -> dict[str, bytes | str]:
    """The files of a book: its pages of XHTML by name, and a package with their order."""
    items = "".join(
        f'<item id="p{n}" href="{name}" media-type="application/xhtml+xml"/>' for n, name in enumerate(pages)
    )
    order = "".join(f'<itemref idref="p{number}"/>' for number in range(len(pages)))
    opf = (
        '<?xml version="1.0"?><package xmlns="http://www.idpf.org/2007/opf" version="3.0"><metadata/>'
        f"<manifest>{items}</manifest><spine>{order}</spine></package>"
    )
    folder = root.rpartition("/")[0] + "/" if "/" in root else ""
    page = '<?xml version="1.0"?><html xmlns="http://www.w3.org/1999/xhtml"><body>{}</body></html>'
    return {root: opf, **{folder + name: page.format(body) for name, body in pages.items()}}
