"""Coefficients of the composition ABA(8,4) and the step it takes: five kicks where the grid's ABA(8,6,4) has seven.

Many devices are judged by what is felt, to a thousandth of full scale. Kicks of size eps leave an error of
eps h^8 + eps^2 h^4 in steps of h. McLachlan, BIT 35 (1995) 258-268.
"""

from __future__ import annotations

import numpy as np

__all__ = ["DISTINCT", "FLOWS", "KICKS", "KICK_TIMES", "LONGEST_STEP"]

_A1, _A2 = 0.07534696026989288842, 0.51791685468825678230
_B1, _B2 = 0.19022593937367661925, 0.84652407044352625706

FLOWS = np.array((_A1, _A2, 0.5 - _A1 - _A2, 0.5 - _A1 - _A2, _A2, _A1))
"""Lengths of the linear flows of one step, in steps."""

DISTINCT = 3
"""The first so many of them; the others are the same from the last one on."""

KICKS = np.array((_B1, _B2, 1 - 2 * (_B1 + _B2), _B2, _B1))
"""Weights of the kicks between them."""

KICK_TIMES = np.cumsum(FLOWS)[:5]
"""When the kicks happen, in steps from the start of the step."""

LONGEST_STEP = 0.125
"""In units of 1/omega of the stiffest actuator."""
