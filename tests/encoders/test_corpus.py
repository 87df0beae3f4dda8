"""The library's own test corpus through the encoder: what is felt is what the authors of a table expect of it.

The corpus (some 150 YAML files of liblouis, under several licences) is not kept here. DOTWAVE_LIBLOUIS_SPECS names a
folder with those of the installed version (``tests/braille-specs`` of its source); else the source is fetched, from
Debian or from where liblouis releases it.
"""

import io
import os
import tarfile
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml

from encoders import EncodeError, GridShape, TextOptions, TextSource, encode_text, join_pages, liblouis_version

SOURCES = (
    "https://deb.debian.org/debian/pool/main/libl/liblouis/liblouis_{0}.orig.tar.gz",
    "https://github.com/liblouis/liblouis/releases/download/v{0}/liblouis-{0}.tar.gz",
)
SMALL, LARGE = GridShape(6, 6), GridShape(40, 96)
# These ask for more than a text and a table.
BEYOND = {"xfail", "typeform", "mode", "cursorPos", "maxOutputLength"}


class Case(NamedTuple):
    """A text, the tables, and the cells its authors expect."""

    file: str
    tables: str
    text: str
    cells: str


def corpus() -> Iterator[tuple[str, str]]:
    """(name, text) of each file of the corpus."""
    folder = os.environ.get("DOTWAVE_LIBLOUIS_SPECS")
    if folder:
        yield from ((path.name, path.read_text()) for path in sorted(Path(folder).glob("*.yaml")))
        return
    with tarfile.open(fileobj=io.BytesIO(fetched_source())) as archive:
        for member in archive:
            file = archive.extractfile(member) if "/braille-specs/" in member.name else None
            if file is not None and member.name.endswith(".yaml"):
                yield Path(member.name).name, file.read().decode()


def fetched_source() -> bytes:
    refused = []
    for url in (source.format(liblouis_version()) for source in SOURCES):
        try:
            with urllib.request.urlopen(url, timeout=60) as answer:
                data: bytes = answer.read()
                return data
        except (urllib.error.URLError, TimeoutError) as error:
            refused.append(f"{url}: {error}")
    pytest.skip(f"not fetched: {'; '.join(refused)}; name a folder in DOTWAVE_LIBLOUIS_SPECS")


def cases() -> Iterator[Case]:
    """Cases of all blocks: keys are repeated in a file, so its nodes are walked in order."""
    for name, text in corpus():
        tables, forward = "", True
        try:
            root = yaml.compose(text, Loader=yaml.CSafeLoader if hasattr(yaml, "CSafeLoader") else yaml.SafeLoader)
        except yaml.YAMLError:
            continue
        for key, node in root.value if isinstance(root, yaml.MappingNode) else ():
            value = plain(node)
            if key.value == "table":
                tables, forward = table_of(value), True
            elif key.value == "flags":
                forward = dict(value).get("testmode", "forward") in ("forward", "bothDirections")
            elif key.value == "tests" and tables and forward:
                yield from (case for one in value if (case := case_of(name, tables, one)))


def plain(node: yaml.Node) -> Any:
    if isinstance(node, yaml.MappingNode):
        return {key.value: plain(value) for key, value in node.value}
    return [plain(one) for one in node.value] if isinstance(node, yaml.SequenceNode) else node.value


def table_of(value: Any) -> str:
    if isinstance(value, dict):
        return str(value.get("__assert-match", ""))
    return ",".join(value) if isinstance(value, list) else value if "\n" not in value else ""


def case_of(name: str, tables: str, one: list[Any]) -> Case | None:
    about = one[-1] if isinstance(one[-1], dict) else {}
    words = [part for part in one if isinstance(part, str)]
    text, cells = words[-2:] if len(words) >= 2 else ("", "")
    braille = cells.strip() and all("\u2800" <= char <= "\u28ff" or char == " " for char in cells)
    if not braille or BEYOND & set(about) or "\\" in text or not text.strip():
        return None
    return Case(name, tables, text, "⠀".join(cells.replace("⠀", " ").split()))


def felt(case: Case, shape: GridShape) -> str:
    dots = 8 if max(case.cells) > "⠿" else 6
    scene = encode_text(TextSource.of_text(case.text), shape, TextOptions(table=case.tables, dots=dots))
    frames = list(scene.frames)
    return join_pages([frame.cells for frame in frames], scene.encoding, [frame.goes_on for frame in frames])


@pytest.mark.slow
def test_the_corpus_of_the_library_is_felt_as_its_authors_expect():
    total, wrong, refused = 0, list[str](), 0
    for case in cases():
        total += 1
        try:
            found = felt(case, LARGE)
        except EncodeError:
            refused += 1
            continue
        if found != case.cells:
            wrong.append(f"{case.file} {case.tables}: '{case.text}' is {found}, expected {case.cells}")
    assert total > 10_000
    # Soft hyphens are left out here, and vowels stand behind what is typed before them.
    soft_or_turned = ("\u00ad", "\u0651", "\u05bc", "\u05c2")
    assert [one for one in wrong if not any(char in one for char in soft_or_turned)] == []
    assert len(wrong) < 30
    assert refused == 0


WORDS = yaml.safe_load((Path(__file__).parents[1] / "data" / "braille_words.yaml").read_text())


@pytest.mark.parametrize("shape", [SMALL, LARGE], ids=["6x6", "40x96"])
@pytest.mark.parametrize("table", WORDS)
def test_words_of_many_languages_are_felt_as_the_table_writes_them(table, shape):
    for text, cells in WORDS[table].items():
        assert felt(Case("", table, text, cells), shape) == cells, text
