"""A document as one text, with spans that say what is where: what the transcriber and a layout go by."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from urllib.parse import unquote

from ..errors import UnsupportedSource
from ..reading import first_bytes
from ..scene import Heading
from .limits import MOST_PART_BYTES
from .model import Block, BlockKind, Document, DocumentPlace, EmbeddedImage, TextRun

__all__ = ["BlockSpan", "FlatDocument", "ImageSpan", "flattened"]

BLOCK_BREAK = "\n\n"
LONGEST_HEADING = 200


@dataclass(frozen=True)
class BlockSpan:
    """Where a block stands in the text.

    Attributes
    ----------
    start, end : positions in characters.
    kind, level : as of `Block`.
    place : where it begins in the document.
    """

    start: int
    end: int
    kind: BlockKind
    level: int
    place: DocumentPlace


@dataclass(frozen=True)
class ImageSpan:
    """Where the alternative text of a picture stands in the text, and the picture."""

    start: int
    end: int
    image: EmbeddedImage


@dataclass(frozen=True)
class FlatDocument:
    """A document as one text.

    Attributes
    ----------
    text : its blocks, an empty line between them.
    blocks : their spans, in order, not overlapping.
    emphases : (start, end, emphasis) of what stands out, in order.
    images : its pictures.
    runs : (start, place) of every run.
    notes : as of `Document`.
    """

    text: str
    blocks: tuple[BlockSpan, ...]
    emphases: tuple[tuple[int, int, int], ...]
    images: tuple[ImageSpan, ...]
    runs: tuple[tuple[int, DocumentPlace], ...]
    notes: tuple[str, ...]

    @cached_property
    def _starts(self) -> list[int]:
        return [block.start for block in self.blocks]

    @cached_property
    def _run_starts(self) -> list[int]:
        return [start for start, _ in self.runs]

    def block_at(self, position: int) -> BlockSpan | None:
        """The block a character of the text stands in, None between blocks."""
        index = bisect_right(self._starts, position) - 1
        return self.blocks[index] if index >= 0 and position < self.blocks[index].end else None

    def headings(self, text: str) -> list[tuple[int, Heading]]:
        """All headings with where they begin in `text`, which is that of the document."""
        found = (block for block in self.blocks if block.kind is BlockKind.HEADING)
        return [
            (block.start, Heading(block.level, text[block.start : min(block.end, block.start + LONGEST_HEADING)]))
            for block in found
        ]

    def part(self, start: int, end: int) -> FlatDocument:
        """What it says of the characters from `start` to `end`, counted from `start`."""

        def inside(place: int) -> int:
            return min(max(place, start), end) - start

        blocks = (one for one in self.blocks if one.start < end and one.end > start)
        emphases = (one for one in self.emphases if one[0] < end and one[1] > start)
        return replace(
            self,
            text=self.text[start:end],
            blocks=tuple(replace(one, start=inside(one.start), end=inside(one.end)) for one in blocks),
            emphases=tuple((inside(first), inside(last), form) for first, last, form in emphases),
            images=tuple(
                replace(one, start=one.start - start, end=one.end - start)
                for one in self.images
                if start <= one.start and one.end <= end
            ),
            runs=tuple((max(at - start, 0), self.place_at(max(at, start))) for at in self._run_places(start, end)),
        )

    def beside(self, folder: Path) -> FlatDocument:
        """The same, its pictures that are files in or below the document's own folder found there."""
        found = (replace(one, image=_beside(one.image, folder)) for one in self.images)
        return replace(self, images=tuple(found)) if self.images else self

    def _run_places(self, start: int, end: int) -> list[int]:
        """Where runs begin that reach into the characters from `start` to `end`."""
        first = max(bisect_right(self._run_starts, start) - 1, 0)
        return [at for at in self._run_starts[first:] if at < end]

    def place_at(self, position: int) -> DocumentPlace:
        """Where in the document a character of the text comes from."""
        index = bisect_right(self._run_starts, position) - 1
        return self.runs[max(index, 0)][1] if self.runs else DocumentPlace()


def _beside(image: EmbeddedImage, folder: Path) -> EmbeddedImage:
    if image.load is not None or not image.name:
        return image
    try:
        # Links are followed before it is judged: nothing outside is read.
        path = (folder / unquote(image.name)).resolve()
        inside = path.is_relative_to(folder.resolve()) and path.is_file()
    except (OSError, ValueError):
        inside = False
    return replace(image, load=partial(_bytes_of, path)) if inside else image


def _bytes_of(path: Path) -> bytes:
    try:
        data = first_bytes(path, MOST_PART_BYTES + 1)
    except (OSError, ValueError) as error:
        raise UnsupportedSource(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(data) > MOST_PART_BYTES:
        raise UnsupportedSource(f"{path}: more than {MOST_PART_BYTES} bytes")
    return data


def flattened(document: Document, formula: Callable[[TextRun], str]) -> FlatDocument:
    """The document as one text; `formula` gives what is written for a run that is one."""
    parts: list[str] = []
    blocks, emphases, images, runs = [], list[tuple[int, int, int]](), [], []
    at = 0
    for block in document.blocks:
        if parts:
            parts.append(BLOCK_BREAK)
            at += len(BLOCK_BREAK)
        start = at
        for run in block.runs:
            text = formula(run) if run.mathml else run.text
            runs.append((at, run.place))
            if run.image is not None:
                images.append(ImageSpan(at, at + len(text), run.image))
            if run.emphasis and text.strip():
                _emphasise(emphases, at, at + len(text), int(run.emphasis))
            parts.append(text)
            at += len(text)
        blocks.append(_span(block, start, at))
    return FlatDocument("".join(parts), tuple(blocks), tuple(emphases), tuple(images), tuple(runs), document.notes)


def _span(block: Block, start: int, end: int) -> BlockSpan:
    return BlockSpan(start, end, block.kind, block.level, block.runs[0].place)


def _emphasise(found: list[tuple[int, int, int]], start: int, end: int, emphasis: int) -> None:
    """Add a span; one that goes on with the same emphasis is made longer."""
    if found and found[-1][1:] == (start, emphasis):
        found[-1] = found[-1][0], end, emphasis
    else:
        found.append((start, end, emphasis))
