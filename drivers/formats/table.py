"""The file formats, one entry each: what a name's ending stands for. A new format is an entry and its module.

Light to import, so that a command line can list them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

__all__ = ["EXCHANGE_SUFFIXES", "FORMATS", "PACK_SUFFIX", "SUFFIXES", "Format", "check_suffix", "format_of"]


@dataclass(frozen=True)
class Format:
    """What is known of a format without importing its module.

    That which reads packs has ``read_packed(path, name)``, the manifest and `SampleReader` of an entry. A module of
    samples has ``open_writer(file, channels, rate_hz, encoding)``, which gives a `SampleWriter`, and
    ``open_reader(path, channels, rate_hz)``, which gives a `SampleReader`. One of a haptic file, which carries no
    samples and has no manifest beside it, has ``content_of(plan, actuator)``, the content as plain JSON types, and
    ``curves_of(content)``, the `HapticCurves` of a content that keeps the rules of the format.

    Attributes
    ----------
    words : what it is for and what it loses.
    writer, reader : modules of this package, imported only for such a file.
    sample_bytes : number format -> bytes of a sample, the fewest and the most; empty where there are no samples.
    """

    words: str
    writer: str
    reader: str
    sample_bytes: Mapping[str, tuple[int, int]] = field(default_factory=dict)

    def writer_module(self) -> Any:
        """The module that writes it."""
        return import_module(self.writer, __package__)

    def reader_module(self) -> Any:
        """The module that reads it."""
        return import_module(self.reader, __package__)


FORMATS: Mapping[str, Format] = {
    ".wav": Format(
        "for amplifiers; float32 keeps 24 significant bits, PCM24 half a step of the full scale over 2^23",
        ".wav", ".wav_reader", {"float32": (4, 4), "pcm24": (3, 3)},
    ),
    ".npz": Format("exact float64 volts, for numpy", ".npz", ".npz", {"float32": (8, 8)}),
    # A zero takes 2 characters and most other numbers 14.
    ".csv": Format(
        "volts with 9 significant digits and a time column, for people", ".csv", ".csv", {"float32": (2, 14)}
    ),
    ".raw": Format(
        "float32 of full scale, little-endian, channels interleaved, no header", ".raw", ".raw", {"float32": (4, 4)}
    ),
    ".dwp": Format("a pack: events in place of samples, no manifest", "..packs.writer", "..packs.opened"),
    ".hjif": Format("levels, times and phases of the whole grid", "..exchange.hjif", "..exchange.hjif"),
    ".ahap": Format("levels and times of one actuator, or the mean", "..exchange.ahap", "..exchange.ahap"),
    ".haptic": Format("levels and times of one actuator, or the mean", "..exchange.haptic", "..exchange.haptic"),
}  # fmt: skip
"""Ending of a name -> its format: those of samples, then packs and haptic files."""

SUFFIXES = tuple(suffix for suffix, form in FORMATS.items() if form.sample_bytes)
"""Endings of samples."""

PACK_SUFFIX = ".dwp"
"""Ending of packs (docs/pack.md)."""

EXCHANGE_SUFFIXES = tuple(suffix for suffix, form in FORMATS.items() if not form.sample_bytes and suffix != PACK_SUFFIX)
"""Endings of haptic files."""


def check_suffix(path: Path, accepted: tuple[str, ...] = tuple(FORMATS)) -> str:
    """The ending of `path`, if it stands for a format.

    Raises
    ------
    FileError
        When it is not one of those accepted (the message lists them), or the name cannot stand in a manifest.
    """
    from ..errors import FileError

    suffix = path.suffix.lower()
    try:
        path.name.encode()
    except UnicodeEncodeError:
        raise FileError(f"{path}: its name is not UTF-8 and cannot stand in a manifest; give another") from None
    if suffix not in accepted:
        raise FileError(f"{path}: expected a name that ends in {', '.join(accepted)}")
    return suffix


def format_of(path: Path, accepted: tuple[str, ...] = tuple(FORMATS)) -> Format:
    """The format that the ending of `path` stands for; raises as `check_suffix` does."""
    return FORMATS[check_suffix(path, accepted)]
