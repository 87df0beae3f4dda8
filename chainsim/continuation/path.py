"""Branches of periodic answers along one quantity, by pseudo-arclength, with their folds and the jumps there.

The unknown is the whole chain's Fourier series and the parameter p; each point is Newton's answer to the balance
equations together with ``(u - u_predicted) . tangent = 0``, so a fold in p is an ordinary point (Keller 1977).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import basis_for
from ..equations.chain import Chain, Setting
from ..errors import ChainError
from .system import BalanceSystem, Parameter

__all__ = ["ContinuationError", "Ending", "Fold", "Path", "continue_branch"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

NEWTON_STEPS = 8
CLOSE = 1e-11
# Corrections up to which the next step is longer, and from which it is shorter.
EASY, HARD = 3, 5
GROW, SHRINK = 1.5, 0.5
SMALLEST = 1e-7
# Largest turn of the tangent in one step, as a cosine; a sharper one could be the other side of a narrow fold.
TURN = 0.9
FOLD_STEPS = 60


class ContinuationError(ChainError, ValueError):
    """A branch cannot be followed.

    Examples: more than one setting; a parameter that is not epsilon, lam or omega; no answer at the start.
    """


class Ending(StrEnum):
    """Why a path stops."""

    REACHED = "reached"
    LEFT = "left"
    OUT_OF_POINTS = "out_of_points"
    STUCK = "stuck"


@dataclass(frozen=True)
class Fold:
    """Where a branch turns back in the parameter.

    Attributes
    ----------
    at : value of the parameter.
    phasor : complex128, shape (n,).
    index : the fold lies between points index and index + 1 of the path.
    rising : whether the branch ends there for a parameter that rises; else it does for one that falls.
    """

    at: float
    phasor: Complexes
    index: int
    rising: bool


@dataclass(frozen=True)
class Path:
    """A branch in K points, in the order of arclength.

    Attributes
    ----------
    parameter : which quantity changes.
    value : float64, shape (K,).
    phasor : complex128, shape (K, n), first harmonics.
    mean : float64, shape (K, n).
    stable : bool, shape (K,), by the Floquet multipliers.
    folds : in order.
    ending : why it stops.
    """

    parameter: Parameter
    value: Floats
    phasor: Complexes
    mean: Floats
    stable: NDArray[np.bool_]
    folds: tuple[Fold, ...]
    ending: Ending

    @property
    def amplitude(self) -> Floats:
        """Moduli of `phasor`, float64, shape (K, n)."""
        return np.abs(self.phasor)

    @property
    def jump_up(self) -> float:
        """Value at which a rising parameter meets the first fold and the chain jumps; inf without one."""
        return next((fold.at for fold in self.folds if fold.rising), math.inf)

    @property
    def jump_down(self) -> float:
        """Value at which a falling parameter meets the first fold and the chain jumps; -inf without one."""
        return next((fold.at for fold in self.folds if not fold.rising), -math.inf)


@dataclass(frozen=True)
class _Point:
    u: Floats
    tangent: Floats


def continue_branch(
    chain: Chain,
    setting: Setting,
    *,
    parameter: Parameter | str,
    stop: float,
    harmonics: int,
    step: float,
    max_points: int,
    start: Complexes | None = None,
) -> Path:
    """Follow the branch that passes through `setting` while `parameter` goes towards `stop`, around every fold.

    Parameters
    ----------
    setting : one setting, where the branch starts.
    parameter : epsilon, lam (the links keep their ratios; the value is that of the largest) or omega.
    stop : value at which the path ends; it also ends when it comes back past its start.
    harmonics : highest harmonic: odd ones, or all and the mean under a constant force.
    step : longest step, as a share of ``abs(stop - start)`` and of the amplitudes' scale; 0.02 draws a smooth curve.
    max_points : points after which it ends as out of points.
    start : complex128, shape (n,), first harmonics near the wanted answer; None takes the lower branch.

    Raises
    ------
    ContinuationError
        With the argument and its value.
    """
    system = _checked(chain, setting, parameter, stop, harmonics, step, max_points)
    begin = system.start(start)
    if begin is None:
        raise ContinuationError("setting: no periodic answer is found here; start where one is known")
    span = abs(stop - begin[-1])
    scaled = system.scaled(span)
    direction = np.zeros(len(begin))
    direction[-1] = math.copysign(1.0, stop - begin[-1])
    points, folds, ending = _walk(scaled, begin, direction, stop, step, max_points)
    u = np.array([point.u for point in points])
    phasor, mean = system.phasors(u)
    stable = system.stable(u)
    for array in (u, phasor, mean, stable):
        array.flags.writeable = False
    return Path(system.parameter, u[:, -1], phasor, mean, stable, tuple(folds), ending)


def _checked(
    chain: Chain, setting: Setting, parameter: Parameter | str, stop: float, harmonics: int, step: float, points: int
) -> BalanceSystem:
    if len(setting) != 1 or setting.n != chain.n:
        raise ContinuationError(f"setting: expected one setting of the chain, got {len(setting)} of {setting.n}")
    if parameter not in set(Parameter):
        raise ContinuationError(f"parameter: expected one of {', '.join(Parameter)}, got {parameter!r}")
    if not math.isfinite(stop) or (parameter == Parameter.OMEGA and stop <= 0):
        raise ContinuationError(f"stop: expected a finite number (> 0 for omega), got {stop}")
    if harmonics < 1 or (harmonics % 2 == 0 and not (setting.bias.any() or setting.preload.any())):
        raise ContinuationError(f"harmonics: expected an odd number (any with a bias or preload), got {harmonics}")
    if not 0 < step <= 1:
        raise ContinuationError(f"step: expected a number in (0, 1], got {step}")
    if points < 2:
        raise ContinuationError(f"max_points: expected 2 or more, got {points}")
    mean = bool(setting.bias.any() or setting.preload.any())
    system = BalanceSystem(chain, setting, Parameter(parameter), basis_for(harmonics, mean))
    if stop == system.value:
        raise ContinuationError(f"stop: expected another value than the start's {stop}")
    return system


def _walk(
    system: BalanceSystem, begin: Floats, direction: Floats, stop: float, longest: float, count: int
) -> tuple[list[_Point], list[Fold], Ending]:
    """Steps of adapted length along the branch."""
    point = _Point(begin, _tangent(system, begin, direction))
    points, h = [point], longest
    folds: list[Fold] = []
    origin, way = begin[-1], math.copysign(1.0, stop - begin[-1])
    while len(points) < count:
        found = _step(system, point, h)
        if found is None:
            h *= SHRINK
            if h < SMALLEST * longest:
                return points, folds, Ending.STUCK
            continue
        new, work = found
        if new.tangent[-1] * point.tangent[-1] < 0:
            folds.append(_fold(system, point, h, len(points) - 1))
        h = min(longest, h * (GROW if work <= EASY else SHRINK if work >= HARD else 1.0))
        if way * (new.u[-1] - stop) >= 0:
            points.append(_ending(system, point, new, stop))
            return points, folds, Ending.REACHED
        points.append(new)
        if way * (new.u[-1] - origin) < 0:
            return points, folds, Ending.LEFT
        point = new
    return points, folds, Ending.OUT_OF_POINTS


def _step(system: BalanceSystem, point: _Point, h: float) -> tuple[_Point, int] | None:
    """The next point at arclength `h` and the Newton corrections it took; None when it has to be shorter."""
    guess = point.u + h * system.scale * point.tangent
    found = _correct(system, guess, point.tangent)
    if found is None:
        return None
    u, work = found
    tangent = _tangent(system, u, point.tangent)
    return (_Point(u, tangent), work) if float(tangent @ point.tangent) > TURN else None


def _correct(system: BalanceSystem, guess: Floats, tangent: Floats) -> tuple[Floats, int] | None:
    """Newton on the plane through `guess` across `tangent`."""
    u = guess.copy()
    for work in range(1, NEWTON_STEPS + 1):
        residual, matrix = system.linearised(u)
        bordered = np.vstack([matrix * system.scale, tangent])
        right = np.append(residual, tangent @ ((u - guess) / system.scale))
        try:
            move = np.linalg.solve(bordered, right)
        except np.linalg.LinAlgError:
            return None
        u = u - move * system.scale
        size = float(np.abs(move).max())
        if not math.isfinite(size) or size > 1:
            return None
        if size < CLOSE:
            return u, work
    return None


def _tangent(system: BalanceSystem, u: Floats, along: Floats) -> Floats:
    """Unit vector that solves the linearised equations, in the scaled coordinates, in the sense of `along`."""
    matrix = system.linearised(u)[1] * system.scale
    right = np.zeros(len(u))
    right[-1] = 1.0
    tangent = np.linalg.solve(np.vstack([matrix, along]), right)
    unit: Floats = tangent / np.linalg.norm(tangent)
    return unit


def _fold(system: BalanceSystem, point: _Point, h: float, index: int) -> Fold:
    """The point between arclength 0 and `h` where the parameter stands still, by the secant kept in its bracket."""
    low, high = 0.0, h
    a, best = float(point.tangent[-1]), point
    for k in range(FOLD_STEPS):
        middle = 0.5 * (low + high)
        found = _step(system, point, middle)
        if found is None:
            break
        best = found[0]
        slope = float(best.tangent[-1])
        if abs(slope) < 1e-12 or high - low < 1e-14 * h * (k + 1):
            break
        low, high = (middle, high) if slope * a > 0 else (low, middle)
    phasor = system.phasors(best.u[None])[0][0]
    return Fold(float(best.u[-1]), phasor, index, a > 0)


def _ending(system: BalanceSystem, before: _Point, after: _Point, stop: float) -> _Point:
    """The point of the branch exactly at `stop`."""
    share = (stop - before.u[-1]) / (after.u[-1] - before.u[-1])
    guess = before.u + share * (after.u - before.u)
    guess[-1] = stop
    across = np.zeros(len(guess))
    across[-1] = 1.0
    found = _correct(system, guess, across)
    return after if found is None else _Point(found[0], after.tangent)
