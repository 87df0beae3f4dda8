"""Rounding to the steps of a converter with the error pushed up in frequency, away from what resonates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Shaper"]

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]

# Samples are held to 2^-FRACTION of a step before they are summed up, as whole numbers: sums are then exact, and do not
# depend on how the samples are cut.
FRACTION = 20


class Shaper:
    """Rounds the samples of some channels, block after block, by second-order error feedback.

    With x the samples and e rounding errors of up to half a step, ``y[k] = x[k] + e[k] - 2 e[k-1] + e[k-2]``: the noise
    has the spectrum of plain rounding times ``|2 sin(omega dtau / 2)|^4``, 10^-4 at 60 samples a period. No y is
    further than 2 steps from its x. A channel that is silent for a whole block stays so.

    Parameters
    ----------
    channels : how many.
    """

    def __init__(self, channels: int) -> None:
        # The last two errors of every channel, the latest first, in 2^-FRACTION of a step.
        self._errors: Whole = np.zeros((channels, 2), dtype=np.int64)

    def round(self, samples: Floats) -> Floats:
        """Whole numbers near `samples`.

        Parameters
        ----------
        samples : float64, shape (channels, S), in units of a step, |samples| < 2^31.

        Returns
        -------
        float64, shape (channels, S).
        """
        count = samples.shape[1]
        silent = ~np.any(samples, axis=1)
        self._errors[silent] = 0
        if not count or silent.all():
            return np.zeros_like(samples)
        latest, before = self._errors.T
        whole = np.rint(np.ldexp(samples, FRACTION)).astype(np.int64)
        whole[:, 0] += before - 2 * latest
        if count > 1:
            whole[:, 1] += latest
        summed = np.cumsum(np.cumsum(whole, axis=1), axis=1)
        steps = (summed + (1 << FRACTION - 1)) >> FRACTION
        errors = (steps << FRACTION) - summed
        self._errors = np.stack([errors[:, -1], errors[:, -2] if count > 1 else latest], axis=1)
        first = np.diff(steps, axis=1, prepend=0)
        return np.asarray(np.diff(first, axis=1, prepend=0), dtype=np.float64)
