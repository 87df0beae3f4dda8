"""Which solver answers a chain with extra terms: the integration carries all of them, harmonic balance some."""

from __future__ import annotations

import time
from dataclasses import fields, replace

import numpy as np

from ..equations.chain import Chain, Setting
from ..model.response import Outcome, Stats
from ..rung import RungError, Start
from .balance import balance_refusal, balance_with_terms
from .effects import Terms
from .lines import Lines
from .steady import Steady, steady_with_terms
from .tones import two_tones

__all__ = ["solve_with_terms"]

# Accuracy at which an integration says which answer is reached, and distance at which another solver's is the same.
ROUGH = 1e-3
SAME_ORBIT = 1e-2
ORDERS = (3, 5, 7)


def solve_with_terms(chain: Chain, setting: Setting, terms: Terms, *, tol: float, rung: str, start: Start) -> Steady:
    """The steady state of one setting of a chain with `terms`.

    Parameters
    ----------
    rung : ``ode``, which carries every term; ``harmonic_balance``, which carries creep, modes and an amplifier's
        bandwidth, or two tones of an open chain; or ``auto``, the integration, refined by harmonic balance where that
        carries the terms.

    Raises
    ------
    RungError
        When the rung does not carry the terms, or for start all.
    """
    if start is Start.ALL:
        raise RungError("start all: branches are listed without terms; use start rest or ramp, or leave terms out")
    refusal = _refusal(chain, setting, terms)
    if rung == "ode" or (rung == "auto" and refusal):
        return steady_with_terms(chain, setting, terms, tol=tol, start=start)
    if rung == "harmonic_balance" and not refusal:
        return _balanced(chain, setting, terms, tol, None)
    if rung != "auto":
        carried = f"it does not carry {refusal or ', '.join(_names(terms))}"
        raise RungError(f"rung {rung}: {carried}; use rung ode or auto")
    reached = steady_with_terms(chain, setting, terms, tol=max(tol, ROUGH), start=start)
    if reached.outcome is not Outcome.OK or reached.error_estimate <= tol:
        return reached
    sharp = _balanced(chain, setting, terms, tol, reached)
    if sharp.outcome is Outcome.OK and _same(reached, sharp):
        return replace(sharp, stable=True, drift=reached.drift, stats=reached.stats + sharp.stats)
    return steady_with_terms(chain, setting, terms, tol=tol, start=start)


def _names(terms: Terms) -> list[str]:
    return [each.name for each in fields(terms) if getattr(terms, each.name) is not None]


def _refusal(chain: Chain, setting: Setting, terms: Terms) -> str:
    """What harmonic balance does not carry, or ""."""
    count = len(terms.tones or (0,))
    if count == 1:
        return balance_refusal(chain, terms)
    others = [name for name in _names(terms) if name != "tones"]
    if others:
        return f"{', '.join(others)} with several tones"
    if count != 2:
        return f"{count} tones"
    if not chain.law.in_line:
        return f"two tones of a {chain.law.name}"
    return "two tones with bias or preload" if setting.bias.any() or setting.preload.any() else ""


def _balanced(chain: Chain, setting: Setting, terms: Terms, tol: float, near: Steady | None) -> Steady:
    if not terms.tones:
        return balance_with_terms(chain, setting, terms, tol=tol, guide=near)
    return _two_tones(chain, setting, terms, tol)


def _two_tones(chain: Chain, setting: Setting, terms: Terms, tol: float) -> Steady:
    began = time.perf_counter()
    assert terms.tones is not None
    first, second = terms.tones
    for order in ORDERS:
        found = two_tones(chain, setting, (first, second), order=order)
        if found.outcome is not Outcome.OK or found.error_estimate <= tol:
            break
    outcome = found.outcome
    if outcome is Outcome.OK and not found.error_estimate <= tol:
        outcome = Outcome.OUT_OF_BUDGET
    stats = Stats(oscillators_solved=chain.n, seconds=time.perf_counter() - began)
    below = found.omega < 0
    lines = Lines(np.where(below[:, None], -found.index, found.index), np.abs(found.omega))
    amplitude = np.where(below[:, None], found.harmonics.conj(), found.harmonics)
    mean = np.where(np.isfinite(found.harmonics[0]), 0.0, np.nan)
    return Steady(outcome, "harmonic_balance", lines, amplitude, mean, found.error_estimate, None, None, None, stats)


def _same(reached: Steady, sharp: Steady) -> bool:
    """Whether the lines of the tones are alike."""
    size = max(float(np.abs(sharp.amplitude).max()), float(np.abs(sharp.mean).max()))
    away = [float(np.abs(reached.mean - sharp.mean).max())]
    for k in np.eye(sharp.lines.index.shape[1], dtype=int):
        mine, other = reached.lines.place(*k), sharp.lines.place(*k)
        if mine is None or other is None:
            return False
        away.append(float(np.abs(reached.amplitude[mine] - sharp.amplitude[other]).max()))
    return max(away) <= SAME_ORBIT * size
