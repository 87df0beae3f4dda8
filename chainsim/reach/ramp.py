"""What a slowly raised drive ends on where its branch folds on the way: by the envelope, else by the full equations.

Up to the fold the branch that starts at 0 is followed by any steady rung. Past it the motion jumps, and where it lands
is a question of how it moves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..averaging.decide import SAME, decide
from ..equations.chain import Chain, Setting
from ..harmonic_balance.answer import stitch
from ..harmonic_balance.rung import balance_near
from ..model.response import Outcome, Response, Stats
from ..rung import Start

__all__ = ["from_ramp"]


def from_ramp(chain: Chain, setting: Setting, steady: Response, *, tol: float, max_periods: int) -> Response:
    """`steady`, what a rung says of a ramp, with its settings past a fold answered by following them.

    Parameters
    ----------
    steady : answers on the branch from 0; `NO_CONVERGENCE` where it ends in a fold.
    tol : as in `solve`.
    max_periods : drive periods of the full equations after which a setting is out of budget.
    """
    lost = np.flatnonzero((steady.outcome == Outcome.NO_CONVERGENCE) & (setting.epsilon != 0))
    if not len(lost) or not chain.deltas.min() > 0:
        return steady
    decision = decide(chain, setting[lost], Start.RAMP)
    found = np.flatnonzero(decision.sure)
    good = np.zeros(len(lost), dtype=bool)
    kept = np.setdiff1d(np.arange(len(setting)), lost)
    parts = [(kept, replace(_some(steady, kept), stats=steady.stats))] if len(kept) else []
    if len(found):
        near = balance_near(chain, setting[lost[found]], decision.phasor[found], tol=tol)
        with np.errstate(invalid="ignore"):
            same = (np.abs(near.phasor - decision.phasor[found]) <= SAME * np.abs(near.phasor)).all(axis=1)
        same &= near.outcome == Outcome.OK
        good[found[same]] = True
        if same.any():
            parts.append((lost[found[same]], _some(near, np.flatnonzero(same))))
    if not good.all():
        from ..time_domain.ode import steady_from_ramp

        rest = lost[~good]
        parts.append((rest, steady_from_ramp(chain, setting[rest], tol=max(tol, 1e-12), max_periods=max_periods)))
    names = {part.rung for _, part in parts}
    rung = names.pop() if len(names) == 1 else "ode" if "ode" in names else steady.rung
    whole = stitch(rung, len(setting), parts)
    return replace(whole, stats=whole.stats + decision.stats)


def _some(response: Response, index: NDArray[np.int64]) -> Response:
    return replace(
        response,
        outcome=response.outcome[index], harmonics=response.harmonics[index], mean=response.mean[index],
        stable=response.stable[index], locked=response.locked[index], multipliers=response.multipliers[index],
        branch=response.branch[index], error_estimate=response.error_estimate[index], stats=Stats(),
    )  # fmt: skip
