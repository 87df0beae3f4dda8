"""Two judges of patterns that know nothing of the encoder: retrieval by correlation, and a classifier of gradients."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recognition_sets import Drawn, content, laid

__all__ = ["JUDGES", "RETRIEVAL", "Gallery"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SIDE = 24
BLUR = 0.5
STRETCHES = (1 / 1.1, 1.0, 1.1)
SHIFTS = (-2.0, 0.0, 2.0)
TRAINED = 24
RETRIEVAL = ("as placed", "aligned")
JUDGES = (*RETRIEVAL, "classifier")


class Gallery:
    """The originals of a draw, at 24 points on the grid's shorter side, beside which patterns are laid.

    An original is its ink, contained by the grid and in the middle. A pattern is drawn with square dots. Both are
    blurred by a Gaussian of half an actuator. It is found when its own original is the one most like it.
    """

    def __init__(self, icons: Sequence[Drawn], shape: tuple[int, int]) -> None:
        least = min(shape)
        self.shape = shape
        self.size = round(SIDE * shape[0] / least), round(SIDE * shape[1] / least)
        self._inks = [(icon.ink, content(icon.ink)) for icon in icons]
        sizes = tuple(zip(self.size, shape, strict=True))
        self._draw = tuple(_drawing(size, count) for size, count in sizes)
        self._blur = tuple(_gauss(size, BLUR * size / count) for size, count in sizes)
        self._classifier: Any = None

    def found(self, judge: str, patterns: Bools) -> Bools:
        """Whether each pattern, bool, shape (N, rows, cols), is taken for its own icon."""
        seen = self._draw[0] @ patterns.astype(np.float64) @ self._draw[1].T
        if judge == "classifier":
            return self._classified(seen)
        points = _unit(seen)
        if judge == "as placed":
            likeness = points @ _unit(self._variant((1.0, 1.0), (0.0, 0.0))).T
        else:
            likeness = np.full((len(points), len(points)), -np.inf, np.float32)
            for stretch, shift in self._ways():
                np.maximum(likeness, np.abs(points @ _unit(self._variant(stretch, shift)).T), out=likeness)
        own = np.diagonal(likeness)
        # An icon that is equal to another cannot be told from it by anyone.
        return np.asarray(own >= likeness.max(axis=1) - 1e-6)

    @staticmethod
    def _ways() -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
        yield from product(product(STRETCHES, repeat=2), product(SHIFTS, repeat=2))

    def _variant(self, stretch: tuple[float, float], shift: tuple[float, float]) -> Floats:
        sharp = np.stack([laid(ink, box, self.size, stretch, shift) for ink, box in self._inks])
        return np.asarray(self._blur[0] @ sharp @ self._blur[1].T)

    def _classified(self, seen: Floats) -> Bools:
        """Linear discriminants of histograms of gradients, trained on moved and stretched originals."""
        from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

        if self._classifier is None:
            rng = np.random.default_rng(len(self._inks))
            ways = list(self._ways())
            chosen = [ways[i] for i in sorted(rng.choice(len(ways), TRAINED, replace=False))]
            blurred = [self._variant(*way) for way in [((1.0, 1.0), (0.0, 0.0)), *chosen]]
            features = np.concatenate([_gradients(one) for one in blurred])
            labels = np.tile(np.arange(len(self._inks)), len(blurred))
            self._classifier = LinearDiscriminantAnalysis(solver="lsqr", shrinkage=0.1).fit(features, labels)
        said = self._classifier.predict(_gradients(seen))
        return np.asarray(said == np.arange(len(seen)))


def _gradients(pictures: Floats) -> NDArray[np.float32]:
    from skimage.feature import hog

    found = [hog(one, orientations=8, pixels_per_cell=(4, 4), cells_per_block=(2, 2)) for one in pictures]
    return np.asarray(found, np.float32)


def _unit(pictures: Floats) -> NDArray[np.float32]:
    """Each picture less its mean, of length 1; float32, shape (N, points)."""
    flat = pictures.reshape(len(pictures), -1)
    flat = flat - flat.mean(axis=1, keepdims=True)
    return np.asarray(flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-9), np.float32)


def _drawing(points: int, dots: int) -> Floats:
    """How much of each dot is in each point, blurred; float64, shape (points, dots)."""
    places = np.arange(points + 1)[:, None] * dots / points
    shares = np.diff(np.clip(places - np.arange(dots), 0, 1), axis=0)
    drawn: Floats = _gauss(points, BLUR * points / dots) @ shares * points / dots
    return drawn


def _gauss(points: int, sigma: float) -> Floats:
    apart = np.arange(points)[:, None] - np.arange(points)
    weights: Floats = np.exp(-((apart / sigma) ** 2) / 2)
    return weights
