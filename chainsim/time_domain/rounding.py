"""How far rounding keeps a motion from its orbit: the error of every step, magnified by all that follows.

Fed forward, a disturbance near its own frequency grows by about lam/delta from one oscillator to the next, whatever the
drive does. The rounding of the first steps is such a disturbance, and never ends: n oscillators down it is larger by
(lam/delta)^(n-1), which may be more than the motion there. No motion comes nearer to its orbit than this.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..equations.scaled_chain import ScaledChain

__all__ = ["rounding_floor"]

Floats = NDArray[np.float64]
Lanes = NDArray[np.int64]

# Of a step's roundings, in eps of the oscillator's size: four standard deviations of sixteen of them.
_EACH = 16 * float(np.finfo(np.float64).eps)
_MOST_LINES = 16


def rounding_floor(scaled: ScaledChain, lanes: Lanes, size: Floats, steps: int) -> Floats:
    """How far from their orbits the roundings of every step keep the oscillators of settings `lanes`.

    Parameters
    ----------
    scaled : fed forward.
    size : float64, shape (L, n), how large the motions are.
    steps : per period.

    Returns
    -------
    float64, shape (L, n); infinite where the gain is beyond any number, as without damping.
    """
    delta, period, count = scaled.of_each(scaled.delta), scaled.network.period[lanes], scaled.n
    with np.errstate(all="ignore"):
        # A strong motion has its own frequency, and a disturbance of it another.
        stiffness = scaled.k[:, lanes].T + 1.5 * scaled.of_each(scaled.sign) * size**2
        picked = np.linspace(0, count - 1, min(count, _MOST_LINES)).round().astype(np.int64)
        square = np.sort(np.maximum(stiffness, 0.0), axis=1)[:, picked]
        lines: list[Floats] = []
        for m in range(count):
            answer = 1 / np.hypot(stiffness[:, m, None] - square, delta[m] * np.sqrt(square))
            # The last 1/(delta T) periods are remembered; their roundings add up like a random walk.
            own = _EACH * size[:, m] * np.sqrt(steps * (1 + 1 / (delta[m] * period)))
            force = (own * delta[m])[:, None] * np.sqrt(square)
            for source, link in scaled.inputs(m):
                force = force + np.abs(link[lanes])[:, None] * lines[source]
            lines.append(answer * force)
        floor: Floats = np.stack([line.max(axis=1) for line in lines], axis=1)
    return np.where(np.isnan(floor), np.inf, floor)
