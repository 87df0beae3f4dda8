"""The full equations with extra terms, from rest, by a fixed step."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .chain import Chain, Closure, CouplingKind, Setting
from .response import Outcome, Stats
from .terms import BoucWen, Play, Terms, TermsError, Tone
from .terms_kernel import Plant, advance

__all__ = ["Motion", "integrate_terms"]

Floats = NDArray[np.float64]

# Phase of the fastest oscillation or decay in one step; the classical method is stable to 2.78.
LONGEST = 1.0


@dataclass(frozen=True)
class Motion:
    """How the tips moved.

    Attributes
    ----------
    tau : float64, shape (K,). tip : float64, shape (K, n), tip displacement; shorter than asked where it escaped.
    outcome : ok, or escaped (|z| passed 50/sqrt|beta|, or 1e9).
    stats : `rhs_evals` counts evaluations of one oscillator.
    """

    tau: Floats
    tip: Floats
    outcome: Outcome
    stats: Stats

    def line(self, omega: float, *, since: float) -> NDArray[np.complex128]:
        """Complex amplitude at `omega` after `since`, by least squares with a constant; complex128, shape (n,)."""
        late = self.tau > since
        angle = omega * self.tau[late]
        columns = np.stack([np.cos(angle), -np.sin(angle), np.ones_like(angle)], axis=1)
        found = np.linalg.lstsq(columns, self.tip[late], rcond=None)[0]
        phasor: NDArray[np.complex128] = found[0] + 1j * found[1]
        return phasor


def integrate_terms(
    chain: Chain, setting: Setting, terms: Terms, *, duration: float, step: float, every: int
) -> Motion:
    """Integrate one setting from rest (z = z' = 0, no hysteresis, amplifier at 0) by the classical Runge-Kutta method.

    Parameters
    ----------
    duration : tau to cover. step : longest step in tau; errors fall with its fourth power, with play operators (which
        have corners) and a slewing or limited amplifier with its second. every : steps between two kept instants.

    Raises
    ------
    TermsError
        With the argument and its value.
    """
    began = time.perf_counter()
    plant = _plant(chain, setting, terms)
    if not (math.isfinite(duration) and duration > 0 and step > 0 and every >= 1):
        raise TermsError(f"duration, step, every: expected numbers > 0, got {duration}, {step}, {every}")
    fastest = _fastest(plant)
    if step * fastest > LONGEST:
        raise TermsError(f"step: expected at most {LONGEST / fastest:.4g} for a rate of {fastest:.4g}, got {step}")
    rows = max(1, round(duration / (step * every)))
    h = duration / (rows * every)
    columns = 3 + len(plant.creep) + 2 * len(plant.modes)
    state, play = np.zeros((chain.n + 1, columns)), np.zeros((chain.n, len(plant.radius)))
    beta = float(np.abs(plant.beta).max())
    limit = 50 / math.sqrt(beta) if plant.beta.min() < 0 else 1e9
    tip = np.empty((rows, chain.n))
    done = advance(state, play, plant, 0.0, h, every, limit, tip)
    tau = np.arange(1.0, done + 1) * (every * h)
    tip = tip[:done]
    for array in (tau, tip):
        array.flags.writeable = False
    stats = Stats(rhs_evals=4 * rows * every * chain.n, seconds=time.perf_counter() - began)
    return Motion(tau, tip, Outcome.OK if done == rows else Outcome.ESCAPED, stats)


def _plant(chain: Chain, setting: Setting, terms: Terms) -> Plant:
    if len(setting) != 1 or setting.n != chain.n:
        raise TermsError(f"setting: expected one setting of the chain, got {len(setting)} of {setting.n}")
    if chain.rows > 1 or chain.closure is Closure.BIDIRECTIONAL:
        raise TermsError(
            "chain: terms are integrated for open chains and rings; a grid or bidirectional chain has none"
        )
    each = np.ones(chain.n)
    back = float(chain.kind is CouplingKind.RESISTOR)
    one = Tone(float(setting.epsilon[0]), float(setting.omega[0]), float(setting.phase[0]))
    tones = np.array([[t.epsilon, t.omega, t.phase] for t in terms.tones or (one,)])
    amplifier, hysteresis, creep, none = terms.amplifier, terms.hysteresis, terms.creep, np.empty(0)
    bouc, radius, weight, base = none, none, none, 1.0
    if isinstance(hysteresis, BoucWen):
        bouc = np.array([hysteresis.gain, hysteresis.loading, hysteresis.unloading])
    elif isinstance(hysteresis, Play):
        radius, weight, base = np.array(hysteresis.radius), np.array(hysteresis.weight), hysteresis.base
    modes = np.array([[mode.omega**2, mode.delta, mode.gain] for mode in terms.modes or ()]).reshape(-1, 3)
    return Plant(
        chain.deltas * each, chain.betas * each, chain.stiffness * each, np.array(setting.lam[0]), back,
        np.array(setting.bias[0]), float(setting.preload[0]), tones,
        none if amplifier is None else np.array([amplifier.bandwidth, amplifier.slew, amplifier.limit]),
        bouc, radius, weight, base, none if creep is None else 1 / np.array(creep.times),
        0.0 if creep is None else creep.per_decade / creep.each, modes,
    )  # fmt: skip


def _fastest(plant: Plant) -> float:
    """A bound of every rate, per tau."""
    share = 1 + float(np.abs(plant.modes[:, 2]).sum())
    own = math.sqrt(float((np.abs(plant.stiffness) + share * np.abs(plant.lam)).max()))
    rates = [own, float(plant.delta.max()), float(np.abs(plant.tones[:, 1]).max())]
    rates += [math.sqrt(float(row[0] + abs(row[2]) * np.abs(plant.lam).max())) for row in plant.modes]
    rates += [float(plant.amplifier[0])] if len(plant.amplifier) else []
    rates += [float(plant.creep.max())] if len(plant.creep) else []
    return max(rates)
