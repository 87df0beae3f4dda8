"""Real prose of ten languages, 30,000 characters each where there are as many: every page read alone.

The prose comes from Debian's packages: the handbook, GNOME's help and the sentences of a mail program. They are
fetched by apt-get into the temporary folder of the test, which is skipped where that cannot be.
"""

import gettext
import io
import re
import subprocess
import sys
import tarfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from encoders import GridShape, TextOptions, back_translate, encode_text, translate
from encoders.braille.alphabet import alphabet
from encoders.braille.joining import unmarked
from tests.support.known import known

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from book import Prose

CHARACTERS = 30_000


def html(data: bytes) -> list[str]:
    prose = Prose()
    prose.feed(data.decode())
    return prose.blocks


def mallard(data: bytes) -> list[str]:
    kinds = {"p", "title", "desc"}
    return ["".join(one.itertext()) for one in ElementTree.fromstring(data).iter() if one.tag.split("}")[-1] in kinds]


def sentences(data: bytes) -> list[str]:
    catalogue = gettext.GNUTranslations(io.BytesIO(data))._catalog  # type: ignore[attr-defined]
    return [re.sub(r"<[^>]*>|%\S+|[_\\{}]", "", text) for text in catalogue.values()]


class Language(NamedTuple):
    """Where prose of a language is, its table, and the letters most of a block has to be of."""

    table: str
    package: str
    files: str
    read: Callable[[bytes], list[str]]
    letters: str = "A-Za-z"


HANDBOOK = "debian-handbook", r"./usr/share/doc/debian-handbook/html/{}/.*\.html"
HELP = "gnome-user-docs", r"./usr/share/help/{}/gnome-help/.*\.page"
MAIL = "evolution-common", r"./usr/share/locale/{}/LC_MESSAGES/evolution\.mo"


def source(place: tuple[str, str], name: str) -> tuple[str, str]:
    return place[0], place[1].format(name)


LANGUAGES = {
    "English": Language("en-ueb-g2.ctb", *source(HANDBOOK, "en-US"), html),
    "German": Language("de-g2.ctb", *source(HANDBOOK, "de-DE"), html),
    "French": Language("fr-bfu-g2.ctb", *source(HANDBOOK, "fr-FR"), html),
    "Russian": Language("ru-litbrl.ctb", *source(HANDBOOK, "ru-RU"), html, "Ѐ-ӿ"),
    "Arabic": Language("ar-ar-g1.utb", *source(HANDBOOK, "ar-MA"), html, "؀-ۿ"),
    "Hindi": Language("hi-in-g1.utb", *source(MAIL, "hi"), sentences, "ऀ-ॿ"),
    "Chinese": Language("zhcn-g2.ctb", *source(HANDBOOK, "zh-CN"), html, "一-鿿"),
    "Korean": Language("ko-g2.ctb", *source(HELP, "ko"), mallard, "가-힯"),
    "Greek": Language("el.ctb", *source(HELP, "el"), mallard, "Ͱ-Ͽ"),
    "Hebrew": Language("he-IL.utb", *source(MAIL, "he"), sentences, "֐-׿"),
}


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    folder = tmp_path_factory.mktemp("packages")

    def package(name: str) -> Path:
        found = list(folder.glob(f"{name}_*.deb"))
        if not found:
            done = subprocess.run(["apt-get", "-qq", "download", name], cwd=folder, capture_output=True, text=True)
            found = list(folder.glob(f"{name}_*.deb"))
            if not found:
                pytest.skip(f"the package {name} cannot be fetched: {done.stderr[-200:]}")
        return found[0]

    return package


def blocks(package: Path, language: Language) -> Iterator[str]:
    call = ["dpkg-deb", "--fsys-tarfile", str(package)]
    files = {}
    with (
        subprocess.Popen(call, stdout=subprocess.PIPE) as process,
        tarfile.open(fileobj=process.stdout, mode="r|") as archive,
    ):
        for member in archive:
            if re.fullmatch(language.files, member.name):
                files[member.name] = known(archive.extractfile(member)).read()
    for name in sorted(files):
        for block in language.read(files[name]):
            text = " ".join(block.split())
            if len(text) > 30 and 2 * len(re.findall(f"[{language.letters}]", text)) > len(text):
                yield text


def of_signs(text: str, wanted: Callable[[str], bool]) -> str:
    return "".join(char for char in re.sub(r"\\[\d/-]+/", "", text) if wanted(char))


@pytest.mark.slow
@pytest.mark.parametrize("shape", [GridShape(6, 6), GridShape(40, 96)], ids=["6x6", "40x96"])
@pytest.mark.parametrize("name", LANGUAGES)
def test_no_number_and_no_capitals_are_read_as_something_else(name, shape, packages):
    language = LANGUAGES[name]
    text = "\n\n".join(dict.fromkeys(blocks(packages(language.package), language)))[:CHARACTERS]
    assert len(text) > 5_000
    tables = (language.table,)
    scene = encode_text(text, shape, TextOptions(table=language.table))
    number_sign = translate(tables, "5").cells[:-1]
    digits = capitals = lone = 0
    for frame in scene.frames:
        cells, shown = unmarked(frame.cells, scene.encoding, frame.goes_on), frame.text.strip()
        paragraphs = (translate(tables, paragraph).cells.strip("⠀") for paragraph in shown.split("\n\n"))
        written = "⠀".join(paragraphs)
        lone += cells.endswith(number_sign or "\0") and not written.endswith(number_sign)
        # Equal, or with a sign the table cannot write, whose name may go over several pages.
        if cells == written or alphabet(tables).lacks(shown):
            continue
        # Not as if the page were all there is: then it must at least read so.
        back, likely = back_translate(tables, cells), back_translate(tables, written)
        if any(char.isdigit() for char in shown):
            digits += of_signs(back, str.isdigit) not in (of_signs(likely, str.isdigit), of_signs(shown, str.isdigit))
        if any(char.isupper() for char in shown):
            capitals += of_signs(back, str.isupper) not in (of_signs(likely, str.isupper), of_signs(shown, str.isupper))
    assert (digits, capitals, lone) == (0, 0, 0)
    check = scene.text_frames.check()
    assert check.cells_equal
    assert check.alone_total == 0, [one.sentence for one in check.alone]
