"""A grid of chains with hysteresis and creep under sampled forces, whose actuators may change while they move."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..compiled import compiled
from ..inlined import inlined
from .effects import Creep, Play, TermsError
from .kernel import Plant, beside, push_plays, slope

__all__ = ["SampledGrid"]

Floats = NDArray[np.float64]

# Phase of the fastest oscillation in one step: the classical method then puts it off by 2e-6 of its frequency.
_LONGEST_STEP = 0.125


@inlined
def _aim(plant: Plant, last: Floats, force: Floats, lam: Floats, part: float) -> None:
    """Set force and links of a plant to those at `part` of the way from the last sample to the next."""
    for m in range(len(plant.lam)):
        plant.bias[m] = last[0, m] + part * (force[m] - last[0, m])
        plant.lam[m] = last[1, m] + part * (lam[m] - last[1, m])


@compiled
def _advance(
    state: Floats, play: Floats, plant: Plant, last: Floats, force: Floats, lam: Floats, h: float, steps: int,
    limit: float, seen: Floats,
) -> None:  # fmt: skip
    """Move from sample to sample by `steps` classical Runge-Kutta steps of `h`; both are linear between samples.

    `last`, float64, shape (2, n), has force and lam at the sample before. An oscillator beyond `limit` is put to rest.
    """
    n = len(plant.lam)
    work, scratch = np.zeros((5, state.shape[0], state.shape[1])), np.zeros((3, max(n, 3)))
    for k in range(len(force)):
        for j in range(steps):
            _aim(plant, last, force[k], lam[k], j / steps)
            slope(0.0, state, play, plant, scratch, work[0])
            _aim(plant, last, force[k], lam[k], (j + 0.5) / steps)
            beside(state, 0.5 * h, work, 0)
            slope(0.0, work[4], play, plant, scratch, work[1])
            beside(state, 0.5 * h, work, 1)
            slope(0.0, work[4], play, plant, scratch, work[2])
            _aim(plant, last, force[k], lam[k], (j + 1) / steps)
            beside(state, h, work, 2)
            slope(0.0, work[4], play, plant, scratch, work[3])
            for m in range(n):
                for i in range(state.shape[1]):
                    state[m, i] += (h / 6) * (work[0, m, i] + 2 * work[1, m, i] + 2 * work[2, m, i] + work[3, m, i])
            if len(plant.radius):
                push_plays(0.0, state, play, plant, scratch)
        for m in range(n):
            if not abs(state[m, 0]) <= limit:
                state[m, :], play[m, :] = 0.0, 0.0
            last[0, m], last[1, m], seen[k, m] = force[k, m], lam[k, m], state[m, 0]


class SampledGrid:
    """Chains side by side under sampled forces, as `GridIntegrator`, with hysteresis and creep in every actuator.

    Force and lam are linear between samples. Everything is at rest before the first. The result does not depend on how
    the samples are cut into blocks, as long as stiffness and damping change at the same samples. An actuator that
    leaves its well (|z| beyond 50/sqrt|beta|) falls back to rest.

    Parameters
    ----------
    shape : rows and columns.
    chain_length : actuators a chain; divides the columns.
    beta : of every actuator, a number or float64, shape (rows, cols).
    ring : whether each chain's last actuator feeds its first.
    dtau : tau from a sample to the next.
    stiffest : no stiffness, with twice the lam of its link, will be larger; it sets the steps between samples.
    hysteresis, creep : of the electric force; None: there is none.

    Raises
    ------
    TermsError
        When the creep begins too fast to be followed from sample to sample.
    """

    def __init__(
        self, *, shape: tuple[int, int], chain_length: int, beta: ArrayLike, ring: bool, dtau: float, stiffest: float,
        hysteresis: Play | None, creep: Creep | None,
    ) -> None:  # fmt: skip
        self._shape = shape
        # Open chains are one long row with links of 0 between them; rings close, each by itself.
        self._strip = chain_length if ring else shape[0] * shape[1]
        self._first = None if ring else chain_length
        self._steps = math.ceil(dtau * math.sqrt(stiffest) / _LONGEST_STEP)
        self._h = dtau / self._steps
        if creep is not None and self._h > creep.first:
            raise TermsError(
                f"creep.first: expected at least {self._h:.3g}, the step of the samples, got {creep.first}"
            )
        betas = np.broadcast_to(np.asarray(beta, dtype=np.float64), shape).reshape(-1, self._strip)
        self._plants = [_plant(strip, hysteresis, creep) for strip in betas]
        columns = 3 + len(self._plants[0].creep)
        self._states = np.zeros((len(betas), self._strip + 1, columns))
        self._plays = np.zeros((len(betas), self._strip, len(self._plants[0].radius)))
        self._last = np.zeros((len(betas), 2, self._strip))
        softest = float(betas.min())
        self._limit = 50 / math.sqrt(-softest) if softest < 0 else 1e9

    def advance(self, force: Floats, lam: Floats, *, stiffness: Floats, delta: Floats) -> Floats:
        """Move through the next S samples.

        Parameters
        ----------
        force : float64, shape (S, rows, cols), the electric force of drive and bias, dimensionless.
        lam : float64, shape (S, rows, cols), as `GridIntegrator.advance` has it.
        stiffness, delta : float64, shape (rows, cols), of every actuator at these samples.

        Returns
        -------
        float64, shape (S, rows, cols): z at the samples.
        """
        strips = (len(force), len(self._plants), self._strip)
        forces, links = force.reshape(strips), np.array(lam).reshape(strips)
        if self._first is not None:
            links[:, :, :: self._first] = 0.0
        z, seen = np.empty(strips), np.empty((len(force), self._strip))
        own = (stiffness.reshape(strips[1:]), delta.reshape(strips[1:]))
        for i, plant in enumerate(self._plants):
            plant.stiffness[:], plant.delta[:] = own[0][i], own[1][i]
            _advance(
                self._states[i], self._plays[i], plant, self._last[i], np.ascontiguousarray(forces[:, i]),
                np.ascontiguousarray(links[:, i]), self._h, self._steps, self._limit, seen,
            )  # fmt: skip
            z[:, i] = seen
        return z.reshape(len(force), *self._shape)


def _plant(betas: Floats, hysteresis: Play | None, creep: Creep | None) -> Plant:
    """A strip of oscillators whose force, links, stiffness and damping are set sample by sample."""
    n, none = len(betas), np.empty(0)
    plays = (none, none, 1.0)
    if hysteresis is not None:
        plays = (np.array(hysteresis.radius), np.array(hysteresis.weight), hysteresis.base)
    return Plant(
        np.zeros(n), np.array(betas), np.zeros(n), np.zeros(n), np.zeros(n), 1, 1.0, np.zeros(n), 0.0,
        np.empty((0, 3)), 0.0, none, none, *plays,
        none if creep is None else 1 / np.array(creep.times), 0.0 if creep is None else creep.per_decade / creep.each,
        np.empty((0, 3)),
    )  # fmt: skip
