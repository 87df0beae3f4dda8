"""What waves can be bought for: the length of the way in against its peak drive.

Less drive is allowed from one search to the next, which makes the shortest way longer; every way is tried in the full
equations as any way in is (`way_in`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import reduce

import numpy as np

from chainsim import Closure, Device, Outcome
from encoders import TargetPattern

from ..operating_point import OperatingPoint
from ..targets import WaveTarget, targets_of
from ..transitions.rise import find_way
from ..transitions.search import STANDS
from ..transitions.waves import BUDGET, limits_of
from ..waves.wave_state import wave_state
from .effects import Linearisation
from .pareto_point import SIGMA, ParetoError, ParetoPoint

__all__ = ["ways_of_waves"]

# From one way to the next the largest drive falls to this part, at most so many times and to the steady drive.
LESS, MOST = 0.6, 7


def ways_of_waves(pattern: TargetPattern, device: Device) -> tuple[list[ParetoPoint], int]:
    """Ways of different drives to a frame of waves, and how many were tried.

    Raises
    ------
    ParetoError
        When the chains are rings, stand still beside waves, or the device cannot hold the waves.
    """
    if device.coupling.closure is not Closure.OPEN:
        raise ParetoError(f"device: {device.name} is of rings, whose waves rise by one slow way; give open chains")
    targets: dict[WaveTarget, None] = {}
    for target in targets_of(pattern, device):
        if isinstance(target, WaveTarget):
            targets[target.unturned] = None
        elif not target.resting:
            raise ParetoError("frame: some of its chains have no phases; give waves alone, or amplitudes alone")
    states = [wave_state(device, target) for target in targets]
    lacking = next((state.lacking for state in states if state.outcome is not Outcome.OK), "")
    if lacking:
        raise ParetoError(f"frame: {device.name} cannot make it: {lacking}")
    ways = [_ways(device, state) for state in states]
    tried = sum(len(each) for each in ways)
    # All chains rise in the same time: of each the way of least drive that is not longer.
    points = []
    for ramp_s in sorted({way.ramp_s for each in ways for way in each}):
        ready = [[way for way in each if way.ramp_s <= ramp_s] for each in ways]
        if all(ready):
            least = [min(each, key=lambda way: way.drive) for each in ready]
            points.append(replace(reduce(_both, least), ramp_s=ramp_s))
    return points, tried


def _both(one: ParetoPoint, other: ParetoPoint) -> ParetoPoint:
    """The worse of both in everything."""
    worse = {
        name: max(getattr(one, name), getattr(other, name))
        for name in ("omega", "error", "made", "drive", "noise_gain", "spread")
    }
    return replace(one, **worse)


def _ways(device: Device, state: OperatingPoint) -> list[ParetoPoint]:
    """Ways to one wave; empty where none is found."""
    limits = limits_of(device, device.coupling.scope in ("chain", "link"))
    phased = np.zeros(device.chain_length, np.bool_) if state.phase is None else np.isfinite(state.phase)
    scattered = Linearisation(device.chain, state).scattered(SIGMA, phased)
    spread = float(scattered.max()) / device.full_scale
    # What a way may leave, of each amplitude, counts to the error.
    made = STANDS / 2 * float(state.target.max())
    points: list[ParetoPoint] = []
    for _ in range(MOST):
        ramp = find_way(
            device.chain, epsilon=state.epsilon, lam=state.lam, omega=state.omega, phasor=state.phasor,
            limits=limits, tau_per_s=device.tau_per_s, budget=BUDGET,
        )  # fmt: skip
        if ramp.lacking or ramp.epsilon is None:
            break
        peak = float(np.abs(ramp.epsilon).max())
        costs = state.error + made, made, peak / device.epsilon_max, state.margins.noise_gain, spread
        points.append(ParetoPoint(state.omega, ramp.duration_s, math.inf, *costs))
        if LESS * peak < abs(state.epsilon):
            break
        limits = replace(limits, epsilon_max=LESS * peak)
    return points
