"""Samples of one channel as few cubic pieces on known carriers: what a controller draws by itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .envelope import LONGEST_PIECE
from .measured import WHOLE_TURN

__all__ = ["NoPiece", "Piece", "pieces_of"]

Floats = NDArray[np.float64]

FEWEST = 12  # samples; of fewer a carrier and its slope are not told apart
RCOND = 1e-11
FEW = 128


class NoPiece(Exception):
    """No cubics on these carriers pass the samples from `at` on."""

    def __init__(self, at: int) -> None:
        self.at = at


@dataclass(frozen=True)
class Piece:
    """One stretch of samples.

    Attributes
    ----------
    at, samples : where, and how long.
    points : for each carrier its Bezier points (one: it stands there), volts.
    """

    at: int
    samples: int
    points: tuple[tuple[complex, ...], ...]


def pieces_of(volts: Floats, first: int, carriers: tuple[int, ...], tol: float, most: float) -> Iterator[Piece]:
    """Cut the samples into pieces as long as may be.

    Parameters
    ----------
    volts : float64, shape (S,), from sample `first` of the session on.
    carriers : turns / 2^64 from a sample to the next; 0 stands still.
    tol : volts by which a piece may miss a sample.
    most : volts that no point may exceed.

    Raises
    ------
    NoPiece
        When no short piece fits either.
    """
    if not len(volts):
        return
    piece = _standing(volts, first, carriers, tol, most) or _bent(volts, first, carriers, tol, most)
    if piece is not None:
        yield piece
    elif len(volts) < 2 * FEWEST:
        raise NoPiece(first)
    else:
        half = len(volts) // 2
        yield from pieces_of(volts[:half], first, carriers, tol, most)
        yield from pieces_of(volts[half:], first + half, carriers, tol, most)


def _standing(volts: Floats, first: int, carriers: tuple[int, ...], tol: float, most: float) -> Piece | None:
    """A piece that stands; silence where there are no carriers."""
    if not carriers:
        return Piece(first, len(volts), ()) if np.abs(volts).max() <= tol else None
    found = _fitted(_waves(first, len(volts), carriers), volts, tol)
    return None if found is None else _piece(found, first, len(volts), 1, carriers, most)


def _bent(volts: Floats, first: int, carriers: tuple[int, ...], tol: float, most: float) -> Piece | None:
    if not carriers or len(volts) > LONGEST_PIECE:
        return None
    waves = _waves(first, len(volts), carriers)
    basis = (_bernstein(len(volts))[:, :, None] * waves[:, None, :]).reshape(len(volts), -1)
    found = _fitted(basis, volts, tol)
    return None if found is None else _piece(found, first, len(volts), 4, carriers, most)


def _piece(
    found: Floats, first: int, samples: int, points: int, carriers: tuple[int, ...], most: float
) -> Piece | None:
    columns, each = iter(found.reshape(points, -1).T), []
    for turns in carriers:
        real = next(columns)
        each.append(tuple((real + 1j * next(columns) if turns else real + 0j).tolist()))
    return Piece(first, samples, tuple(each)) if max(abs(p) for one in each for p in one) <= most else None


def _fitted(basis: Floats, volts: Floats, tol: float) -> Floats | None:
    """The nearest in the mean square, which misses in both directions alike: what is left of it is fast."""
    # What does not fit some of the samples does not fit all.
    if len(volts) >= 2 * FEW and _nearest(basis[:: len(volts) // FEW], volts[:: len(volts) // FEW], tol) is None:
        return None
    return _nearest(basis, volts, tol)


def _nearest(basis: Floats, volts: Floats, tol: float) -> Floats | None:
    found = np.asarray(np.linalg.lstsq(basis, volts, rcond=RCOND)[0], dtype=np.float64)
    return found if np.abs(basis @ found - volts).max() <= tol else None


def _waves(first: int, samples: int, carriers: tuple[int, ...]) -> Floats:
    """cos and -sin of every carrier, one column of ones where it stands still; float64, shape (S, columns)."""
    index = np.arange(first, first + samples).astype(np.uint64)
    columns: list[Floats] = []
    for turns in carriers:
        phase = (index * np.uint64(turns)).astype(np.float64) * (2 * np.pi / WHOLE_TURN)
        columns += [np.cos(phase), -np.sin(phase)] if turns else [np.ones(samples)]
    return np.stack(columns, axis=1)


@lru_cache(maxsize=256)
def _bernstein(samples: int) -> Floats:
    """The cubic Bernstein polynomials at samples of a piece; float64, shape (S, 4)."""
    s = np.arange(samples) / samples
    basis: Floats = np.stack([(1 - s) ** 3, 3 * s * (1 - s) ** 2, 3 * s**2 * (1 - s), s**3], axis=1)
    return basis
