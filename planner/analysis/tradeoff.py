"""Speed against accuracy on one's own scene: every rung and tolerance, measured against the dearest answer."""

from __future__ import annotations

import math
import time
import tracemalloc
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from chainsim import RUNGS, Device, Response, Stats, load_rung

from ..plan import FramePlan
from .questions import (
    FINEST,
    TOLS,
    Question,
    TradeoffError,
    answer,
    felt,
    positive,
    questions_of,
    refusal,
    same,
    seconds_words,
)

__all__ = ["Price", "Tradeoff", "TradeoffChoice", "TradeoffRow", "by_clock", "trade_off"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Run = Callable[[], list[Response]]
Price = Callable[[Run], tuple[list[Response], float]]
Answers = TypeVar("Answers")
"""Makes a run, and gives its answers and what they cost in seconds."""

REPEATS, LONG_S = 3, 0.3


@dataclass(frozen=True)
class TradeoffRow:
    """One rung at one tolerance.

    Attributes
    ----------
    tol : what it was asked for; None where the rung gives what it has.
    error, estimate : worst distance from the reference, and what the rung itself says, relative to each chain's
        largest amplitude, over the chains it has the planned motion of.
    seconds : best of a few runs, warm.
    memory : largest bytes in use; None where a run is long, since watching takes several times as long.
    work : of one run.
    solved : share of the chains it has the planned motion of.
    """

    rung: str
    tol: float | None
    error: float
    estimate: float
    seconds: float
    memory: int | None
    work: Stats
    solved: float

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types; null where not finite."""
        plain: dict[str, Any] = {
            name: (value if value is None or isinstance(value, str) or math.isfinite(value) else None)
            for name, value in vars(self).items()
            if name != "work"
        }
        return plain | {"work": {name: value for name, value in vars(self.work).items() if name != "seconds"}}


@dataclass(frozen=True)
class TradeoffChoice:
    """The row that answers a wish, whether the wish is met, and a sentence that says what was reached."""

    row: TradeoffRow
    met: bool
    sentence: str


@dataclass(frozen=True)
class Tradeoff:
    """What was measured.

    Attributes
    ----------
    states : distinct chains compared.
    reference : what `error` is measured from, in words.
    reference_error : to what that is known itself; smaller errors say no more than that.
    rows : cheapest rungs first.
    refused : rung -> why it cannot answer.
    skipped : chains that no rung compares.
    """

    device: str
    states: int
    reference: str
    reference_error: float
    rows: tuple[TradeoffRow, ...]
    refused: dict[str, str]
    skipped: int = 0

    @property
    def front(self) -> tuple[TradeoffRow, ...]:
        """Rows with all chains that no other beats in both time and error, the fastest first.

        Errors below what the reference is known to are alike.
        """
        best, found = math.inf, []
        for row in sorted(self.rows, key=lambda one: (one.seconds, one.error)):
            error = max(row.error, self.reference_error)
            if error < best and row.solved == 1:
                best = error
                found.append(row)
        return tuple(found)

    def within(self, budget_s: float) -> TradeoffChoice:
        """The most accurate answer in a time."""
        positive("budget", budget_s)
        fits = [row for row in self.front if row.seconds <= budget_s]
        row = fits[-1] if fits else self.front[0]
        asked = f"Best answer in {seconds_words(budget_s)}"
        return TradeoffChoice(
            row, bool(fits), f"{asked}: {_told(row)}." if fits else f"{asked}: none; the fastest, {_told(row)}."
        )

    def cheapest(self, tol: float) -> TradeoffChoice:
        """The fastest answer that is accurate enough."""
        positive("tol", tol)
        good = [row for row in self.front if row.error <= tol]
        row = good[0] if good else self.front[-1]
        asked = f"Cheapest answer to {tol:g}"
        return TradeoffChoice(
            row, bool(good), f"{asked}: {_told(row)}." if good else f"{asked}: none; the best, {_told(row)}."
        )

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        front = self.front
        rows = [row.as_dict() | {"front": row in front} for row in self.rows]
        return {
            "device": self.device, "states": self.states, "skipped": self.skipped, "reference": self.reference,
            "reference_error": self.reference_error,
            "rows": rows, "refused": self.refused,
        }  # fmt: skip


def _told(row: TradeoffRow) -> str:
    asked = "" if row.tol is None else f" at {row.tol:g}"
    return f"{row.rung}{asked} reaches {row.error:.1e} in {seconds_words(row.seconds)}"


def by_clock(run: Callable[[], Answers], clock: Callable[[], float] = time.perf_counter) -> tuple[Answers, float]:
    """The price of a run by the clock: the best of a few; a long one is made once."""
    seconds = math.inf
    for _ in range(REPEATS):
        began = clock()
        answers = run()
        seconds = min(seconds, clock() - began)
        if seconds > LONG_S:
            break
    return answers, seconds


def trade_off(frames: Iterable[FramePlan], device: Device, *, price: Price = by_clock) -> Tradeoff:
    """Solve a scene's chains with every rung that can, at every tolerance, and compare with the dearest answer.

    Parameters
    ----------
    price : what each rung and tolerance costs, asked in the order of the rows.

    Raises
    ------
    TradeoffError
        When nothing is felt in the scene, or nothing that a steady rung knows.
    """
    questions, skipped = questions_of(frames, device)
    if not questions:
        why = "every chain has several tones" if skipped else "nothing is felt in it"
        raise TradeoffError(f"scene: nothing to compare, {why}; give a text, levels or a wave of one tone")
    references = [_reference(one) for one in questions]
    known = max(each.error for each in references)
    rows, refused = [], {}
    for rung in (*RUNGS, "auto"):
        asked = [(_stand_in(rung, one, questions), one) for one in questions]
        why = next((text for name, one in asked if (text := refusal(name, one))), "")
        for tol in () if why else TOLS if rung == "auto" or load_rung(rung).adjustable else (None,):
            row = _measured(rung, tol, asked, [each.motion for each in references], price)
            if not row.solved:
                why = "it finds the planned motion of no chain"
                break
            rows.append(row)
        if why:
            refused[rung] = why
    states = sum(len(one.setting) for one in questions)
    words = "; ".join(sorted({each.words for each in references}))
    return Tradeoff(device.name, states, words, known, tuple(rows), refused, skipped)


def _stand_in(rung: str, question: Question, questions: list[Question]) -> str:
    """The rung itself; the static one for deflections beside vibrations that a rung of harmonics is asked for."""
    beside = question.still and any(not one.still for one in questions)
    return "static" if beside and refusal(rung, question) else rung


@dataclass(frozen=True)
class _Reference:
    """The dearest answers: motions, complex128, shape (P, n), to what they are known, and what they are in words."""

    motion: Complexes
    error: float
    words: str


def _reference(question: Question) -> _Reference:
    """The full equations, and harmonic balance beside the plan where a sudden drive leads elsewhere."""
    from chainsim import balance_near

    if question.still:
        near, beside = answer("auto", FINEST, question), "the static balance"
    else:
        near = balance_near(question.chain, question.setting, question.planned, tol=FINEST)
        beside = "harmonic balance beside the plan"
    motion, error = np.array(felt(near, question)), np.array(near.error_estimate)
    if refusal("ode", question):
        return _Reference(motion, float(error.max()), beside)
    ode = answer("ode", FINEST, question)
    reached = same(ode, question, question.planned)
    motion[reached], error[reached] = felt(ode, question)[reached], ode.error_estimate[reached]
    words, lost = "the full equations from rest", np.count_nonzero(~reached)
    if lost:
        words += f" ({lost} of {len(reached)} chains are lost by a sudden drive; for those {beside})"
    return _Reference(motion, float(error.max()), words)


def _measured(
    rung: str, tol: float | None, asked: list[tuple[str, Question]], truths: list[Complexes], price: Price
) -> TradeoffRow:
    first = [(name, Question(one.chain, one.setting[:1], one.planned[:1])) for name, one in asked]
    for name, one in first:
        # Imports and compiled code are no part of the price.
        answer(name, tol, one)
    answers, seconds = price(lambda: [answer(name, tol, one) for name, one in asked])
    memory = _memory(tol, asked) if seconds <= LONG_S else None
    told = [(found, one, truth) for found, (_, one), truth in zip(answers, asked, truths, strict=True)]
    known = np.concatenate([same(*each) for each in told])
    errors = np.concatenate([_errors(*each) for each in told])
    estimates = np.concatenate([found.error_estimate for found in answers])
    work = sum((found.stats for found in answers), Stats())
    error, estimate = (float(np.max(each[known], initial=0.0)) for each in (errors, estimates))
    return TradeoffRow(rung, tol, error, estimate, seconds, memory, work, float(known.mean()))


def _memory(tol: float | None, asked: list[tuple[str, Question]]) -> int:
    """Largest bytes in use."""
    tracemalloc.start()
    try:
        for name, one in asked:
            answer(name, tol, one)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def _errors(found: Response, question: Question, truth: Complexes) -> Floats:
    """Distance of each chain from the truth, relative to its largest amplitude."""
    return np.asarray(np.abs(felt(found, question) - truth).max(axis=1) / np.abs(truth).max(axis=1))
