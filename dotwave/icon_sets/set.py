"""The icons of a set with what came of them, and the choice of patterns that are not alike."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from encoders import (
    APART,
    Choice,
    GridShape,
    TargetPattern,
    choose_distinct,
    distinctness,
    felt_codes,
    margins,
    similarities,
    weakened,
)

__all__ = ["Icon", "Pattern", "best_pattern", "chosen_patterns", "felt_set", "figure_of"]

Floats = NDArray[np.float64]
Record = Mapping[str, Any]

# Amplitudes of what `encoders.felt_codes` calls 0, 1 and 3 (-6 dB).
AMPLITUDES = np.array([0.0, 1.0, 0.0, 0.5])
MOST_TEXTURED = 32


@dataclass(frozen=True)
class Pattern:
    """A pattern of an icon.

    Attributes
    ----------
    amplitude : float64, shape (rows, cols), read-only, in units of full scale.
    similarity : with its figure.
    """

    amplitude: Floats
    similarity: float


@dataclass(frozen=True)
class Icon:
    """An icon that was encoded.

    Attributes
    ----------
    name : unique in the set.
    digest : "sha256:" and the hash of the picture.
    kind : its format.
    pattern : what is felt.
    lost : similarity given up so that it differs from the others.
    figure : uint8, shape (4 rows, 4 cols), 255 = figure: what the pattern should be like.
    outcome, error, note : of the plan; "not_planned" when it was not reached.
    notes : of the reading.
    doubt : why its pattern may not be known, in one sentence; empty where nothing speaks against it.
    waveform : the .wav below the output folder, empty when there is none.
    nearest, distance : the icon that feels most alike, and by how many actuators it differs; empty and None
        in a set of one.
    same_as : the first icon of the set with the same file, empty where it is itself the first.
    label, code_point, category : what the icon font's package says of it, empty where it says nothing.
    """

    name: str
    digest: str
    kind: str
    pattern: Pattern
    lost: float
    figure: NDArray[np.uint8]
    outcome: str = "not_planned"
    error: float | None = None
    note: str = ""
    notes: tuple[str, ...] = ()
    doubt: str = ""
    waveform: str = ""
    nearest: str = ""
    distance: int | None = None
    same_as: str = ""
    label: str = ""
    code_point: str = ""
    category: str = ""


def figure_of(record: Record, shape: GridShape) -> NDArray[np.uint8]:
    """The figure of a record of `icon_work.encode_icons`; uint8, shape (4 rows, 4 cols), 255 = figure."""
    raw = np.frombuffer(base64.b64decode(record["figure"]), np.uint8)
    return raw.reshape(4 * shape.rows, 4 * shape.cols)


def best_pattern(record: Record, shape: GridShape) -> Pattern:
    """The most similar pattern of a record."""
    return _pattern(_choice(record, shape, 1), 0, shape)


def _choice(record: Record, shape: GridShape, most: int | None = None) -> Choice:
    similarity = np.array(record["similarity"][:most])
    raw = np.frombuffer(base64.b64decode(record["options"]), np.uint8).reshape(len(record["similarity"]), -1)
    return Choice(np.unpackbits(raw[:most], axis=1, count=shape.rows * shape.cols), similarity)


def _pattern(choice: Choice, index: int, shape: GridShape) -> Pattern:
    amplitude = AMPLITUDES[choice.codes[index]].reshape(shape.rows, shape.cols)
    amplitude.flags.writeable = False
    return Pattern(amplitude, float(choice.similarity[index]))


def chosen_patterns(
    records: Mapping[str, Record], shape: GridShape, more: Callable[[Sequence[str]], Mapping[str, Record]]
) -> dict[str, Pattern]:
    """One pattern for each icon, no two nearer than `encoders.APART` where that can be.

    Of patterns that are as far apart those are taken that say what is peculiar to an icon (`encoders.margins`).
    First among the patterns of the records; icons that still have a neighbour get more patterns, and if that does
    not help either, textured ones (some or all dots 6 dB weaker).

    Parameters
    ----------
    more : records of the named icons with more patterns.
    """
    names = sorted(records)
    choices = {name: _choice(records[name], shape) for name in names}
    figures = np.stack([figure_of(records[name], shape) for name in names]) / 255.0 if names else np.empty(0)

    def choose() -> tuple[dict[str, int], list[str]]:
        some = [choices[name] for name in names]
        patterns = [AMPLITUDES[one.codes].reshape(-1, shape.rows, shape.cols) for one in some]
        worth = margins(figures, patterns, [one.similarity for one in some])
        picked = choose_distinct([replace(one, similarity=value) for one, value in zip(some, worth, strict=True)])
        codes = np.stack([choices[name].codes[index] for name, index in zip(names, picked, strict=True)])
        close = {place for pair in distinctness(codes, APART).close for place in pair[:2]}
        return dict(zip(names, picked.tolist(), strict=True)), [names[place] for place in sorted(close)]

    if not names:
        return {}
    picked, close = choose()
    if close:
        choices.update((name, _choice(record, shape)) for name, record in more(close).items())
        picked, close = choose()
    if close:
        choices.update((name, _textured(choices[name], records[name], shape)) for name in close)
        picked, close = choose()
    return {name: _pattern(choices[name], index, shape) for name, index in picked.items()}


def _textured(choice: Choice, record: Record, shape: GridShape) -> Choice:
    """The same patterns, and after them textured ones with their similarity."""
    dots = choice.codes[:MOST_TEXTURED].astype(np.bool_).reshape(-1, shape.rows, shape.cols)
    amplitudes = np.concatenate([weakened(one) for one in dots])
    scores = np.round(similarities(figure_of(record, shape) / 255.0, amplitudes), 6)
    codes = np.where(amplitudes == 0.5, 3, amplitudes).astype(np.uint8).reshape(len(amplitudes), -1)
    found = {code.tobytes(): float(score) for code, score in zip(choice.codes, choice.similarity, strict=True)}
    for code, score in zip(codes, scores, strict=True):
        found.setdefault(code.tobytes(), float(score))
    keys = np.frombuffer(b"".join(found), np.uint8).reshape(len(found), -1)
    return Choice(keys, np.array(list(found.values())))


def felt_set(icons: Sequence[Icon]) -> NDArray[np.uint8]:
    """What the icons feel like, uint8, shape (N, dots), for `encoders.distinctness`."""
    patterns = (TargetPattern(icon.pattern.amplitude.astype(np.complex128)) for icon in icons)
    return np.stack([felt_codes(pattern) for pattern in patterns])
