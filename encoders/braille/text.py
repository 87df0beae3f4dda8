"""Text to a scene of Braille frames."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from ..choices import EmphasisChoice, PageNumbering, Presentation, Undefined
from ..errors import EmptyText, LayoutError
from ..scene import GridShape, Scene
from . import louis_binding
from .alphabet import alphabet, own_letters_eight
from .dots import HIGHEST_6_DOT
from .layout import Layout
from .lines import with_lines
from .readers.sources import SourceKind, TextSource
from .report import ReportLog
from .tables import resolve_tables, table_dots
from .text_frames import TextFrames
from .text_options import WIDE, TextOptions
from .transcribe import Transcriber, paragraphs
from .undefined import writable

__all__ = ["TextScene", "encode_text"]

ROOM_FOR_SIGNS = 4
"""Cells of a run that has room for an indicator, what it governs and a hyphen."""


@dataclass(frozen=True, repr=False)
class TextScene(Scene):
    """A scene of Braille; `text_frames` are its frames with their report and check."""

    @property
    def text_frames(self) -> TextFrames:
        """The frames, with `report` and `check`."""
        assert isinstance(self.frames, TextFrames)
        return self.frames


def encode_text(source: TextSource | str, shape: GridShape, options: TextOptions) -> TextScene:
    """The scene that shows `source` on a grid.

    Frames are made while they are consumed, in memory that does not grow with the text. ``encoding`` holds
    what a reader of the dots needs: kind, tables, dots, cell_gap, line_gap, lines, cells_per_line, run,
    hyphen and continuation (see `encoders.braille.layout`), passages, presentation, undefined, liblouis (its version);
    emphases where emphasis is written, and page_numbers where they are shown.

    Raises
    ------
    EmptyText, InvalidText
        When the text has nothing to show, or is broken.
    TableMissing, LouisMissing
        When the table, or the Braille library, cannot be used.
    LayoutError
        When the grid has no room, an 8-dot table meets a grid with cells of three rows, a time is not > 0, or there
        is no such page, heading or word to begin at.
    UndefinedCharacter
        When the policy is `error` and a character cannot be written.
    """
    if isinstance(source, str):
        source = TextSource.of_text(source)
    for name, value in (("rate", options.rate), ("dwell", options.dwell_s)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise LayoutError(f"{name}: expected a number > 0, got {value}")
    if options.start_at is not None or options.pages is not None:
        # Imported here: a text that is shown as a whole does without.
        from .excerpt import excerpt

        def page_spans(part: TextSource) -> Iterator[tuple[int, int]]:
            return _frames_of(part, shape, options).page_spans()

        source = excerpt(source, options.start_at, options.pages, page_spans)
        # What is chosen is chosen: the frames' source and options give the same frames again.
        options = replace(options, start_at=None, pages=None)
    frames = _frames_of(source, shape, options)
    return TextScene(shape, frames, frames.encoding)


def _frames_of(source: TextSource, shape: GridShape, options: TextOptions) -> TextFrames:
    tables = resolve_tables(options.table)
    dots = _dots(source, tables, shape, options)
    layout = Layout(shape, 3 if dots == 6 else 4, options.cell_gap, options.line_gap)
    transcriber = Transcriber(tables, options.undefined, dots, passages=layout.run < layout.capacity)
    _refuse_unwritable(source, transcriber)
    corner = options.page_numbers is PageNumbering.CORNER
    if corner and layout.capacity < 2:
        raise LayoutError("page-numbers: a page of one cell has no room for a number; choose frame or none")
    status = corner and layout.cells_per_line < WIDE
    if source.kind is SourceKind.TEXT and layout.run - status * (not layout.lined) >= ROOM_FOR_SIGNS:
        layout = replace(layout, hyphen=transcriber.hyphen(), continuation=transcriber.continuation())
    source = with_lines(source, options.lines, layout)
    if _keeps_emphasis(options, layout) and source.document is not None:
        source = replace(source, emphases=source.document.emphases)
    encoding: dict[str, Any] = {
        "kind": source.kind.value,
        "tables": list(tables),
        "dots": dots,
        "cell_gap": options.cell_gap,
        "line_gap": options.line_gap,
        "lines": layout.lines,
        "cells_per_line": layout.cells_per_line,
        "run": layout.run,
        "hyphen": layout.hyphen,
        "continuation": layout.continuation,
        "passages": transcriber.passages,
        "presentation": (options.presentation or Presentation.TOGETHER).value,
        "undefined": options.undefined.value,
        "liblouis": louis_binding.liblouis_version(),
    }
    if options.page_numbers is not PageNumbering.NONE:
        encoding["page_numbers"] = options.page_numbers.value
    if source.emphases:
        encoding["emphases"] = [list(one) for one in source.emphases]
    return TextFrames(source, transcriber, layout, options, encoding)


def _keeps_emphasis(options: TextOptions, layout: Layout) -> bool:
    if options.emphasis is None:
        return layout.cells_per_line >= WIDE
    return options.emphasis is EmphasisChoice.KEEP


def _dots(source: TextSource, tables: tuple[str, ...], shape: GridShape, options: TextOptions) -> int:
    """6 or 8: what is asked for, else what the table or the cells of the source need and the grid can show."""
    if options.dots is not None:
        if options.dots not in (6, 8):
            raise LayoutError(f"dots: expected 6 or 8, got {options.dots}")
        return options.dots
    if source.kind is SourceKind.BRAILLE:
        eight, what = max(source.text) > HIGHEST_6_DOT, f"{source.name} holds 8-dot cells"
    else:
        stated = table_dots(tables)
        eight = stated == 8 or (not stated and own_letters_eight(source.text, tables))
        what = f"table {','.join(tables)} writes 8-dot cells"
    if not eight:
        return 6
    if (shape.rows + options.line_gap) % (4 + options.line_gap):
        raise LayoutError(
            f"{what} and a grid of {shape.rows} x {shape.cols} has cells of three rows; choose a 6-dot table, "
            "or give --dots 6 (dots 7 and 8 are left out)"
        )
    return 8


def _refuse_unwritable(source: TextSource, transcriber: Transcriber) -> None:
    """Look at the characters once before the first frame, so that a text that cannot be shown fails at once."""
    letters = alphabet(transcriber.tables)
    if source.kind is SourceKind.BRAILLE or not letters.lacks(source.text):
        return
    if transcriber.undefined is Undefined.ERROR:
        for start, end in paragraphs(source.text):
            for _ in transcriber.words(source, start, end, ReportLog()):
                pass
    different = "".join(sorted(set(source.text)))
    if not writable(different, 0, letters, transcriber.undefined, ReportLog()).text.strip():
        raise EmptyText(
            f"{source.name}: the table {','.join(transcriber.tables)} can write none of its characters; "
            "choose another table, or --undefined name"
        )
