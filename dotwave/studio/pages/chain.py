"""*Chain*: the simulator by hand, with an answer while one types."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from starlette.requests import Request
from starlette.responses import Response as Answer
from starlette.routing import Route

from chainsim import Branch, Chain, Outcome, Response, Setting, solve

from ...errors import bad_input
from ..fields import NumberField
from ..page import StudioPage, show

__all__ = ["PAGE"]

TOL, ROUGH_TOL = 1e-6, 1e-3
MAP_OMEGAS, MAP_EPSILONS = 21, 7
MOST_ANSWERS = 40
SETTING = (
    NumberField("epsilon", "epsilon", 1.175e-3, 0.0, 1.0, 0.0, 0.01, 5e-5, "amplitude of the drive, dimensionless"),
    NumberField("lam", "lam", 6.131e-3, 0.0, 10.0, 0.0, 0.1, 2e-4, "coupling of every link, dimensionless"),
    NumberField("omega", "omega", 1.0, 0.01, 100.0, 0.9, 1.1, 5e-4, "drive frequency over the resonance"),
)
BUILT = (
    NumberField("n", "Oscillators", 6, 1, 12, 1, 12, 1, "of the open chain", whole=True),
    NumberField("delta", "delta", 5.3006e-3, 1e-6, 0.99, 0.001, 0.1, 1e-4, "damping, 1/Q"),
    NumberField("beta", "beta", -1.0, -1e3, 1e3, -2.0, 2.0, 0.1, "cubic term; below 0 the resonance softens"),
)


def _page(request: Request) -> Answer:
    given = dict(request.query_params)
    values: dict[str, Any] = {"setting": SETTING, "built": BUILT, "why": "", "found": None}
    values["given"] = {one.name: given.get(one.name, f"{one.usual:g}") for one in (*SETTING, *BUILT)}
    try:
        values["found"] = _answer({one.name: one.of(given) for one in (*SETTING, *BUILT)})
    except bad_input() as error:
        values["why"] = str(error)
    return show(request, "chain.html", values, here="chain", status=400 if values["why"] else 200)


def _answer(asked: Mapping[str, float]) -> dict[str, Any]:
    """What the page shows of a setting, plain numbers."""
    chain = Chain(n=int(asked["n"]), delta=asked["delta"], beta=asked["beta"])
    setting = Setting.of(chain, epsilon=asked["epsilon"], lam=asked["lam"], omega=asked["omega"])
    reached = solve(chain, setting, tol=TOL, start="rest")
    every = solve(chain, setting, tol=TOL, start="all")
    phasor, outcome = reached.phasor[0], reached.outcome[0]
    steps = np.degrees(np.angle(phasor[1:] * np.conj(phasor[:-1])))
    rows = [_row(m, phasor, float(steps[m - 1]) if m else None, int(reached.branch[0, m])) for m in range(chain.n)]
    answers = [_one_of(every, k, phasor) for k in range(min(len(every), MOST_ANSWERS))]
    largest = float(np.nanmax(np.abs(phasor), initial=0.0))
    return {
        "ok": outcome is Outcome.OK, "sentence": outcome.sentence, "stable": bool(reached.stable[0]),
        "locked": bool(reached.locked[0]), "rows": rows, "largest": largest, "answers": answers, "of": len(every),
        "error": float(reached.error_estimate[0]), "rung": reached.rung, "epsilon": asked["epsilon"],
        "omega": asked["omega"], "map": _map(chain, asked["lam"]),
    }  # fmt: skip


def _row(m: int, phasor: NDArray[np.complex128], step: float | None, branch: int) -> dict[str, Any]:
    phase = float(np.degrees(np.angle(phasor[m])))
    named = Branch(branch).name.lower()
    return {"number": m + 1, "amplitude": float(abs(phasor[m])), "phase": phase, "step": step, "branch": named}


def _one_of(every: Response, k: int, reached: NDArray[np.complex128]) -> dict[str, Any]:
    """Answer `k` of all; `reached` is the one that a sudden drive leads to."""
    return {
        "stable": bool(every.stable[k]), "amplitude": np.abs(every.phasor[k]).tolist(),
        "branch": " ".join(Branch(int(one)).name.lower() for one in every.branch[k]),
        "reached": bool(np.allclose(every.phasor[k], reached, rtol=1e-3, atol=1e-9)),
        "multiplier": float(np.nanmax(np.abs(every.multipliers[k]), initial=0.0)),
    }  # fmt: skip


@lru_cache(maxsize=32)
def _map(chain: Chain, lam: float) -> dict[str, Any]:
    """The largest amplitude from rest over omega and epsilon, by one harmonic."""
    omegas: NDArray[np.float64] = np.linspace(0.9, 1.1, MAP_OMEGAS)
    epsilons: NDArray[np.float64] = np.linspace(0.0, 0.01, MAP_EPSILONS + 1)[1:]
    both = np.meshgrid(epsilons, omegas, indexing="ij")
    setting = Setting.of(chain, epsilon=both[0].ravel(), lam=lam, omega=both[1].ravel())
    found = solve(chain, setting, tol=ROUGH_TOL, rung="one_harmonic", start="rest")
    amplitude = np.abs(found.phasor).max(axis=1)
    ok = np.isfinite(amplitude) & np.array([outcome is Outcome.OK for outcome in found.outcome])
    shown = [float(one) if fine else None for one, fine in zip(amplitude, ok, strict=True)]
    return {
        "omegas": omegas.tolist(), "epsilons": epsilons.tolist(), "largest": float(amplitude[ok].max(initial=1e-30)),
        "amplitude": [shown[at : at + MAP_OMEGAS] for at in range(0, len(shown), MAP_OMEGAS)],
    }  # fmt: skip


PAGE = StudioPage(
    "chain",
    "Chain",
    "The simulator by hand: drive, coupling and frequency of a chain, and every answer it has.",
    (Route("/chain", _page),),
)
