"""Harmonics 1, 3 and 5 of one oscillator for a block of settings side by side: start, Newton correction, estimate.

A block is one run of `ROWS` rows of `WIDTH` numbers, a row per quantity and a column per setting, so that every loop
over the columns is straight-line arithmetic the compiler turns into vector instructions. A column never looks at its
neighbours: one that has converged is left alone while others are still corrected.

With z = Re(a e^{it} + b e^{3it} + c e^{5it}) the products of series are written out. Newton's matrix is exact in the
first two harmonics; the fifth, 24 times farther from resonance than the first is wide, is eliminated without its
small couplings, which costs the convergence about a factor beta^2 a^4/100 over the sharpness a step.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..inlined import inlined

__all__ = [
    "BRANCH", "DEAD", "DECAY", "DONE", "ERROR", "FORCE", "LAM", "OM2", "RATE", "ROWS", "SIZE", "STIFF", "TRACE",
    "WIDTH", "WORK", "X", "correct", "finish", "start",
]  # fmt: skip

Floats = NDArray[np.float64]

WIDTH = 16
"""Settings side by side: two vectors of eight, so that one hides the other's latency."""

# Rows of a block. FORCE, X: harmonics 1, 3, 5. ERROR: bounds of the errors of harmonics 1, 3, 5, 7, handed down the
# chain. SIZE: largest |a| of any oscillator so far, and the largest error. BRANCH: of the oscillator, then how many
# answers it has. DECAY: of half a turn.
OM2, RATE, STIFF, LAM, FORCE, X, DONE, DEAD, ERROR, SIZE, BRANCH, TRACE, WORK, DECAY, ROWS = (
    WIDTH * row for row in (0, 1, 2, 3, 4, 10, 16, 17, 18, 22, 24, 26, 27, 40, 41)
)  # fmt: skip

# Corrections end when one is this small, relative to the answer.
_SMALL = 1e-9
_ROUNDING = 4e-16
# Steps towards the root of the cubic, and one, relative, after which Newton's method on the harmonics does better.
_ROOT_STEPS = 6
_NEAR = 1e-3
# High word of the double whose bits, added to a third of those of c, give the cube root of c to 6 %.
_CUBE_ROOT = 715_094_163 << 32


@inlined
def _norm(z: complex) -> float:
    return z.real * z.real + z.imag * z.imag


@inlined
def start(block: Floats, sign: float) -> None:
    """Put the lower branch of the one-harmonic cubic, with the harmonics it drives, into rows X.

    ``v ((kappa + sign v)^2 + g^2) = c``, v = 3/4 |a|^2, c = 3/4 |f|^2. Left of the first turn the curve is concave:
    a parabola through the last point is solved, which holds at the fold too. Right of it Newton's method comes from
    an upper bound. Rows BRANCH receive the first fold (0: none) and the number of roots.
    """
    work = block[WORK : WORK + 6 * WIDTH]
    for w in range(WIDTH):
        fr, fi = block[FORCE + w], block[FORCE + WIDTH + w]
        work[w] = 0.75 * (fr * fr + fi * fi)
    bits = work.view(np.int64)
    for w in range(WIDTH):
        bits[WIDTH + w] = bits[w] // 3 + _CUBE_ROOT
    for w in range(WIDTH):
        g, c, cube = block[RATE + w], work[w], 1.06 * work[WIDTH + w]
        kappa = block[STIFF + w] - block[OM2 + w]
        bend, gg = max(-sign * kappa, 0.0), g * g
        spread, linear = kappa * kappa - 3 * gg, kappa * kappa + gg
        folded = bend > 0 and spread > 0
        dip = (2 * bend + math.sqrt(max(spread, 0.0))) / 3
        peak = linear / (3 * dip) if folded else 2 * bend / 3
        left = bend > 0 and c <= peak * ((kappa + sign * peak) ** 2 + gg)
        tame = cube if cube * linear <= c else c / linear
        v = 0.0 if left else (abs(kappa) + cube if bend > 0 else tame)
        block[BRANCH + w] = peak if folded else 0.0
        block[BRANCH + WIDTH + w] = 3.0 if folded and left and c >= dip * ((kappa + sign * dip) ** 2 + gg) else 1.0
        work[2 * WIDTH + w], work[3 * WIDTH + w] = v, dip
        # The highest root that is looked for, and whether the search goes on.
        work[4 * WIDTH + w], work[5 * WIDTH + w] = peak if left else math.inf, 1.0
    for _ in range(_ROOT_STEPS):
        if _towards_root(block, work, sign) == 0:
            break
    _slaved(block, sign)


@inlined
def _towards_root(block: Floats, work: Floats, sign: float) -> int:
    """One step towards the root of every setting that needs it; returns how many still do."""
    moving = 0
    for w in range(WIDTH):
        g, c, v, top, go = block[RATE + w], work[w], work[2 * WIDTH + w], work[4 * WIDTH + w], work[5 * WIDTH + w]
        kappa = block[STIFF + w] - block[OM2 + w]
        gg, stiff = g * g, kappa + sign * v
        slope = stiff * (stiff + 2 * sign * v) + gg
        rest = c - v * (stiff * stiff + gg)
        bent = math.sqrt(max(slope * slope + 4 * rest * (2 * sign * kappa + 3 * v), 0.0))
        step = go * (2 * rest / (slope + (bent if top < math.inf else slope)))
        v = min(v + step, top) if step * step >= 0 else v
        still = 0.0 if abs(step) <= _NEAR * v else go
        work[2 * WIDTH + w], work[5 * WIDTH + w] = v, still
        moving += 1 if still > 0 else 0
    return moving


@inlined
def _slaved(block: Floats, sign: float) -> None:
    """Rows X from the root v: the first harmonic, and the third and fifth that it drives."""
    for w in range(WIDTH):
        k, om2, g = block[STIFF + w], block[OM2 + w], block[RATE + w]
        v = block[WORK + 2 * WIDTH + w]
        f = complex(block[FORCE + w], block[FORCE + WIDTH + w])
        f3 = complex(block[FORCE + 2 * WIDTH + w], block[FORCE + 3 * WIDTH + w])
        f5 = complex(block[FORCE + 4 * WIDTH + w], block[FORCE + 5 * WIDTH + w])
        some = 1.0 if f.real != 0.0 or f.imag != 0.0 else 0.0
        one = complex(k - om2 + sign * v, g)
        a = f * one.conjugate() * (some / (_norm(one) if some > 0 else 1.0))
        three, five = complex(k - 9 * om2 + 2 * sign * v, 3 * g), complex(k - 25 * om2 + 2 * sign * v, 5 * g)
        b = (f3 - 0.25 * sign * a * a * a) * three.conjugate() * (1 / _norm(three))
        c = (f5 - 0.75 * sign * a * a * b) * five.conjugate() * (1 / _norm(five))
        block[X + w], block[X + WIDTH + w] = a.real, a.imag
        block[X + 2 * WIDTH + w], block[X + 3 * WIDTH + w] = b.real, b.imag
        block[X + 4 * WIDTH + w], block[X + 5 * WIDTH + w] = c.real, c.imag
        block[DONE + w] = block[DEAD + w]


@inlined
def _squares(a: complex, b: complex, c: complex) -> tuple[float, complex, complex, complex, complex, complex]:
    """Harmonics 0, 2, .. 10 of z^2."""
    return (
        0.5 * (_norm(a) + _norm(b) + _norm(c)),
        0.5 * (a * a) + b * a.conjugate() + c * b.conjugate(),
        a * b + c * a.conjugate(),
        0.5 * (b * b) + a * c,
        b * c,
        0.5 * (c * c),
    )


@inlined
def correct(block: Floats, sign: float) -> int:
    """One Newton correction of every setting that is not done; returns how many are still not."""
    left = 0
    for w in range(WIDTH):
        k, om2, g = block[STIFF + w], block[OM2 + w], block[RATE + w]
        a = complex(block[X + w], block[X + WIDTH + w])
        b = complex(block[X + 2 * WIDTH + w], block[X + 3 * WIDTH + w])
        c = complex(block[X + 4 * WIDTH + w], block[X + 5 * WIDTH + w])
        ac, bc, cc = a.conjugate(), b.conjugate(), c.conjugate()
        w0, w2, w4, w6, w8, w10 = _squares(a, b, c)
        w2c = w2.conjugate()
        z1 = w0 * a + 0.5 * (w2 * ac + w2c * b + w4 * bc + w4.conjugate() * c + w6 * cc)
        z3 = w0 * b + 0.5 * (w2 * a + w4 * ac + w2c * c + w6 * bc + w8 * cc)
        z5 = w0 * c + 0.5 * (w2 * b + w4 * a + w6 * ac + w8 * bc + w10 * cc)
        r1 = complex(block[FORCE + w], block[FORCE + WIDTH + w]) - complex(k - om2, g) * a - sign * z1
        r3 = complex(block[FORCE + 2 * WIDTH + w], block[FORCE + 3 * WIDTH + w])
        r3 = r3 - complex(k - 9 * om2, 3 * g) * b - sign * z3
        r5 = complex(block[FORCE + 4 * WIDTH + w], block[FORCE + 5 * WIDTH + w])
        r5 = r5 - complex(k - 25 * om2, 5 * g) * c - sign * z5
        p, q, r, mean = 1.5 * sign * w2, 1.5 * sign * w4, 1.5 * sign * w6, 3 * sign * w0
        three, five = complex(k - 9 * om2 + mean, -3 * g), complex(k - 25 * om2 + mean, -5 * g)
        three, five = three * (1 / _norm(three)), five * (1 / _norm(five))
        y3, y5 = r3 * three, r5 * five
        pc, qc, pp, qq = p.conjugate(), q.conjugate(), _norm(p), _norm(q)
        s = r1 - (pc * y3 + q * y3.conjugate()) - (qc * y5 + r * y5.conjugate())
        e = complex(k - om2 + mean - (pp + qq) * three.real, g - (pp - qq) * three.imag)
        f = p - (2 * three.real) * (pc * q)
        u = (e.conjugate() * s - f * s.conjugate()) * (1 / (_norm(e) - _norm(f)))
        v = y3 - (p * u + q * u.conjugate()) * three
        t = y5 - (p * v + q * u + r * u.conjugate()) * five
        step = _norm(u) + _norm(v) + _norm(t)
        go = 1.0 - block[DONE + w]
        block[X + w], block[X + WIDTH + w] = a.real + go * u.real, a.imag + go * u.imag
        block[X + 2 * WIDTH + w], block[X + 3 * WIDTH + w] = b.real + go * v.real, b.imag + go * v.imag
        block[X + 4 * WIDTH + w], block[X + 5 * WIDTH + w] = c.real + go * t.real, c.imag + go * t.imag
        still = go * (0.0 if step <= 2 * _SMALL * _SMALL * w0 else 1.0)
        block[DONE + w] = 1.0 - still
        left += 1 if still > 0 else 0
    return left


@inlined
def finish(block: Floats, sign: float) -> None:
    """Hand the error bounds down the chain and name the branch.

    The seventh harmonic, left out, pulls at the fifth, that at the third and all of them at the first; each also
    inherits lam times its error in the oscillator before. Newton's method left its last step times the factor by
    which its steps shrink; rounding leaves its share of the impedance.
    """
    for w in range(WIDTH):
        k, om2, g, lam = block[STIFF + w], block[OM2 + w], block[RATE + w], abs(block[LAM + w])
        a = complex(block[X + w], block[X + WIDTH + w])
        b = complex(block[X + 2 * WIDTH + w], block[X + 3 * WIDTH + w])
        c = complex(block[X + 4 * WIDTH + w], block[X + 5 * WIDTH + w])
        w0, w2, w4, w6, w8, w10 = _squares(a, b, c)
        z7 = 0.5 * (w2 * c + w4 * b + w6 * a + w8 * a.conjugate() + w10 * b.conjugate())
        mean, weight = 3 * sign * w0, 1.5 * abs(sign)
        p, q, r = weight * math.sqrt(_norm(w2)), weight * math.sqrt(_norm(w4)), weight * math.sqrt(_norm(w6))
        one, three = complex(k - om2 + mean, g), complex(k - 9 * om2 + mean, 3 * g)
        five, seven = complex(k - 25 * om2 + mean, 5 * g), complex(k - 49 * om2 + mean, 7 * g)
        d3, d5, d7 = math.sqrt(_norm(three)), math.sqrt(_norm(five)), math.sqrt(_norm(seven))
        e7 = (abs(sign) * math.sqrt(_norm(z7)) + lam * block[ERROR + 3 * WIDTH + w]) / d7
        e5 = (p * e7 + lam * block[ERROR + 2 * WIDTH + w]) / d5
        e3 = (p * e5 + q * e7 + lam * block[ERROR + WIDTH + w]) / d3
        sharp = abs(math.sqrt(_norm(one)) - p)
        size = math.sqrt(_norm(a))
        newton = _SMALL * min(q * q / (d5 * sharp) + 1e3 * _SMALL, 1.0) if size > 0 else 0.0
        known = lam * block[ERROR + w] + (p + q) * e3 + (q + r) * e5 + r * e7 + _ROUNDING * (abs(k) + om2) * size
        e1 = known / sharp + newton * size if known > 0 else 0.0
        block[ERROR + w], block[ERROR + WIDTH + w] = e1, e3 + (p + q) / d3 * e1
        block[ERROR + 2 * WIDTH + w], block[ERROR + 3 * WIDTH + w] = e5, e7
        block[SIZE + w] = size if size > block[SIZE + w] else block[SIZE + w]
        block[SIZE + WIDTH + w] = e1 if e1 > block[SIZE + WIDTH + w] else block[SIZE + WIDTH + w]
        v, peak = 0.75 * _norm(a), block[BRANCH + w]
        several = block[BRANCH + WIDTH + w] > 1 and v >= peak
        block[BRANCH + w] = (2.0 if v > block[WORK + 3 * WIDTH + w] else 1.0) if several else 0.0
