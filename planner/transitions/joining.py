"""Ramps put behind one another and turned."""

from __future__ import annotations

import cmath
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..operating_point import OperatingPoint
from ..plan import Ramp, ToneRamp

__all__ = ["as_tone", "joined", "rest_for", "turned_ramp", "turned_state"]

Floats = NDArray[np.float64]
Numbers = NDArray[Any]

INSTANT_S = 1e-4


def turned_state(state: OperatingPoint, turn: float) -> OperatingPoint:
    """A state whose motion is turned by an angle in radians."""
    if turn == 0.0:
        return state
    factor = cmath.exp(1j * turn)
    phase = None if state.phase is None else state.phase + turn
    tones = tuple(replace(tone, epsilon=tone.epsilon * factor, phasor=tone.phasor * factor) for tone in state.tones)
    return replace(state, epsilon=state.epsilon * factor, phasor=state.phasor * factor, phase=phase, tones=tones)


def turned_ramp(ramp: Ramp, turn: float) -> Ramp:
    """A ramp whose drive is turned by an angle in radians."""
    if turn == 0.0:
        return ramp
    factor = cmath.exp(1j * turn)

    def turned(values: Numbers | None) -> Numbers | None:
        return None if values is None else np.asarray(values * factor)

    tones = tuple(
        replace(tone, epsilon=np.asarray(tone.epsilon * factor), epsilon_slope=turned(tone.epsilon_slope))
        for tone in ramp.tones
    )
    return replace(ramp, epsilon=turned(ramp.epsilon), epsilon_slope=turned(ramp.epsilon_slope), tones=tones)


def as_tone(ramp: Ramp, omega: float) -> Ramp:
    """The ramp with its own drive among its tones, so that it does not depend on the state it leads to."""
    if ramp.epsilon is None:
        return ramp
    own = ToneRamp(omega, ramp.epsilon, ramp.epsilon_slope)
    return replace(ramp, epsilon=None, epsilon_slope=None, tones=(own, *ramp.tones))


def rest_for(ramp: Ramp, seconds: float) -> Ramp:
    """A ramp that leads to rest, and so many seconds of it; links stay as they are in the end."""
    if seconds <= 0:
        return ramp

    def longer(values: Numbers | None) -> Numbers | None:
        return None if values is None else np.concatenate([values, values[-1:]])

    t_s = np.append(ramp.t_s, ramp.duration_s + seconds)
    tones = []
    for tone in ramp.tones:
        epsilon = longer(tone.epsilon)
        assert epsilon is not None
        tones.append(replace(tone, epsilon=epsilon, epsilon_slope=longer(tone.epsilon_slope)))
    return replace(ramp, t_s=t_s, bias=longer(ramp.bias), bias_slope=longer(ramp.bias_slope), tones=tuple(tones))


def joined(first: Ramp, second: Ramp, before: OperatingPoint, after: OperatingPoint) -> Ramp:
    """`first`, which leads from `before` to rest and has its drive among its tones, then `second`, to `after`.

    Every curve of one of them is still while the other lasts.
    """
    ahead, behind = len(first.t_s), len(second.t_s)

    def late(values: Numbers | None) -> Numbers | None:
        return None if values is None else np.concatenate([np.zeros((ahead, *values.shape[1:]), values.dtype), values])

    def early(values: Numbers | None) -> Numbers | None:
        return None if values is None else np.concatenate([values, np.zeros((behind, *values.shape[1:]), values.dtype)])

    own, own_slope = late(second.epsilon), late(second.epsilon_slope)
    tones = []
    for tone in first.tones:
        epsilon, slope = early(tone.epsilon), early(tone.epsilon_slope)
        assert epsilon is not None
        same = tone.omega == after.omega and not tone.place
        if same and own is not None and own_slope is not None and slope is not None:
            own, own_slope = own + epsilon, own_slope + slope
        else:
            tones.append(replace(tone, epsilon=epsilon, epsilon_slope=slope))
    for tone in second.tones:
        epsilon = late(tone.epsilon)
        assert epsilon is not None
        tones.append(replace(tone, epsilon=epsilon, epsilon_slope=late(tone.epsilon_slope)))
    lam_t_s, lam = _links(first, second, before, after)
    return Ramp(
        t_s=np.concatenate([first.t_s, first.duration_s + second.t_s]),
        epsilon=own,
        epsilon_slope=own_slope,
        bias=_sum(early(first.bias), late(second.bias)),
        bias_slope=_sum(early(first.bias_slope), late(second.bias_slope)),
        lam_t_s=lam_t_s,
        lam=lam,
        lacking=first.lacking or second.lacking,
        left=second.left,
        tones=_merged(tones),
    )


def _sum(one: Numbers | None, other: Numbers | None) -> Numbers | None:
    return other if one is None else one if other is None else one + other


def _merged(tones: list[ToneRamp]) -> tuple[ToneRamp, ...]:
    """Each frequency of a driven actuator once."""
    found: dict[tuple[float, int], ToneRamp] = {}
    for tone in tones:
        key = tone.omega, tone.place
        same = found.get(key)
        if same is None:
            found[key] = tone
        else:
            slope = _sum(same.epsilon_slope, tone.epsilon_slope)
            found[key] = replace(same, epsilon=same.epsilon + tone.epsilon, epsilon_slope=slope)
    return tuple(found.values())


def _links(
    first: Ramp, second: Ramp, before: OperatingPoint, after: OperatingPoint
) -> tuple[Floats | None, Floats | None]:
    if not before.lam.size:
        return None, None
    times, links = [], []
    # Links that jump where the ramps meet do so in an instant, not at one: a curve has one value at a time.
    for ramp, held, start in ((first, before, 0.0), (second, after, first.duration_s)):
        at, lam = np.array([0.0, ramp.duration_s]), np.repeat(held.lam[None, :], 2, axis=0)
        if ramp.lam is not None and ramp.lam_t_s is not None:
            # They stay through a rest behind the way.
            rests = ramp.lam_t_s[-1] < ramp.duration_s
            at = np.append(ramp.lam_t_s, ramp.duration_s) if rests else ramp.lam_t_s
            lam = np.vstack([ramp.lam, ramp.lam[-1:]]) if rests else ramp.lam
        times.append(start + at)
        if start:
            times[-1][0] += INSTANT_S
        links.append(lam)
    return np.concatenate(times), np.concatenate(links)
