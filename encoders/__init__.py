"""What should be felt: text and images to scenes."""

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
from .tables import TableInfo, list_tables, resolve_tables
from .text import TextFrames, TextOptions, TextScene, encode_text
from .textures import Region, TextureError, bars, levels, plane_wave, regions, walking_bars
from .transcribe import Translation, translate
from .undefined import Undefined

__all__ = [
    "BackCheck",
    "Difference",
    "EmptyText",
    "EncodeError",
    "EncodingReport",
    "Frame",
    "GridShape",
    "InvalidText",
    "LayoutError",
    "LouisMissing",
    "PatternKind",
    "Presentation",
    "Region",
    "Scene",
    "SourceKind",
    "Split",
    "TableInfo",
    "TableMissing",
    "TargetPattern",
    "TextFrames",
    "TextOptions",
    "TextScene",
    "TextSource",
    "TextureError",
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
    "covered_text",
    "encode_text",
    "join_pages",
    "levels",
    "liblouis_place",
    "liblouis_version",
    "list_tables",
    "plane_wave",
    "read_cells",
    "regions",
    "resolve_tables",
    "translate",
    "walking_bars",
]
