"""The answer beside a motion that has a way in of its own, by the cheapest rung that will do: nothing is integrated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..harmonic_balance.rung import balance_near
from ..model.response import Outcome, Response, Stats
from ..rung import RungError, Start, load_rung

__all__ = ["beside"]

Complexes = NDArray[np.complex128]
Bools = NDArray[np.bool_]

SAME = (
    1e-2  # Distance, relative to each setting's largest, within which an answer is the motion, besides its own error.
)
THIRD = 1 / 16  # Bound of the third harmonic over the first, by beta a^2: it is half of that off resonance.


def beside(chain: Chain, setting: Setting, motion: Complexes, *, tol: float) -> Response:
    """The steady states beside known motions.

    Parameters
    ----------
    motion : complex128, shape (N, n), first harmonics, or deflections where nothing is driven.
    tol : as in `solve`.

    Returns
    -------
    Response; `NO_CONVERGENCE` where no answer is the motion.

    Raises
    ------
    RungError
        When `motion` has another shape or is not finite.
    """
    if motion.shape != (len(setting), setting.n) or not np.isfinite(motion).all():
        raise RungError(f"start: expected finite amplitudes of shape {(len(setting), setting.n)}, got {motion.shape}")
    work = Stats()
    for name in _worth_a_try(chain, setting, motion, tol):
        found = load_rung(name).solve(chain, setting, tol=tol, start=Start.REST)
        work, good = work + found.stats, _is(found, setting, motion)
        if bool((good & (found.error_estimate <= tol)).all()):
            return replace(found, stats=work)
    # What is left is on another branch than the lower one.
    if setting.epsilon.any():
        found = balance_near(chain, setting, motion, tol=tol)
        work, good = work + found.stats, _is(found, setting, motion)
    outcome = np.where(
        good | (found.outcome != Outcome.OK), found.outcome, np.array(Outcome.NO_CONVERGENCE, dtype=object)
    )
    outcome.flags.writeable = False
    return replace(found, outcome=outcome, stats=work)


def _worth_a_try(chain: Chain, setting: Setting, motion: Complexes, tol: float) -> tuple[str, ...]:
    """The rung of few terms that should meet `tol`, by what the cubic term does to the motion, and the one that will.

    It takes the share |v|/|kappa + v + i delta omega|, v = 3/4 beta a^2, of what holds an oscillator, and that adds up
    along a chain. A third harmonic acts back by its own share of that.
    """
    if not setting.epsilon.any():
        return ("static",)
    if not chain.betas.any():
        return ("linear",)
    scaled = ScaledChain.of(chain, setting)
    square = (np.abs(motion).T * scaled.length) ** 2
    bend = 0.75 * scaled.sign * square
    share = np.abs(bend) / np.hypot(scaled.k - scaled.omega**2 + bend, scaled.delta * scaled.omega)
    effect = share.sum(axis=0)
    if bool((effect <= tol).all()):
        return ("linear", "harmonic_balance")
    third = THIRD * (np.abs(scaled.sign) * square).max(axis=0)
    return ("one_harmonic", "harmonic_balance") if bool((effect * third <= tol).all()) else ("harmonic_balance",)


def _is(found: Response, setting: Setting, motion: Complexes) -> Bools:
    """Whether the answers are stable and are the motion; bool, shape (N,)."""
    felt = found.phasor if setting.epsilon.any() else found.mean
    size = np.abs(motion).max(axis=1)
    with np.errstate(invalid="ignore"):
        near = np.abs(felt - motion).max(axis=1) <= (SAME + found.error_estimate) * size
    return np.asarray(near & (found.outcome == Outcome.OK))
