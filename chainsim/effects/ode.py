"""The full equations with extra terms, from rest, by a fixed step."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..equations.chain import Chain, Setting
from ..model.response import Outcome, Stats
from .effects import BoucWen, Play, Terms, TermsError, Tone
from .kernel import Plant, advance

__all__ = ["LONGEST", "Motion", "Walk", "integrate_terms"]

Floats = NDArray[np.float64]

LONGEST = 1.0
"""Phase of the fastest oscillation or decay in one step; the classical method is stable to 2.78."""


@dataclass(frozen=True)
class Motion:
    """How the tips moved.

    Attributes
    ----------
    tau : float64, shape (K,).
    tip : float64, shape (K, n), tip displacement; shorter than asked where it escaped.
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


class Walk:
    """One setting on its way from rest (z = z' = 0, no hysteresis, amplifier at 0), stretch by stretch.

    Parameters
    ----------
    ramp : tau over which the drive is raised from 0; 0 for a sudden drive.

    Raises
    ------
    TermsError
        When `setting` is not one setting of `chain`.
    """

    def __init__(self, chain: Chain, setting: Setting, terms: Terms, *, ramp: float) -> None:
        self.plant = _plant(chain, setting, terms, ramp)
        columns = 3 + len(self.plant.creep) + 2 * len(self.plant.modes)
        self.state = np.zeros((chain.n + 1, columns))
        self.play = np.zeros((chain.n, len(self.plant.radius)))
        self.tau = 0.0
        self.evals = 0
        softest = self.plant.beta.min()
        self._limit = 50 / math.sqrt(float(np.abs(self.plant.beta).max())) if softest < 0 else 1e9

    @property
    def fastest(self) -> float:
        """A bound of every rate, per tau: `LONGEST` over it is the longest step."""
        return _fastest(self.plant)

    @property
    def relaxed(self) -> Floats:
        """The creeps' slow parts, a view; float64, shape (n, C)."""
        return self.state[:-1, 3 : 3 + len(self.plant.creep)]

    def go(self, rows: int, every: int, h: float) -> Floats:
        """Take ``rows every`` steps of `h`; the tips after each `every`, shape (rows, n), fewer rows once escaped."""
        tip = np.empty((rows, len(self.plant.lam)))
        done = advance(self.state, self.play, self.plant, self.tau, h, every, self._limit, tip)
        self.tau += rows * every * h
        self.evals += 4 * rows * every * tip.shape[1]
        return tip[:done]


def integrate_terms(
    chain: Chain, setting: Setting, terms: Terms, *, duration: float, step: float, every: int
) -> Motion:
    """Integrate one setting from rest (z = z' = 0, no hysteresis, amplifier at 0) by the classical Runge-Kutta method.

    Parameters
    ----------
    duration : tau to cover.
    step : longest step in tau; errors fall with its fourth power, with play operators (which have corners) and a
        slewing or limited amplifier with its second.
    every : steps between two kept instants.

    Raises
    ------
    TermsError
        With the argument and its value.
    """
    began = time.perf_counter()
    walk = Walk(chain, setting, terms, ramp=0.0)
    if not (math.isfinite(duration) and duration > 0 and step > 0 and every >= 1):
        raise TermsError(f"duration, step, every: expected numbers > 0, got {duration}, {step}, {every}")
    fastest = walk.fastest
    if step * fastest > LONGEST:
        raise TermsError(f"step: expected at most {LONGEST / fastest:.4g} for a rate of {fastest:.4g}, got {step}")
    rows = max(1, round(duration / (step * every)))
    h = duration / (rows * every)
    tip = walk.go(rows, every, h)
    tau = np.arange(1.0, len(tip) + 1) * (every * h)
    for array in (tau, tip):
        array.flags.writeable = False
    stats = Stats(rhs_evals=walk.evals, seconds=time.perf_counter() - began)
    return Motion(tau, tip, Outcome.OK if len(tip) == rows else Outcome.ESCAPED, stats)


def _plant(chain: Chain, setting: Setting, terms: Terms, ramp: float) -> Plant:
    if len(setting) != 1 or setting.n != chain.n:
        raise TermsError(f"setting: expected one setting of the chain, got {len(setting)} of {setting.n}")
    each, none = np.ones(chain.n), np.empty(0)
    law, lam = chain.law, setting.lam[0]
    other = law.second(lam, None if setting.lam_y is None else setting.lam_y[0])
    one = Tone(float(setting.epsilon[0]), float(setting.omega[0]), float(setting.phase[0]))
    tones = np.array([[t.epsilon, t.omega, t.phase] for t in terms.tones or (one,)])
    amplifier, hysteresis, creep = terms.amplifier, terms.hysteresis, terms.creep
    bouc, radius, weight, base = none, none, none, 1.0
    if isinstance(hysteresis, BoucWen):
        bouc = np.array([hysteresis.gain, hysteresis.loading, hysteresis.unloading])
    elif isinstance(hysteresis, Play):
        radius, weight, base = np.array(hysteresis.radius), np.array(hysteresis.weight), hysteresis.base
    modes = np.array([[mode.omega**2, mode.delta, mode.gain] for mode in terms.modes or ()]).reshape(-1, 3)
    return Plant(
        chain.deltas * each, chain.betas * each, chain.stiffness * each,
        np.array(lam), 0.0 * each if other is None else np.array(other), law.stride, law.back,
        np.array(setting.bias[0]), float(setting.preload[0]), tones, ramp,
        none if amplifier is None else np.array([amplifier.bandwidth, amplifier.slew, amplifier.limit]),
        bouc, radius, weight, base,
        none if creep is None else 1 / np.array(creep.times), 0.0 if creep is None else creep.per_decade / creep.each,
        modes,
    )  # fmt: skip


def _fastest(plant: Plant) -> float:
    links = float((np.abs(plant.lam) + np.abs(plant.other)).max())
    share = 1 + float(np.abs(plant.modes[:, 2]).sum())
    own = math.sqrt(float(np.abs(plant.stiffness).max()) + 2 * share * links)
    rates = [own, float(plant.delta.max()), float(np.abs(plant.tones[:, 1]).max())]
    rates += [math.sqrt(float(row[0] + 2 * abs(row[2]) * links)) for row in plant.modes]
    rates += [float(plant.amplifier[0])] if len(plant.amplifier) else []
    rates += [float(plant.creep.max())] if len(plant.creep) else []
    return max(rates)
