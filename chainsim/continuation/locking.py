"""Whether a chain locks to its drive, at which lag, and if not at which beat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..averaging.settle import reached
from ..equations.chain import Chain, Setting
from ..model.response import Outcome
from ..rung import Start

__all__ = ["Locking", "locking"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Locking:
    """What N settings do in the long run.

    Attributes
    ----------
    outcome : object array of `Outcome`, shape (N,).
    locked : bool, shape (N,), every oscillator repeats with the drive and the state is stable.
    phase_step : float64, shape (N, n-1), radians in (-pi, pi], phase of m less that of m-1; NaN where not locked.
    closing_step : float64, shape (N,), the phase of the first less that of the last.
    amplitude : float64, shape (N, n), dimensionless; NaN where not locked.
    beat : float64, shape (N,), radians per tau, frequency of the strongest line that is not the drive's, less omega; 0
        where locked, NaN where neither was seen.
    spread : float64, shape (N,), how deep that beat is, (max - min)/max of an amplitude; 0 where locked.
    growth : float64, shape (N,), per unit of tau, largest real part of the slow flow's eigenvalues; < 0 where locked.
    """

    outcome: NDArray[np.object_]
    locked: NDArray[np.bool_]
    phase_step: Floats
    closing_step: Floats
    amplitude: Floats
    beat: Floats
    spread: Floats
    growth: Floats


def locking(chain: Chain, setting: Setting, *, start: Start | ArrayLike) -> Locking:
    """Follow the envelope from `start` (as in `reached`) and say how it ends.

    Raises
    ------
    EnvelopeError
        When the slow flow is not true of the system, or `start` has another shape.
    """
    arrival = reached(chain, setting, start=start)
    phasor = arrival.phasor
    step = np.angle(phasor[:, 1:] * phasor[:, :-1].conj())
    closing = np.angle(phasor[:, 0] * phasor[:, -1].conj())
    locked = arrival.outcome == Outcome.OK
    growth = arrival.rates.real.max(axis=1)
    amplitude = np.abs(phasor)
    for array in (locked, step, closing, amplitude, growth):
        array.flags.writeable = False
    return Locking(arrival.outcome, locked, step, closing, amplitude, arrival.beat, arrival.spread, growth)
