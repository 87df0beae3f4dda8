"""What is felt of a motion that never settles: its loudest, how deep it beats, and how often."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["DEPTH_OFF", "Beats", "beats_of", "beats_off"]

Floats = NDArray[np.float64]

# What a depth and, of it, a period may be off.
DEPTH_OFF, PERIOD_OFF = 0.1, 0.15
# Percentiles that stand for the softest and the loudest; finer steps of the spectrum than its own; fewest beats in it.
SOFT, LOUD, FINER, FEWEST = 5.0, 95.0, 8, 2.5


class Beats(NamedTuple):
    """Statistics of an envelope over a window.

    Attributes
    ----------
    loud : float64, shape (..., n), the 95th percentile of each actuator's amplitude.
    depth : of the beats, (loud - soft) / (loud + soft), the mean of all actuators; soft is the 5th percentile.
    period_s : of the strongest line in the envelopes' spectra, all actuators together; seconds.
    share : of that line and its neighbours in the spectrum: 1 where beats are regular.
    """

    loud: Floats
    depth: Floats
    period_s: Floats
    share: Floats


def beats_of(amplitude: Floats, step_s: float) -> Beats:
    """The statistics of amplitudes of shape (T, ..., n), every `step_s` seconds; T > 8."""
    soft, loud = np.percentile(amplitude, (SOFT, LOUD), axis=0)
    depth = ((loud - soft) / np.maximum(loud + soft, 1e-300)).mean(axis=-1)
    count = len(amplitude)
    window = np.hanning(count).reshape(-1, *[1] * (amplitude.ndim - 1))
    turned = np.fft.rfft((amplitude - amplitude.mean(axis=0)) * window, n=FINER * count, axis=0)
    power = (np.abs(turned) ** 2).sum(axis=-1)
    # Slower than a few in the window nothing is told from a drift.
    power[: int(FEWEST * FINER)] = 0.0
    at = power.argmax(axis=0)
    near = np.abs(np.arange(len(power)).reshape(-1, *[1] * (power.ndim - 1)) - at) <= 2 * FINER
    share = (power * near).sum(axis=0) / np.maximum(power.sum(axis=0), 1e-300)
    return Beats(loud, depth, FINER * count * step_s / np.maximum(at, 1), share)


def beats_off(found: Beats, depth: float, period_s: float) -> Floats:
    """How far depth and period are off, the worse of both; 1 is as far as they may be."""
    return np.maximum(np.abs(found.depth - depth) / DEPTH_OFF, np.abs(found.period_s / period_s - 1) / PERIOD_OFF)
