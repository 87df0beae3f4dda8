"""An answer where Newton's method has no start: the damping is raised until there is one answer, then let down again.

Under enough damping every oscillator follows its force, whatever its cubic term, and has one answer. That answer is
followed while the added damping falls to nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis, basis_for, resize
from ..equations.scaled_chain import ScaledChain
from .march import March

__all__ = ["blank", "filled", "let_down", "undriven"]

Floats = NDArray[np.float64]
Wholes = NDArray[np.intp]

# Factors by which the added damping falls; what is lost at the first is tried again at the second.
FALLS = (0.4, 0.65)
# Added damping, over the smallest of the chain's own, that is let go at once.
LAST = 0.02
MOST_FALLS = 60
# Oscillators up to which it is tried: every fall solves them all.
MOST = 64


def undriven(scaled: ScaledChain, basis: Basis, solve: Callable[[ScaledChain, Basis], March]) -> March:
    """Settings without a drive: the equilibrium in the well under constant forces, as a series in `basis`."""
    still = basis_for(0, True)
    found = solve(scaled, still)
    held = (scaled.k + 3 * scaled.sign * found.x[:, 0] ** 2 > 0).all(axis=0)
    x = np.stack([resize(each, still, basis) for each in found.x])
    return March(basis, x, found.ok & held, found.branch, found.steps)


def let_down(scaled: ScaledChain, basis: Basis, solve: Callable[[ScaledChain, Basis, Floats], March]) -> March:
    """An answer of every setting, not `ok` where none was found; `solve` is Newton's method from a guess (n, d, N)."""
    whole = blank(scaled, basis)
    for fall in FALLS if scaled.n <= MOST else ():
        lost = np.flatnonzero(~whole.ok)
        if not len(lost):
            break
        left, found = _at_rate(scaled.pick(lost), basis, solve, fall)
        whole = filled(whole, lost[left], found)
    return whole


def blank(scaled: ScaledChain, basis: Basis) -> March:
    """No answer for any setting."""
    n, size = scaled.n, len(scaled)
    x, branch = np.zeros((n, basis.size, size)), np.zeros((n, size), dtype=np.int8)
    return March(basis, x, np.zeros(size, dtype=bool), branch, 0)


def filled(whole: March, index: Wholes, part: March) -> March:
    """`whole` with the settings `index` from `part`."""
    x, ok, branch = whole.x.copy(), whole.ok.copy(), whole.branch.copy()
    x[:, :, index], ok[index], branch[:, index] = part.x, part.ok, part.branch
    return March(whole.basis, x, ok, branch, whole.steps + part.steps)


def _at_rate(
    scaled: ScaledChain, basis: Basis, solve: Callable[[ScaledChain, Basis, Floats], March], fall: float
) -> tuple[Wholes, March]:
    """The settings that could be followed all the way, and their answers."""
    own = max(float(scaled.delta.min()), 1e-6)
    # Every setting goes down the same stairs from where it needs to, so that none depends on another.
    stair = np.ceil(np.log(_enough(scaled) / (LAST * own)) / -np.log(fall))
    left = np.flatnonzero(stair <= MOST_FALLS)
    top = int(stair[left].max(initial=0))
    guess, steps = np.zeros((scaled.n, basis.size, len(scaled))), 0
    ok, branch = np.zeros(len(scaled), dtype=bool), np.zeros((scaled.n, len(scaled)), dtype=np.int8)
    ok[left] = True
    for level in range(top, -1, -1):
        now = np.flatnonzero(ok & (stair >= level))
        if not len(now):
            continue
        here, extra = scaled.pick(now), LAST * own * fall ** -float(level) if level else 0.0
        found = solve(replace(here, delta=here.delta + extra), basis, guess[:, :, now])
        guess[:, :, now], ok[now], branch[:, now] = found.x, found.ok, found.branch
        steps += found.steps
    left = np.flatnonzero(ok)
    return left, March(basis, guess[:, :, left], ok[left], branch[:, left], steps)


def _enough(scaled: ScaledChain) -> Floats:
    """Damping beside which the cubic term, every stiffness and every link are small; float64, shape (N,)."""
    links = np.abs(scaled.lam).max(axis=0)
    if scaled.other is not None:
        links = links + np.abs(scaled.other).max(axis=0)
    stiff = np.abs(scaled.k).max(axis=0) + scaled.omega**2 + links
    enough: Floats = 3 * (np.cbrt(np.abs(scaled.drive)) ** 2 + stiff) / scaled.omega
    return enough
