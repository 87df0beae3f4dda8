"""What a solver of the ladder must supply, and the table that finds solvers by name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import StrEnum
from importlib import import_module
from typing import ClassVar

import numpy as np

from .equations.chain import Chain, Setting
from .errors import ChainError
from .model.response import Response

__all__ = ["DEFLECTION", "MAX_PERIODS", "RUNGS", "TERMS", "VIBRATION", "Rung", "RungError", "Start", "load_rung"]

RUNGS = {
    "static": ("chainsim.harmonic_balance.static", "StaticRung"),
    "linear": ("chainsim.harmonic_balance.linear", "LinearRung"),
    "one_harmonic": ("chainsim.harmonic_balance.one_harmonic", "OneHarmonicRung"),
    "harmonic_balance": ("chainsim.harmonic_balance.rung", "HarmonicBalanceRung"),
    "envelope": ("chainsim.averaging.rung", "EnvelopeRung"),
    "ode": ("chainsim.time_domain.ode", "OdeRung"),
}
"""Name -> module and class, the cheapest first. A module is imported when its rung is asked for."""

TERMS = frozenset({"nonlinearity", "third harmonic", "preload"})
"""Terms of a steady state that a rung may have beside the linear chain's."""

DEFLECTION, VIBRATION = "deflection", "vibration"

MAX_PERIODS = 60_000
"""Drive periods of the full equations after which a setting is out of budget: 75 e-folds at Q = 250."""


class RungError(ChainError, ValueError):
    """A rung was asked for something it cannot answer.

    Examples: no rung has that name; harmonic balance of a ring; every branch of more than one setting.
    """


class Start(StrEnum):
    """How the steady state is approached."""

    REST = "rest"
    RAMP = "ramp"
    ALL = "all"


class Rung(ABC):
    """One way to solve a chain for its periodic steady state. This text is the guide to writing another.

    A newcomer supplies

    1. `name`, the key under which it stands in `RUNGS` and which it writes into `Response.rung`;
    2. `order`, in words, how its error falls and in what; a test fits the slope;
    3. `valid`, in words, where it is true;
    4. `models`, which terms of the equation it has, of those in `TERMS`;
    5. `lists_branches`, whether start ``all`` gives every branch; False unless said;
    6. `answers`, what it is for, of `DEFLECTION` (nothing vibrates) and `VIBRATION`; vibrations unless said;
    7. `adjustable`, whether it works until `tol` is met; False, it gives what it has, unless said;
    8. `full_equations`, whether it follows them from rest, by compiled code; False unless said;
    9. `refusal`, one sentence why it cannot answer this question, or "" when it can;
    10. `steady`, the work itself;

    and a line in `RUNGS`, at the place that its price gives it.

    The base does the rest: `solve` raises the refusal as a `RungError`. Never override `solve`.

    `steady` treats every setting on its own: an answer does not depend on its neighbours in the batch. A
    solve that fails is an `Outcome` in the `Response` with NaN harmonics, never an exception and never a
    NaN marked ok. It fills `error_estimate` honestly (at least the true error, relative to the setting's
    largest amplitude), counts its work in `Stats`, sees no target and imports nothing heavy on import.

    With start ``rest`` a rung that integrates says which answer is reached from z = z' = 0; a rung
    that does not gives the lower branch. ``ramp`` is the lower branch as the drive grows slowly from 0,
    ``all`` is every branch of one setting, along the batch axis.
    """

    name: ClassVar[str]
    order: ClassVar[str]
    valid: ClassVar[str]
    models: ClassVar[frozenset[str]]
    lists_branches: ClassVar[bool] = False
    answers: ClassVar[frozenset[str]] = frozenset({VIBRATION})
    adjustable: ClassVar[bool] = False
    full_equations: ClassVar[bool] = False

    @abstractmethod
    def refusal(self, chain: Chain, setting: Setting, start: Start) -> str:
        """Why this rung cannot answer, in one sentence that names the cure; "" when it can."""

    @abstractmethod
    def steady(self, chain: Chain, setting: Setting, *, tol: float, start: Start) -> Response:
        """The steady states; `tol` is relative to each setting's largest amplitude."""

    def solve(self, chain: Chain, setting: Setting, *, tol: float, start: Start) -> Response:
        """Check the question and answer it.

        Raises
        ------
        RungError
            With the refusal.
        """
        refusal = self.refusal(chain, setting, start)
        if refusal:
            raise RungError(f"rung {self.name}: {refusal}")
        # A number out of range becomes an outcome, so NumPy need not warn of it.
        with np.errstate(all="ignore"):
            return self.steady(chain, setting, tol=tol, start=start)


def load_rung(name: str) -> Rung:
    """The rung of that name, its module imported only now.

    Raises
    ------
    RungError
        When there is no such rung.
    """
    if name not in RUNGS:
        raise RungError(f"rung {name!r}: expected one of auto, {', '.join(RUNGS)}")
    module, cls = RUNGS[name]
    rung: Rung = getattr(import_module(module), cls)()
    return rung
