"""What should be felt: text and images to scenes."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .backcheck import BackCheck, Difference, back_check, back_translate, covered_text
from .brf import brf_to_cells, cells_to_brf
from .dots import bits_to_cell, cell_to_bits
from .errors import (
    EmptyText,
    EncodeError,
    InvalidText,
    LayoutError,
    LouisMissing,
    TableMissing,
    UndefinedCharacter,
    UnsupportedSource,
)
from .layout import join_pages
from .louis_binding import place as liblouis_place
from .louis_binding import version as liblouis_version
from .presentation import Presentation, read_cells
from .report import EncodingReport, Split, UndefinedUse
from .scene import Frame, GridShape, PatternKind, Scene, TargetPattern, WalkingBars
from .sources import SourceKind, TextSource
from .tables import TableInfo, foreign_tables, list_tables, resolve_tables
from .text import TextFrames, TextOptions, TextScene, encode_text
from .textures import Region, TextureError, bars, levels, plane_wave, regions, walking_bars
from .transcribe import Translation, translate
from .undefined import Undefined

if TYPE_CHECKING:
    from .distinct import APART, Choice, Distinctness, choose_distinct, distinctness, felt_codes, weakened
    from .picture_errors import PictureError
    from .picture_figure import Step
    from .picture_options import Fit, Invert, Output, PictureOptions, RegionsBy, Style, Threshold
    from .picture_reading import PictureLimits
    from .picture_similarity import similarities
    from .pictures import PictureReport, PictureScene, encode_picture, explain_picture

__all__ = [
    "APART",
    "BackCheck",
    "Choice",
    "Difference",
    "Distinctness",
    "EmptyText",
    "EncodeError",
    "EncodingReport",
    "Fit",
    "Frame",
    "GridShape",
    "InvalidText",
    "Invert",
    "LayoutError",
    "LouisMissing",
    "Output",
    "PatternKind",
    "PictureError",
    "PictureLimits",
    "PictureOptions",
    "PictureReport",
    "PictureScene",
    "Presentation",
    "Region",
    "RegionsBy",
    "Scene",
    "SourceKind",
    "Split",
    "Step",
    "Style",
    "TableInfo",
    "TableMissing",
    "TargetPattern",
    "TextFrames",
    "TextOptions",
    "TextScene",
    "TextSource",
    "TextureError",
    "Threshold",
    "Translation",
    "Undefined",
    "UndefinedCharacter",
    "UndefinedUse",
    "UnsupportedSource",
    "WalkingBars",
    "back_check",
    "back_translate",
    "bars",
    "bits_to_cell",
    "brf_to_cells",
    "cell_to_bits",
    "cells_to_brf",
    "choose_distinct",
    "covered_text",
    "distinctness",
    "encode_picture",
    "encode_text",
    "explain_picture",
    "felt_codes",
    "foreign_tables",
    "join_pages",
    "levels",
    "liblouis_place",
    "liblouis_version",
    "list_tables",
    "plane_wave",
    "read_cells",
    "regions",
    "resolve_tables",
    "similarities",
    "translate",
    "walking_bars",
    "weakened",
]

# Pictures: text does not wait for them.
_LATE = {
    "APART": "distinct",
    "Choice": "distinct",
    "Distinctness": "distinct",
    "Fit": "picture_options",
    "Invert": "picture_options",
    "Output": "picture_options",
    "PictureError": "picture_errors",
    "PictureLimits": "picture_reading",
    "PictureOptions": "picture_options",
    "PictureReport": "pictures",
    "PictureScene": "pictures",
    "RegionsBy": "picture_options",
    "Step": "picture_figure",
    "Style": "picture_options",
    "Threshold": "picture_options",
    "choose_distinct": "distinct",
    "distinctness": "distinct",
    "encode_picture": "pictures",
    "explain_picture": "pictures",
    "felt_codes": "distinct",
    "similarities": "picture_similarity",
    "weakened": "distinct",
}


def __getattr__(name: str) -> object:
    if name in _LATE:
        return getattr(import_module(f".{_LATE[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
