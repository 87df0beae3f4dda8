"""The chains of planned frames as questions to the solvers, and how an answer is compared with a known motion."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import DEFLECTION, VIBRATION, Chain, Device, Outcome, Response, Setting, Start, load_rung, solve

from ..errors import PlanError
from ..operating_point import OperatingPoint, setting_of
from ..plan import FramePlan

__all__ = [
    "FINEST",
    "TOLS",
    "Question",
    "TradeoffError",
    "answer",
    "felt",
    "positive",
    "questions_of",
    "refusal",
    "same",
    "seconds_words",
]

Complexes = NDArray[np.complex128]

TOLS = (1e-2, 1e-4, 1e-6, 1e-9)
FINEST = 1e-12
# From rest a sudden drive may lead to another answer than the planned one: farther away than this it has.
SAME = 1e-2
ANOTHER = 1.0
LOST = (Outcome.ESCAPED, Outcome.NOT_LOCKED, Outcome.NO_CONVERGENCE)
# Distinct chains that are compared; a longer scene shows no others.
MOST_STATES = 64


class TradeoffError(PlanError, ValueError):
    """A trade-off cannot be measured.

    Examples: a scene in which nothing is felt; a tolerance and a budget that are not above 0.
    """


@dataclass(frozen=True)
class Question:
    """Chains of one kind that are solved in one call.

    Attributes
    ----------
    setting : P settings.
    planned : complex128, shape (P, n), the first harmonics the plan predicts, or deflections.
    """

    chain: Chain
    setting: Setting
    planned: Complexes

    @property
    def still(self) -> bool:
        """Whether these are deflections."""
        return not self.setting.epsilon.any()


def questions_of(frames: Iterable[FramePlan], device: Device) -> tuple[list[Question], int]:
    """The distinct chains of planned frames that can be made, vibrating and deflected ones apart, and how many are left
    out.

    Left out are chains with several tones, of which a steady rung knows nothing, and what is beyond `MOST_STATES`.
    """
    found: dict[bytes, OperatingPoint] = {}
    for frame in frames:
        for state in frame.states:
            if state.outcome is Outcome.OK and (state.moving or state.bias.any()):
                found[state.lam.tobytes() + state.bias.tobytes() + repr((state.epsilon, state.omega)).encode()] = state
    single = [state for state in found.values() if not state.tones]
    kept = single[:MOST_STATES]
    kinds = ([state for state in kept if state.moving], [state for state in kept if not state.moving])
    return [_question(device, states) for states in kinds if states], len(found) - len(kept)


def _question(device: Device, states: list[OperatingPoint]) -> Question:
    planned = np.array([state.phasor if state.moving else state.mean for state in states], dtype=np.complex128)
    return Question(device.chain, setting_of(device.chain, states), planned)


def refusal(rung: str, question: Question) -> str:
    """Why a rung cannot answer; "" when it can."""
    if rung == "auto":
        return ""
    solver = load_rung(rung)
    if question.still:
        return "" if DEFLECTION in solver.answers else "nothing vibrates; static is exact"
    if VIBRATION not in solver.answers:
        return "a vibration; use a rung with harmonics"
    return solver.refusal(question.chain, question.setting, Start.REST)


def answer(rung: str, tol: float | None, question: Question) -> Response:
    """Solve a question; a rung that gives what it has is asked for nothing.

    The plan has a way in of its own, so ``auto`` is not asked what a sudden drive would reach.
    """
    start = question.planned if rung == "auto" else "rest"
    return solve(question.chain, question.setting, tol=1.0 if tol is None else tol, rung=rung, start=start)


def felt(response: Response, question: Question) -> Complexes:
    """First harmonics of vibrating chains, deflections of the others; complex128, shape (P, n)."""
    return response.mean.astype(np.complex128) if question.still else response.phasor


def same(answer: Response, question: Question, motion: Complexes) -> NDArray[np.bool_]:
    """Which chains an answer has the known motion of, not another branch or none; bool, shape (P,)."""
    with np.errstate(invalid="ignore"):
        away = np.abs(felt(answer, question) - motion).max(axis=1)
    # An answer of low accuracy is an answer: only what misses by the motion itself is another one.
    near = away <= (SAME if load_rung(answer.rung).full_equations else ANOTHER) * np.abs(motion).max(axis=1)
    has = np.array([one not in LOST for one in answer.outcome])
    return np.asarray(near & has)


def seconds_words(seconds: float) -> str:
    """A time as people say it."""
    for size, unit in ((1.0, "s"), (1e-3, "ms")):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-6:.3g} us"


def positive(name: str, value: float) -> None:
    """Refuse what is not a finite number above 0."""
    if not (math.isfinite(value) and value > 0):
        raise TradeoffError(f"{name}: expected a number > 0, got {value}")
