"""What a real book takes: processor time, frames and memory, encoded, encoded and planned, and a chapter written.

python benchmarks/book.py                       print it beside what is kept
python benchmarks/book.py --keep                write benchmarks/results/book.json
python benchmarks/book.py --text FILE           another text

The book is the English text of Debian's package debian-handbook (The Debian Administrator's Handbook, a megabyte of
prose), fetched by apt-get into a temporary folder. Headings and paragraphs are taken once each; listings are not.
Each line is a fresh interpreter with nothing planned before, its start included. Planning uses one core.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from html.parser import HTMLParser
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
KEPT = ROOT / "benchmarks" / "results" / "book.json"
PACKAGE, PAGES = "debian-handbook", "./usr/share/doc/debian-handbook/html/en-US/"
SKIPPED = {"head", "pre", "script", "style"}
INLINE = {"a", "abbr", "b", "br", "code", "em", "i", "img", "span", "strong", "sub", "sup", "tt"}
# Characters of what is planned on the slower device, and of what is written.
PART, CHAPTER = 100_000, 8_000

ENCODED = """
import json, sys
from pathlib import Path
from chainsim import load_device
from encoders import GridShape, TextOptions, TextSource, encode_text
device = load_device(sys.argv[2])
source = TextSource.of_text(Path(sys.argv[1]).read_text(encoding="utf-8"))
scene = encode_text(source, GridShape(device.rows, device.cols), TextOptions())
print(json.dumps({"frames": sum(1 for _ in scene.frames), "outcomes": {}}))
"""


class Prose(HTMLParser):
    """Collects the text of a page, a line for each block."""

    def __init__(self) -> None:
        super().__init__()
        self.blocks = [""]
        self._skipped = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._skipped += tag in SKIPPED
        self._border(tag)

    def handle_endtag(self, tag: str) -> None:
        self._skipped -= tag in SKIPPED
        self._border(tag)

    def handle_data(self, data: str) -> None:
        if not self._skipped:
            self.blocks[-1] += data

    def _border(self, tag: str) -> None:
        if tag not in INLINE:
            self.blocks.append("")


def book() -> str:
    """The text of the book, blocks with an empty line between."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["apt-get", "-qq", "download", PACKAGE], cwd=folder, check=True, stderr=subprocess.DEVNULL)
        (package,) = Path(folder).glob("*.deb")
        pages = dict(_pages(package))
    blocks: dict[str, None] = {}
    for name in sorted(pages):
        prose = Prose()
        prose.feed(pages[name])
        # What stands on every page, such as links to the next one, is kept once.
        blocks |= dict.fromkeys(" ".join(block.split()) for block in prose.blocks if block.strip())
    return "\n\n".join(blocks)


def _pages(package: Path) -> Iterator[tuple[str, str]]:
    call = ["dpkg-deb", "--fsys-tarfile", str(package)]
    with (
        subprocess.Popen(call, stdout=subprocess.PIPE) as process,
        tarfile.open(fileobj=process.stdout, mode="r|") as archive,
    ):
        for member in archive:
            if member.name.startswith(PAGES) and member.name.endswith(".html") and member.isfile():
                file = archive.extractfile(member)
                assert file is not None
                yield member.name, file.read().decode("utf-8")


@dataclass(frozen=True)
class Line:
    """What was done to how much, and what it took."""

    what: str
    megabytes: float
    frames: int
    processor_s: float
    resident_mb: float
    outcomes: dict[str, int]

    def words(self, kept: float | None) -> str:
        """For a person."""
        was = "" if kept is None else f" (kept: {kept:.1f})"
        return (
            f"{self.what:42} {self.megabytes:.3f} MB, {self.frames} frames: {self.processor_s:.1f} s of the processor"
            f"{was}, {self.processor_s / self.megabytes:.1f} s a megabyte, {self.resident_mb:.0f} MB resident"
        )


def measured(text: str) -> Iterator[Line]:
    plan = ["-m", "dotwave", "text"]
    yield _line("encoded, paper-6x6", text, ["-c", ENCODED], ["paper-6x6"])
    yield _line("encoded and planned, paper-6x6", text, plan, ["--device", "paper-6x6", "--json"])
    yield _line("a part encoded, linked-6x6", text[:PART], ["-c", ENCODED], ["linked-6x6"])
    yield _line("a part encoded and planned, linked-6x6", text[:PART], plan, ["--device", "linked-6x6", "--json"])
    chapter = ["--device", "paper-6x6", "--output", "chapter.wav", "--json"]
    yield _line("a chapter written as WAV, paper-6x6", text[:CHAPTER], plan, chapter)


def _line(what: str, text: str, call: list[str], options: list[str]) -> Line:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "book.txt").write_text(text, encoding="utf-8")
        place = os.environ | {"DOTWAVE_CACHE": folder, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
        told = Path(folder) / "told.json"
        with told.open("wb") as out:
            process = subprocess.Popen([sys.executable, *call, "book.txt", *options], cwd=folder, env=place, stdout=out)
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        found = json.loads(told.read_text(encoding="utf-8"))
    return Line(
        what, len(text.encode()) / 1e6, found["frames"], used.ru_utime + used.ru_stime, used.ru_maxrss / 1024,
        found["outcomes"],
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", action="store_true", help=f"write {KEPT.name}")
    parser.add_argument("--text", type=Path, help="a UTF-8 text in place of the book")
    given = parser.parse_args()
    before = json.loads(KEPT.read_text(encoding="utf-8"))["lines"] if KEPT.exists() else []
    kept = {one["what"]: one["processor_s"] for one in before}
    text = book() if given.text is None else given.text.read_text(encoding="utf-8")
    load, found = os.getloadavg()[0], []
    for one in measured(text):
        found.append(one)
        print(one.words(kept.get(one.what)), flush=True)
    if given.keep:
        facts = {"schema": "dotwave/book/1", "source": PACKAGE if given.text is None else given.text.name}
        facts |= {"cores": os.cpu_count(), "load_before": load, "lines": [asdict(one) for one in found]}
        KEPT.write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
