"""All single-harmonic answers of a ring or bidirectional chain: roots of one real function, by enclosures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..equations.scaled_chain import ScaledChain

__all__ = ["Amplitudes", "roots_of"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Bools = NDArray[np.bool_]

MOST_WORK = 3_000_000  # Intervals looked at, times oscillators;
CHUNK = 4096  # so many at a time, the lowest first.
MOST_ROOTS = 2048
FINEST = 1e-14  # Width of an interval, relative to its place, below which it is kept as one doubtful root.
HALVINGS = 80
WIDER = 1.001


@dataclass(frozen=True)
class Amplitudes:
    """phasor : complex128, shape (n, J), scaled amplitudes of the answers. complete : whether these are all."""

    phasor: Complexes
    complete: bool


def roots_of(scaled: ScaledChain) -> Amplitudes:
    """Every single-harmonic answer of the one setting of `scaled`, its constant forces left out."""
    if scaled.law.stride not in (0, 1):
        return Amplitudes(np.zeros((scaled.n, 0), dtype=np.complex128), False)
    back = _Back.of(scaled)
    strength = float(abs(scaled.drive[0]))
    phasor = np.zeros((scaled.n, 0), dtype=np.complex128)
    if strength == 0 or scaled.linear:
        return Amplitudes(np.zeros((scaled.n, 1), dtype=np.complex128), strength == 0 or scaled.linear)
    top = _largest(scaled, strength)
    if not np.isfinite(top):
        return Amplitudes(phasor, False)
    roots, complete = _search(back, strength, top * WIDER)
    if len(roots):
        found, drive = back.profile(roots)
        turn = scaled.drive[0] / drive
        phasor = np.zeros((scaled.n, len(roots)), dtype=np.complex128)
        phasor[: back.n] = found * (turn / np.abs(turn))
    return Amplitudes(phasor, complete)


def _largest(scaled: ScaledChain, strength: float) -> float:
    """A bound of every amplitude; inf where an oscillator without a cubic term might resonate without bound.

    At the oscillator of the largest amplitude M, | |3/4 sign| M^2 - |K_0| | M <= (links) M + strength.
    """
    impedance = np.abs(scaled.k[:, 0] - scaled.omega[0] ** 2 + 1j * scaled.of_each(scaled.delta) * scaled.omega[0])
    links = np.zeros(scaled.n)
    for fed, _, link in scaled.links():
        links[fed] += np.abs(link[:, 0])
    cubic = 0.75 * np.abs(scaled.of_each(scaled.sign))
    # Either M is below the cube root's share, or the quadratic one bounds it: their sum bounds both.
    soft = np.sqrt((impedance + links) / cubic) + np.cbrt(strength / cubic)
    margin = impedance - links
    linear = np.where(margin > 0, strength / margin, np.inf)
    return float(np.where(cubic > 0, soft, linear).max())


@dataclass(frozen=True)
class _Back:
    """The way from the last driven oscillator back to the drive, of `n` oscillators (those behind a cut link rest).

    stiff : complex128, shape (n,), k - omega^2 + i delta omega. cubic : float64, shape (n,), 3/4 sign.
    lam, other : float64, shape (n,). closing : the link from the last to the first.
    """

    n: int
    stiff: Complexes
    cubic: Floats
    lam: Floats
    other: Floats
    closing: float

    @classmethod
    def of(cls, scaled: ScaledChain) -> _Back:
        lam = scaled.lam[:, 0]
        cut = np.flatnonzero(lam[1:] == 0)
        n = int(cut[0]) + 1 if len(cut) else scaled.n
        omega = float(scaled.omega[0])
        stiff = scaled.k[:n, 0] - omega**2 + 1j * scaled.of_each(scaled.delta)[:n] * omega
        other = np.zeros(n) if scaled.other is None else scaled.other[:n, 0].copy()
        other[-1] = 0.0
        closing = float(lam[0]) if scaled.law.closed and n == scaled.n else 0.0
        return cls(n, stiff, 0.75 * scaled.of_each(scaled.sign)[:n], lam[:n], other, closing)

    def profile(self, a: Floats) -> tuple[Complexes, Complexes]:
        """Amplitudes (n, J) with the last one `a` (J,), and the drives (J,) they take."""
        x = np.zeros((self.n + 1, len(a)), dtype=np.complex128)
        x[self.n - 1] = a
        for m in range(self.n - 1, 0, -1):
            x[m - 1] = (self._pull(m, x[m]) - self.other[m] * x[m + 1]) / self.lam[m]
        drive = self._pull(0, x[0]) - self.other[0] * x[1] - self.closing * a
        return x[: self.n], drive

    def _pull(self, m: int, x: Complexes) -> Complexes:
        pulled: Complexes = (self.stiff[m] + self.cubic[m] * (x.real**2 + x.imag**2)) * x
        return pulled

    def enclose(self, middle: Floats, half: Floats, top: float) -> tuple[Complexes, Complexes, Floats, Bools]:
        """Over [middle - half, middle + half]: D in the middle, its slope there, how far the slope may be from that,
        and whether some amplitude is above `top` all over.
        """
        x, slope = np.zeros((2, self.n + 1, len(middle)), dtype=np.complex128)
        blur = np.zeros((self.n + 1, len(middle)))
        x[self.n - 1], slope[self.n - 1] = middle, 1.0
        above = middle - half > top
        for m in range(self.n - 1, 0, -1):
            need = self._needed(m, x, slope, blur, half)
            x[m - 1], slope[m - 1], blur[m - 1] = (each / by for each, by in zip(need, self._by(m), strict=True))
            above |= np.abs(x[m - 1]) - half * (np.abs(slope[m - 1]) + blur[m - 1]) > top
        drive, tilt, haze = self._needed(0, x, slope, blur, half)
        return drive - self.closing * middle, tilt - self.closing, haze, above

    def _by(self, m: int) -> tuple[float, float, float]:
        return float(self.lam[m]), float(self.lam[m]), abs(float(self.lam[m]))

    def _needed(
        self, m: int, x: Complexes, slope: Complexes, blur: Floats, half: Floats
    ) -> tuple[Complexes, Complexes, Floats]:
        """K(x) x less what comes from behind, in the middle; its slope there; a bound of how the slope varies.

        The slope of K(x) x is (K + c |x|^2) x' + c x^2 conj(x').
        """
        c, size, fast = self.cubic[m], np.abs(x[m]), np.abs(slope[m]) + blur[m]
        reach = half * fast
        spread = (2 * size + reach) * reach
        stiff = self.stiff[m] + 2 * c * size**2
        haze = np.abs(stiff) * blur[m] + 2 * abs(c) * spread * fast + abs(c) * (size**2 * blur[m] + spread * fast)
        tilt = stiff * slope[m] + c * x[m] * x[m] * np.conj(slope[m])
        back = self.other[m]
        return self._pull(m, x[m]) - back * x[m + 1], tilt - back * slope[m + 1], haze + abs(back) * blur[m + 1]


def _search(back: _Back, strength: float, top: float) -> tuple[Floats, bool]:
    """All a in [0, top] with |D(a)| = strength, smallest first, and whether none can have been missed."""
    ends = np.array([[0.0, top]])  # The intervals to look at, the lowest last.
    brackets, doubtful = np.empty((0, 2)), np.empty(0)
    seen, spent = 0, False
    while len(ends) and not spent:
        here, ends = ends[-CHUNK:], ends[:-CHUNK]
        seen += len(here)
        middle, half = here.mean(axis=1), 0.5 * (here[:, 1] - here[:, 0])
        hopeful, steady = _judged(back, strength, top, middle, half)
        fine = hopeful & ~steady & (half <= FINEST * middle)
        brackets = np.concatenate([brackets, _crossed(back, strength, here[hopeful & steady])])
        doubtful = np.concatenate([doubtful, middle[fine]])
        left = hopeful & ~steady & ~fine
        halves = np.stack([middle[left], here[left, 1], here[left, 0], middle[left]], axis=1).reshape(-1, 2)
        ends = np.concatenate([ends, halves])
        spent = seen > MOST_WORK // back.n or len(brackets) + len(doubtful) > MOST_ROOTS
    roots = np.concatenate([_bisected(back, strength, brackets), doubtful])
    return np.sort(roots)[:MOST_ROOTS], not (spent or len(doubtful))


def _judged(back: _Back, strength: float, top: float, middle: Floats, half: Floats) -> tuple[Bools, Bools]:
    """Of intervals, whether |D| may be `strength` in them, and whether it surely rises or falls all over."""
    drive, tilt, haze, above = back.enclose(middle, half, top)
    fast, size = np.abs(tilt) + haze, np.abs(drive)
    reach = half * fast
    hopeful = ~(above | (size - reach > strength) | (size + reach < strength))
    return hopeful, np.abs((np.conj(drive) * tilt).real) > size * haze + reach * fast


def _crossed(back: _Back, strength: float, ends: Floats) -> Floats:
    """Those intervals, over each of which |D| rises or falls, in which it passes `strength`."""
    if not len(ends):
        return ends
    first, last = (np.abs(back.profile(a)[1]) < strength for a in ends.T)
    crossed: Floats = ends[first != last]
    return crossed


def _bisected(back: _Back, strength: float, brackets: Floats) -> Floats:
    """The one root in each interval."""
    low, high = brackets[:, 0], brackets[:, 1]
    rising = np.abs(back.profile(high)[1]) > strength
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        above = (np.abs(back.profile(middle)[1]) > strength) == rising
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return 0.5 * (low + high)
