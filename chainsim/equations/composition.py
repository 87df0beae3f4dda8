"""Coefficients of the composition ABA(8,6,4): flows of each oscillator alone, kicks by links and cubic terms between.

Blanes, Casas, Farres, Laskar, Makazaga and Murua, Appl. Numer. Math. 68 (2013) 58-72.
"""

from __future__ import annotations

import numpy as np

__all__ = ["FLOWS", "KICKS", "KICK_TIMES"]

_A = (0.0711334264982231177779387300061549964174, 0.241153427956640098736487795326289649618,
      0.521411761772814789212136078067994229991, -0.333698616227678005726562603400438876027)  # fmt: skip
_B = (0.183083687472197221961703757166430291072, 0.310782859898574869507522291054262796375,
      -0.0265646185119588006972121379164987592663, 0.0653961422823734184559721793911134363710)  # fmt: skip

FLOWS = np.array((*_A, *_A[::-1]))
"""Lengths of the eight linear flows of one step, in steps."""

KICKS = np.array((*_B, *_B[2::-1]))
"""Weights of the seven kicks between them."""

KICK_TIMES = np.cumsum(FLOWS)[:7]
"""When the kicks happen, in steps from the start of the step."""
