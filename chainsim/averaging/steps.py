"""Two fourth-order exponential methods for the slow flow: one for courses that change, one for drives that stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .flow import SlowFlow
from .linear import exponential, times

__all__ = ["Course", "SlowStretch", "Steps", "advance"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True)
class Steps:
    """Coefficients of one step of the fourth-order exponential Runge-Kutta method of Cox and Matthews (J. Comput. Phys.
    176, 2002, eq. 26-29), which has the linear part exactly; each complex128, shape (N, n, n).
    """

    whole: Complexes
    half: Complexes
    stage: Complexes
    first: Complexes
    middle: Complexes
    last: Complexes

    @classmethod
    def of(cls, rate: Complexes, h: float) -> Steps:
        """For steps `h` of the linear parts `rate`, shape (N, n, n)."""
        whole, one, two, three = _phi(rate * h)
        half, half_one, _, _ = _phi(rate * (0.5 * h))
        return cls(
            whole, half, 0.5 * h * half_one,
            h * (one - 3 * two + 4 * three), 2 * h * (two - 2 * three), h * (4 * three - two),
        )  # fmt: skip

    def take(
        self, flow: SlowFlow, slow: Complexes, drive: tuple[Complexes, Complexes], lam: tuple[Floats, Floats]
    ) -> Complexes:
        """One step; `drive` and `lam` are given at its start and end and are linear between."""
        (f0, f1), (l0, l1) = drive, lam
        fm, lm = 0.5 * (f0 + f1), l0 if l0 is l1 else 0.5 * (l0 + l1)
        n0 = flow.driven(slow, f0, l0)
        halfway = times(self.half, slow)
        a = halfway + times(self.stage, n0)
        na = flow.driven(a, fm, lm)
        b = halfway + times(self.stage, na)
        nb = flow.driven(b, fm, lm)
        c = times(self.half, a) + times(self.stage, 2 * nb - n0)
        return (
            times(self.whole, slow) + times(self.first, n0) + times(self.middle, na + nb)
            + times(self.last, flow.driven(c, f1, l1))
        )  # fmt: skip


def _phi(z: Complexes) -> tuple[Complexes, Complexes, Complexes, Complexes]:
    """e^z, phi_1, phi_2, phi_3 of matrices: phi_1 = (e^z - 1)/z and so on, all from one block matrix.

    exp [[z, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0]] has them in its first row.
    """
    size, n = z.shape[:2]
    block = np.zeros((size, 4 * n, 4 * n), dtype=np.complex128)
    block[:, :n, :n] = z
    for k in range(3):
        block[:, k * n : (k + 1) * n, (k + 1) * n : (k + 2) * n] = np.eye(n)
    row = exponential(block)[:, :n]
    return row[:, :, :n], row[:, :, n : 2 * n], row[:, :, 2 * n : 3 * n], row[:, :, 3 * n :]


@dataclass(frozen=True)
class Course:
    """A drive that stands, or grows at a steady pace: its share of the full drive is ``share + pace tau``.

    Attributes
    ----------
    follows : complex128, shape (N, n), where the flow rests under the full drive when its cubic term is held at `held`:
        the linear flow's where that is 0, else a fixed point.
    held : complex128, shape (N, n), weight N(A) there.
    lags : complex128, shape (N, n), by how much it trails a drive that grows by its full size in a unit of tau; None
        where the drive stands.
    """

    follows: Complexes
    held: Complexes
    lags: Complexes | None
    share: float
    pace: float

    def at(self, tau: float) -> Complexes:
        """Where the linear flow has settled to at `tau`."""
        place = (self.share + self.pace * tau) * self.follows
        return place if self.lags is None else place + self.pace * self.lags


@dataclass(frozen=True)
class SlowStretch:
    """One stretch of the way.

    Attributes
    ----------
    slow : complex128, shape (N, n), slow parts at its end.
    peak : float64, shape (N, n), the largest |A|^2 seen.
    kept : the amplitudes after each step, complex128, shape (N, n) each, where they were asked for.
    """

    slow: Complexes
    peak: Floats
    kept: list[Complexes]


def advance(
    flow: SlowFlow, slow: Complexes, drive: Complexes, course: Course, half: Complexes, h: float, count: int, keep: bool
) -> SlowStretch:
    """Take `count` steps of length `h` of Lawson's fourth-order method (SIAM J. Numer. Anal. 4, 1967).

    What is left of the motion beside `course` turns and dies by the matrix exponential `half`, of half a step, exactly;
    only the cubic term is integrated.
    """
    kept: list[Complexes] = []
    driven = flow.slave[:, :, 0] * drive[:, None]
    near = _Near(flow, flow.amplitude(slow, course.share * drive, flow.lam))

    def whole(apart: Complexes, tau: float) -> Complexes:
        """Move on to the amplitude that belongs to `apart`; returns what it does to the slow part."""
        near.move(apart + (course.at(tau) + (course.share + course.pace * tau) * driven))
        return times(flow.weight, near.push) - course.held

    apart = slow - course.at(0.0)
    peak = near.square.copy()
    for k in range(count):
        tau = k * h
        first = times(flow.weight, near.push) - course.held
        moved = half @ np.stack([apart, first], axis=2)
        rest, gone = moved[:, :, 0], moved[:, :, 1]
        second = whole(rest - (0.5 * h) * gone, tau + 0.5 * h)
        third = whole(rest - (0.5 * h) * second, tau + 0.5 * h)
        moved = half @ np.stack([rest - h * third, rest - (h / 6) * gone - (h / 3) * (second + third)], axis=2)
        apart = moved[:, :, 1] - (h / 6) * whole(moved[:, :, 0], tau + h)
        near.move(apart + (course.at(tau + h) + (course.share + course.pace * (tau + h)) * driven))
        np.maximum(peak, near.square, out=peak)
        if keep:
            kept.append(near.amplitude)
        if k % 32 == 31 and not np.isfinite(peak).all(axis=1).any():
            break
    return SlowStretch(apart + course.at(count * h), peak, kept)


class _Near:
    """The amplitude A = base - slave N(A) as it moves on: `push` is N(A), `square` |A|^2.

    Each oscillator's own part is found by its gain, A = .. / (1 + gain), whatever its size; the rest of N is taken as
    it was a stage before.
    """

    def __init__(self, flow: SlowFlow, amplitude: Complexes) -> None:
        each = np.arange(amplitude.shape[1])
        self.flow, self.own = flow, flow.slave[:, each, each]
        self.others = flow.slave.copy()
        self.others[:, each, each] = 0
        self._note(amplitude)

    def _note(self, amplitude: Complexes) -> None:
        self.amplitude, self.square = amplitude, amplitude.real**2 + amplitude.imag**2
        self.gain = self.flow.gain(self.square)
        plain = self.gain * amplitude
        self.push = plain if self.flow.lean is None else self.flow.cubic(amplitude)
        self.rest = times(self.others, self.push)
        if self.flow.lean is not None:
            self.rest += self.own * (self.push - plain)

    def move(self, base: Complexes) -> None:
        """Move on to what belongs to `base`."""
        base = base - self.rest
        guess = base / (1 + self.own * self.gain)
        self._note(base / (1 + self.own * self.flow.gain(guess.real**2 + guess.imag**2)))
