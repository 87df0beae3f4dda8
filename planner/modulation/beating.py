"""A chain whose last actuator beats, computed backwards to its drive.

It is the flatness of theory.md section 4.2 in two times: an envelope A(phase, tau) repeats in the phase of the beat
while it slowly rises. Its whole derivative is that of a Taylor jet in tau, and `step` times that in the phase, which is
taken exactly in harmonics. The cubic term may mix all of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

from ..closed_forms.links import stages
from ..transitions import jets
from ..transitions.jets import Jet

__all__ = ["PHASES", "Beating", "beats_in", "driven", "harmonics"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Instants of one beat, and the highest harmonic that is kept of what they are.
PHASES, HIGHEST = 64, 21


class Beating(NamedTuple):
    """A chain that beats, at some instants of its way.

    drive, slope : complex128, shape (2 HIGHEST + 1, nodes), tones of the drive from the lowest up, and per tau.
    motion : complex128, shape (n, PHASES, nodes), envelopes.
    forces : complex128, shape (PHASES, nodes), the envelope of the drive.
    """

    drive: Complexes
    slope: Complexes
    motion: Complexes
    forces: Complexes


def driven(chain: Chain, lam: Floats, omega: float, step: float, last: Complexes, blend: Jet) -> Beating:
    """The drive under which the last actuator goes as it should, and what all others do then.

    Parameters
    ----------
    lam : float64, shape (n-1,), links, which stay.
    omega, step : of the carrier, and of the beat, over f0.
    last : complex128, shape (2k+1,), tones of the last actuator's envelope at multiples -k..k of `step`.
    blend : jet in tau of how much of it is there, shape (2n+2, nodes); of length 1 where that stays.
    """
    k = np.arange(len(last)) - len(last) // 2
    shape = np.exp(2j * np.pi * np.outer(np.arange(PHASES), k) / PHASES) @ last
    envelope: Jet = blend[:, None, :] * shape[None, :, None]
    motion = np.empty((chain.n, PHASES, blend.shape[1]), np.complex128)
    for m in range(chain.n - 1, -1, -1):
        motion[m] = envelope[0]
        force = _force(chain, m, omega, step, envelope)
        if m:
            envelope = force / lam[m - 1] + envelope[: len(force)]
    drive = harmonics(force[0])
    slope = harmonics(force[1]) if len(force) > 1 else np.zeros_like(drive)
    return Beating(drive, slope, motion, force[0])


def _force(chain: Chain, m: int, omega: float, step: float, envelope: Jet) -> Jet:
    own, first = stages(chain, m), _change(envelope, step)
    second = _change(first, step)
    length = len(second)
    stiffness = 0.75 * own.beta * jets.norm2(envelope[:length]) + 0j
    stiffness[0] += own.stiffness - omega**2 + 1j * own.delta * omega
    return jets.multiply(stiffness, envelope[:length]) + (2j * omega + own.delta) * first[:length] + second


def _change(envelope: Jet, step: float) -> Jet:
    """The derivative in tau, one order shorter; of what stays but for its beat as long."""
    k = np.fft.fftfreq(PHASES, 1 / PHASES)
    turning = 1j * step * np.where(np.abs(k) <= HIGHEST, k, 0.0)
    beating: Jet = np.fft.ifft(turning[:, None] * np.fft.fft(envelope, axis=1), axis=1)
    return beating if len(envelope) == 1 else jets.derivative(envelope) + beating[:-1]


def harmonics(values: Complexes) -> Complexes:
    """The tones of values over one beat, shape (PHASES, ...), from -HIGHEST up; shape (2 HIGHEST + 1, ...)."""
    found = np.fft.fft(values, axis=0) / PHASES
    return np.concatenate([found[-HIGHEST:], found[: HIGHEST + 1]])


def beats_in(motion: Complexes, beats: int) -> Complexes:
    """Amplitudes of the envelopes' square at 1, 2, .. times the beat.

    Parameters
    ----------
    motion : complex128, shape (n, PHASES).

    Returns
    -------
    complex128, shape (beats, n).
    """
    return np.asarray(2 * np.fft.fft(np.abs(motion) ** 2, axis=1)[:, 1 : beats + 1].T / PHASES)
