"""A document as one text, with spans that say what is where: what the transcriber and a layout go by."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from .model import Block, BlockKind, Document, DocumentPlace, EmbeddedImage, TextRun

__all__ = ["BlockSpan", "FlatDocument", "ImageSpan", "flattened"]

BLOCK_BREAK = "\n\n"


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

    def place_at(self, position: int) -> DocumentPlace:
        """Where in the document a character of the text comes from."""
        index = bisect_right(self._run_starts, position) - 1
        return self.runs[max(index, 0)][1] if self.runs else DocumentPlace()


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
