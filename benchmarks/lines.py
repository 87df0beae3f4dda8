"""How full the pages of a real book are on a device with several lines.

python benchmarks/lines.py                       the book of benchmarks/book.py on linked-40x96
python benchmarks/lines.py --text FILE           another text or document
python benchmarks/lines.py --device NAME         another device

Prints pages, lines, and the share of lines without a dot. Takes a minute for the megabyte of the book.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from book import book

from chainsim import load_device
from encoders import GridShape, TextOptions, TextSource, encode_text

BLANK = "\u2800"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--text", type=Path, help="a text or document in place of the book")
    parser.add_argument("--device", default="linked-40x96", help="whose grid the pages are laid out for")
    given = parser.parse_args()
    source = TextSource.of_text(book()) if given.text is None else TextSource.of_path(given.text)
    device = load_device(given.device)
    pages = lines = empty = 0
    for frame in encode_text(source, GridShape(device.rows, device.cols), TextOptions()).frames:
        shown = frame.cells.split("\n")
        pages, lines = pages + 1, lines + len(shown)
        empty += sum(not line.strip(BLANK) for line in shown)
    print(f"{device.name}: {pages} pages, {lines} lines, {100 * empty / lines:.1f} % of them empty")


if __name__ == "__main__":
    main()
