"""Chains that act on themselves, integrated by SciPy's DOP853: written from the equations, with none of our solvers."""

from __future__ import annotations

import cmath
from bisect import bisect_right
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from chainsim import Closure, Device
from planner import Ramp
from planner.operating_point import OperatingPoint

__all__ = ["Step", "felt_after"]

Floats = NDArray[np.float64]

POINTS = 32


class Step(NamedTuple):
    """A ramp, the point it leads to, and for how many seconds that stands."""

    ramp: Ramp
    point: OperatingPoint
    stands_s: float


def felt_after(device: Device, steps: Sequence[Step], rtol: float = 1e-9) -> list[NDArray[np.complex128]]:
    """First harmonics at each point's frequency in every period of its stand; complex128, shape (periods, n) each."""
    n, scale = device.chain_length, device.tau_per_s
    state, begin, found = np.zeros(2 * n), 0.0, []
    for step in steps:
        omega, length = _omega(step), step.ramp.duration_s * scale
        periods = int(step.stands_s * scale * omega / (2 * np.pi))
        points = begin + length + 2 * np.pi / omega * np.arange(POINTS * periods + 1) / POINTS
        run = solve_ivp(
            _slope(device, step, begin),
            (begin, points[-1]),
            state,
            "DOP853",
            t_eval=points,
            rtol=rtol,
            atol=1e-4 * rtol,
        )
        turned = run.y[:n, :-1] * np.exp(-1j * omega * points[:-1])
        found.append(2 * turned.reshape(n, periods, POINTS).mean(axis=2).T)
        state, begin = run.y[:, -1], float(points[-1])
    return found


def _omega(step: Step) -> float:
    return step.ramp.tones[0].omega if step.ramp.tones else step.point.omega


def _slope(device: Device, step: Step, begin: float) -> Callable[[float, Floats], Floats]:
    n, scale, omega, drive, links = device.chain_length, device.tau_per_s, _omega(step), _drive(step), _links(step)
    ring, both = (device.coupling.closure is one for one in (Closure.RING, Closure.BIDIRECTIONAL))

    def slope(tau: float, state: Floats) -> Floats:
        z, v = state[:n], state[n:]
        out = np.concatenate([v, -device.delta * v - z - device.beta * z**3])
        out[n] += (drive((tau - begin) / scale) * cmath.exp(1j * omega * tau)).real
        lam = links((tau - begin) / scale)
        pull = lam * (z[:-1] - z[1:])
        out[n + 1 :] += pull
        if ring:
            out[n] += lam[0] * (z[-1] - z[0])
        if both:
            out[n : 2 * n - 1] -= pull
        return out

    return slope


def _drive(step: Step) -> Callable[[float], complex]:
    """The drive's envelope by seconds: cubic Hermite between nodes, then the point's."""
    ramp = step.ramp
    first = ramp.tones[0] if ramp.epsilon is None else ramp
    assert first.epsilon is not None
    assert first.epsilon_slope is not None
    t_s, value, slope = ramp.t_s.tolist(), first.epsilon.tolist(), first.epsilon_slope.tolist()

    def drive(at: float) -> complex:
        if at >= t_s[-1]:
            return step.point.epsilon
        k = max(0, bisect_right(t_s, at) - 1)
        h = t_s[k + 1] - t_s[k]
        x = (at - t_s[k]) / h
        y = 1 - x
        ends = y * y * (1 + 2 * x) * value[k] + x * x * (1 + 2 * y) * value[k + 1]
        return complex(ends + h * x * y * (y * slope[k] - x * slope[k + 1]))

    return drive


def _links(step: Step) -> Callable[[float], Floats]:
    """The links by seconds: straight between nodes, then the point's."""
    ramp = step.ramp
    if ramp.lam is None or ramp.lam_t_s is None:
        return lambda at: step.point.lam
    t_s, lam = ramp.lam_t_s.tolist(), ramp.lam

    def links(at: float) -> Floats:
        if at >= t_s[-1]:
            return step.point.lam
        k = max(0, bisect_right(t_s, at) - 1)
        x = (at - t_s[k]) / (t_s[k + 1] - t_s[k])
        return np.asarray((1 - x) * lam[k] + x * lam[k + 1])

    return links
