"""What one channel does on one carrier in a frame: few cubic pieces in the place of samples."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from ..protocol.envelope import LONGEST_PIECE
from .layout import PackView, curve_type, links_type

__all__ = ["CURVE_HEAD", "Curve", "LinkCurve", "TooLarge", "cubics_of"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Whole = NDArray[np.int64]

CURVE_HEAD = struct.Struct("<QI")
FEWEST = 5  # samples; fewer are no cubic with something to tell it by
FEW = 48


class TooLarge(Exception):
    """At sample `at` of a curve more is wanted than full volts."""

    def __init__(self, at: int, volts: float) -> None:
        self.at, self.volts = at, volts


@dataclass(frozen=True)
class Curve:
    """Pieces one after the other; what stands between and after them is the last point.

    Attributes
    ----------
    turns : of the carrier from a sample to the next, in turns / 2^64; 0 stands still.
    at, ramp : int64, shape (K,), samples from the start of the frame; where a piece begins, how long it is. A ramp of
        0 stands.
    points : complex128, shape (K, 4), volts; Bezier points, four times the same where it stands.
    """

    turns: int
    at: Whole
    ramp: Whole
    points: Complexes

    @classmethod
    def of(cls, turns: int, pieces: Sequence[tuple[int, int, Sequence[complex]]]) -> Curve:
        """From (at, ramp, four points) each."""
        at, ramp = (np.array([piece[k] for piece in pieces], dtype=np.int64) for k in (0, 1))
        # As the file has them.
        points = np.array([piece[2] for piece in pieces]).astype(np.complex64).astype(np.complex128)
        return cls(turns, at, ramp, points)

    def packed(self) -> bytes:
        """As bytes."""
        pieces = np.zeros(len(self.at), curve_type(self.turns))
        pieces["at"], pieces["ramp"] = self.at, self.ramp
        pieces["points"][:, :, 0] = self.points.real
        if self.turns:
            pieces["points"][:, :, 1] = self.points.imag
        return CURVE_HEAD.pack(self.turns, len(pieces)) + pieces.tobytes()

    @classmethod
    def read(cls, view: PackView, at: int, full_volts: float) -> Curve:
        """From a file.

        Raises
        ------
        UnreadableWaveform
            When it is not there, or its pieces are none of this kind, over `full_volts` or not in order.
        """
        turns, count = view.unpack(CURVE_HEAD, at)
        pieces = view.array(curve_type(turns), count, at + CURVE_HEAD.size)
        with np.errstate(invalid="ignore"):  # what is no number is refused below
            parts = pieces["points"].astype(np.float64)
            points = (parts[:, :, 0] + (1j * parts[:, :, 1] if turns else 0j)).astype(np.complex128)
            within = np.all(np.abs(points) <= full_volts)
        found = cls(turns, pieces["at"].astype(np.int64), pieces["ramp"].astype(np.int64), points)
        ordered = count and found.at[0] == 0 and np.all(np.diff(found.at) > 0)
        if not (within and ordered and np.all(found.ramp <= LONGEST_PIECE)):
            view.damaged(at)
        return found

    @cached_property
    def last(self) -> complex:
        """What stands in the end, volts."""
        return complex(self.points[-1, 3])

    @cached_property
    def length(self) -> int:
        """Samples until it stands."""
        return int(self.at[-1] + self.ramp[-1])

    @property
    def stands(self) -> bool:
        """Whether it is one point from the start on."""
        return len(self.at) == 1 and not self.ramp[0]

    def cut(self, samples: int) -> Curve:
        """What begins before so many samples have passed; what began goes on."""
        if self.at[-1] < samples:
            return self
        kept = self.at < samples
        return Curve(self.turns, self.at[kept], self.ramp[kept], self.points[kept])

    def values(self, index: Whole) -> Complexes:
        """E at samples `index` from its start, none below 0; complex128, shape (S,), volts."""
        k = np.searchsorted(self.at, index, side="right") - 1
        ramp = self.ramp[k]
        s = np.where(ramp == 0, 1.0, np.minimum((index - self.at[k]) / np.maximum(ramp, 1), 1.0))
        a, b, c, d = self.points[k].T
        rest = 1 - s
        bent: Complexes = a * rest**3 + 3 * b * s * rest**2 + 3 * c * s**2 * rest + d * s**3
        return bent


@dataclass(frozen=True)
class LinkCurve:
    """What the links of a row do in a frame: straight to `lam` over `ramp` samples, from `at` on.

    at, ramp : int64, shape (K,). lam : float64, shape (K, cols - 1).
    """

    at: Whole
    ramp: Whole
    lam: NDArray[np.float64]

    def packed(self) -> bytes:
        """As bytes."""
        pieces = np.zeros(len(self.at), links_type(self.lam.shape[1]))
        pieces["at"], pieces["ramp"], pieces["lam"] = self.at, self.ramp, self.lam
        return CURVE_HEAD.pack(0, len(pieces)) + pieces.tobytes()

    @classmethod
    def read(cls, view: PackView, at: int, links: int, lam_max: float) -> LinkCurve:
        """From a file; raises as `Curve.read`."""
        _, count = view.unpack(CURVE_HEAD, at)
        pieces = view.array(links_type(links), count, at + CURVE_HEAD.size)
        with np.errstate(invalid="ignore"):
            lam = pieces["lam"].astype(np.float64)
            within = np.all((lam >= 0) & (lam <= lam_max * (1 + 1e-6)))
        found = cls(pieces["at"].astype(np.int64), pieces["ramp"].astype(np.int64), lam)
        if not (within and np.all(np.diff(found.at) >= 0)):
            view.damaged(at)
        return found


def cubics_of(
    values: Complexes, tol: float, most: float, first: int = 0
) -> Iterator[tuple[int, int, tuple[complex, ...]]]:
    """Cut a course of E into pieces, each as long as halving finds.

    Parameters
    ----------
    values : complex128, shape (S,), volts, a sample each, from sample `first` on.
    tol : volts by which a piece may miss a sample.
    most : volts that no point may exceed.

    Yields
    ------
    (at, ramp, four points); a ramp of 0 stands.

    Raises
    ------
    TooLarge
        At a sample that is over `most`.
    """
    count = len(values)
    if not count:
        return
    points = _standing(values, tol)
    ramp = 0
    if points is None and FEWEST <= count <= LONGEST_PIECE:
        points, ramp = _bent(values, tol), count
    if points is not None and np.abs(points).max() <= most:
        yield first, ramp, tuple(points.tolist())
    elif count == 1:
        raise TooLarge(first, float(abs(values[0])))
    else:
        half = count // 2
        yield from cubics_of(values[:half], tol, most, first)
        yield from cubics_of(values[half:], tol, most, first + half)


def _standing(values: Complexes, tol: float) -> Complexes | None:
    middle = values.mean()
    return np.full(4, middle) if np.abs(values - middle).max() <= tol else None


def _bent(values: Complexes, tol: float) -> Complexes | None:
    # What does not fit some of the samples does not fit all.
    few = values[:: len(values) // FEW] if len(values) >= 2 * FEW else values
    for some in (few, values):
        basis, inverse = _bernstein(len(some))
        points: Complexes = inverse @ some
        if np.abs(basis @ points - some).max() > tol:
            return None
    return points


@lru_cache(maxsize=256)
def _bernstein(samples: int) -> tuple[Floats, Floats]:
    """The cubic Bernstein polynomials at samples of a piece, float64, shape (S, 4), and their pseudo-inverse."""
    s = np.arange(samples) / samples
    basis: Floats = np.stack([(1 - s) ** 3, 3 * s * (1 - s) ** 2, 3 * s**2 * (1 - s), s**3], axis=1)
    return basis, np.asarray(np.linalg.pinv(basis), dtype=np.float64)
