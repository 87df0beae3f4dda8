"""A chain whose piezos play and whose amplifier slews and is cut off, by SciPy's DOP853 from one corner to the next.

It is written from the equations and shares nothing with chainsim: where chainsim takes short steps over the corners of
a play operator, this stops at each of them, finds it to rounding and goes on with the next smooth piece.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

__all__ = ["PlayingChain"]

Floats = NDArray[np.float64]
Event = Callable[[float, Floats], float]
STILL = 1e-13
ACCURACY = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-13, "max_step": 0.1}


@dataclass(frozen=True)
class _Corner:
    """Where `event` crosses 0 in the sense `way`, play `one` of oscillator m begins to slide, or all its plays wait."""

    event: Event
    way: int
    m: int
    one: int | None


@dataclass(frozen=True)
class PlayingChain:
    """``z'' + delta z' + z + beta z^3 = base e + sum_i weight_i P_i[e]``, ``e = links z + drive on the first``.

    `links` is float64, shape (n, n), `bandwidth` the amplifier's, None for none: then slew and limit say nothing.
    """

    delta: float
    beta: float
    links: Floats
    epsilon: float
    omega: float
    base: float = 1.0
    radius: tuple[float, ...] = ()
    weight: tuple[float, ...] = ()
    bandwidth: float | None = None
    slew: float = np.inf
    limit: float = np.inf

    def tips(self, at: Floats) -> Floats:
        """z at the instants `at` (increasing, > 0) from rest, shape (K, n)."""
        tau, state, radius = 0.0, np.zeros(2 * len(self.links) + 1), np.array(self.radius)
        begin = self._pulled(tau, state)[0][:, None]
        # What sets in suddenly pushes the plays along; then they wait.
        held = np.clip(np.zeros((len(self.links), len(radius))), begin - radius, begin + radius)
        slides = np.zeros(held.shape, dtype=np.int64)
        rows: list[Floats] = []
        while tau < at[-1]:
            corners = self._corners(held, slides)
            slope = self._slope(held, slides)
            ran = solve_ivp(slope, (tau, at[-1]), state, dense_output=True, events=_events(corners), **ACCURACY)
            rows += [ran.sol(each)[: len(self.links)] for each in at[(at > tau) & (at <= ran.t[-1])]]
            tau, state = float(ran.t[-1]), ran.y[:, -1]
            for corner in (corner for corner, times in zip(corners, ran.t_events, strict=True) if len(times)):
                if corner.one is None:
                    e = self._pulled(tau, state)[0][corner.m]
                    held[corner.m] = np.where(slides[corner.m], e - slides[corner.m] * radius, held[corner.m])
                    slides[corner.m] = 0
                else:
                    slides[corner.m, corner.one] = corner.way
        return np.array(rows)

    def _drive(self, tau: float, u: float) -> tuple[float, float, float]:
        """The force of the drive, how fast it changes, and u'."""
        wanted = self.epsilon * np.cos(self.omega * tau)
        if self.bandwidth is None:
            return wanted, -self.epsilon * self.omega * np.sin(self.omega * tau), 0.0
        rate = float(np.clip(self.bandwidth * (wanted - u), -self.slew, self.slew))
        return float(np.clip(u, -self.limit, self.limit)), rate if abs(u) < self.limit else 0.0, rate

    def _pulled(self, tau: float, state: Floats) -> tuple[Floats, Floats]:
        """The electric forces e and how fast they change, shape (n,) each."""
        n = len(self.links)
        force, change, _ = self._drive(tau, state[-1])
        first = np.eye(n)[0]
        return self.links @ state[:n] + force * first, self.links @ state[n:-1] + change * first

    def _slope(self, held: Floats, slides: NDArray[np.int64]) -> Callable[[float, Floats], Floats]:
        n, held, slides = len(self.links), held.copy(), slides.copy()

        def slope(tau: float, state: Floats) -> Floats:
            z, v, e = state[:n], state[n:-1], self._pulled(tau, state)[0]
            played = np.where(slides, e[:, None] - slides * np.array(self.radius), held)
            force = self.base * e + played @ np.array(self.weight)
            rate = self._drive(tau, state[-1])[2]
            return np.concatenate([v, force - self.delta * v - z - self.beta * z**3, [rate]])

        return slope

    def _corners(self, held: Floats, slides: NDArray[np.int64]) -> list[_Corner]:
        """A play that waits begins to slide where e has moved by its radius; those that slide wait where e turns."""
        found = []
        for m in range(len(self.links)):
            found += [self._turn(m, way) for way in (1, -1) if (slides[m] == way).any()]
            for one in np.flatnonzero(slides[m] == 0):
                # A drive that is cut off may stand still at the edge: that is no crossing.
                reach = float(self.radius[one]) + STILL
                found += [self._edge(m, int(one), way, float(held[m, one]) + way * reach) for way in (1, -1)]
        return found

    def _turn(self, m: int, way: int) -> _Corner:
        """Where e of oscillator m, which goes `way`, turns."""
        return _Corner(lambda tau, state: float(self._pulled(tau, state)[1][m]), -way, m, None)

    def _edge(self, m: int, one: int, way: int, edge: float) -> _Corner:
        """Where e of oscillator m passes `edge`, going `way`."""
        return _Corner(lambda tau, state: float(self._pulled(tau, state)[0][m]) - edge, way, m, one)


def _events(corners: list[_Corner]) -> list[Event]:
    for corner in corners:
        corner.event.terminal, corner.event.direction = True, corner.way  # type: ignore[attr-defined]
    return [corner.event for corner in corners]
