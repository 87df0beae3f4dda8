"""Closed forms of a grid in which each actuator is fed from its left and from its upper neighbour."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

__all__ = [
    "GridLinks",
    "GridWave",
    "drives_of",
    "motion_of",
    "motion_under",
    "plane_wave",
    "stage_constants",
    "transfer",
]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Steps to the frequency at which a wave's damping, which grows with it, is carried: each is a thousand times nearer.
STEPS = 30
# A sine below this carries nothing: neighbours in step, or half a turn apart.
LEAST_SINE = 1e-9


@dataclass(frozen=True)
class GridLinks:
    """Links of a grid: float64, shape (rows, cols) each, into every actuator from its left and from above.

    Those of the first column and of the first row, which come from nowhere, are 0.
    """

    right: Floats
    down: Floats

    @classmethod
    def alike(cls, device: Device, lam_x: float, lam_y: float) -> GridLinks:
        """One lam each way."""
        right, down = np.full((device.rows, device.cols), lam_x), np.full((device.rows, device.cols), lam_y)
        right[:, 0] = down[0] = 0.0
        return cls(right, down)

    @classmethod
    def of(cls, device: Device, lam: Floats) -> GridLinks:
        """Of links in a row, as `flat` puts them."""
        right, down = np.zeros((device.rows, device.cols)), np.zeros((device.rows, device.cols))
        along = device.rows * (device.cols - 1)
        right[:, 1:] = lam[:along].reshape(device.rows, device.cols - 1)
        down[1:] = lam[along:].reshape(device.rows - 1, device.cols)
        return cls(right, down)

    @property
    def flat(self) -> Floats:
        """As an operating point has them: those to the right row by row, then those downwards."""
        return np.concatenate([self.right[:, 1:].ravel(), self.down[1:].ravel()])


class GridWave(NamedTuple):
    """One lam to the right, one downwards, and the frequency at which a plane wave stands under them."""

    lam_x: float
    lam_y: float
    omega: float


def plane_wave(device: Device, amplitude: float, lag_x: float, lag_y: float, share: float) -> GridWave:
    """The links and the frequency with which equal amplitudes lag their left and upper neighbours so.

    One stage asks ``kappa + i delta omega = lam_x (e^{i lag_x} - 1) + lam_y (e^{i lag_y} - 1)``. Its imaginary part
    says that the two carry the damping together, ``lam_x sin(lag_x) + lam_y sin(lag_y) = delta omega``; `share` of it
    is left to lam_x. Its real part gives the frequency.

    Parameters
    ----------
    lag_x, lag_y : radians; where the share of one is not 0 its lag lies between 0 and pi.
    """
    omega = 1.0
    for _ in range(STEPS):
        lam_x, lam_y = (
            part * device.delta * omega / math.sin(lag) if part else 0.0
            for part, lag in ((share, lag_x), (1 - share, lag_y))
        )
        pull = lam_x * (1 - math.cos(lag_x)) + lam_y * (1 - math.cos(lag_y))
        omega = math.sqrt(max(1 + 0.75 * device.beta * amplitude**2 + pull, LEAST_SINE))
    return GridWave(lam_x, lam_y, omega)


def stage_constants(device: Device, links: GridLinks, omega: float, size: Floats) -> Complexes:
    """What each actuator's amplitude is multiplied by: its stage constant and the back terms of its links."""
    kappa = 1 - omega**2 + 0.75 * device.beta * size**2 + 1j * device.delta * omega
    return np.asarray(kappa + links.right + links.down)


def drives_of(device: Device, phasor: Complexes, links: GridLinks, omega: float) -> Complexes:
    """What every actuator would have to be driven with for a motion, one harmonic; complex128, shape (rows, cols)."""
    left, above = np.roll(phasor, 1, axis=1), np.roll(phasor, 1, axis=0)
    own = stage_constants(device, links, omega, np.abs(phasor)) * phasor
    return np.asarray(own - links.right * left - links.down * above)


def motion_under(device: Device, drive: Complexes, links: GridLinks, omega: float) -> Complexes:
    """The small motion under drives on every actuator, one harmonic, on the lowest branch; shape (rows, cols)."""
    phasor = np.zeros(drive.shape, dtype=np.complex128)
    linear = stage_constants(device, links, omega, np.zeros(drive.shape))
    for row, col in np.ndindex(*drive.shape):
        push = drive[row, col] + (links.right[row, col] * phasor[row, col - 1] if col else 0.0)
        push += links.down[row, col] * phasor[row - 1, col] if row else 0.0
        phasor[row, col] = _lowest(complex(linear[row, col]), 0.75 * device.beta, complex(push))
    return phasor


def motion_of(device: Device, size: Floats, links: GridLinks, omega: float) -> Complexes:
    """The motion of amplitudes that are known, where each is driven (and then real) or fed over links.

    Parameters
    ----------
    size : float64, shape (rows, cols), dimensionless.
    """
    phasor, stage = np.zeros(size.shape, dtype=np.complex128), stage_constants(device, links, omega, size)
    for row, col in np.argwhere(size > 0):
        push = links.right[row, col] * phasor[row, col - 1] if links.right[row, col] else 0j
        push += links.down[row, col] * phasor[row - 1, col] if links.down[row, col] else 0j
        phasor[row, col] = push / stage[row, col] if push else size[row, col]
    return phasor


def _lowest(stage: complex, bend: float, push: complex) -> complex:
    """The solution of ``(stage + bend |A|^2) A = push`` with the smallest amplitude."""
    roots = np.roots([bend**2, 2 * bend * stage.real, abs(stage) ** 2, -(abs(push) ** 2)]) if bend else None
    if roots is None or not push:
        return push / stage
    real = roots.real[(np.abs(roots.imag) < LEAST_SINE) & (roots.real >= 0)]
    return push / (stage + bend * float(real.min()))


def transfer(device: Device, links: GridLinks, omega: Floats) -> Complexes:
    """Small motions of every actuator under a unit force on each driven one; complex128, (drives, rows, cols, F).

    Parameters
    ----------
    omega : float64, shape (F,).
    """
    stiffness = 1 + links.right + links.down
    found = np.zeros((len(device.driven), *stiffness.shape, len(omega)), dtype=np.complex128)
    for place, at in enumerate(device.driven):
        found[place][at] = 1.0
    for row, col in np.ndindex(*stiffness.shape):
        here = found[:, row, col]
        if col:
            here += links.right[row, col] * found[:, row, col - 1]
        if row:
            here += links.down[row, col] * found[:, row - 1, col]
        here /= stiffness[row, col] - omega**2 + 1j * device.delta * omega
    return found
