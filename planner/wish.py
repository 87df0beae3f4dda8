"""What is wished of one chain, in a form that equal wishes share."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Device
from encoders import TargetPattern

__all__ = ["ChainWish", "Turned", "wishes_of"]

Floats = NDArray[np.float64]

# Phases are told apart to so many decimals, so that rows of a plane wave are the same but for a turn.
PHASE_DECIMALS = 9
MARK = b"w"


@dataclass(frozen=True)
class ChainWish:
    """A wish that amplitudes at will cannot express, or that the device cannot take so.

    Attributes
    ----------
    amplitude : float64, shape (n,), in units of full scale.
    phase : float64, shape (n,), radians, NaN where any will do; the first is 0.
    weight : float64, shape (n,), 0 = don't care.
    width : of bars that walk, in actuators; 0 where nothing walks, NaN where it follows from the rate. place : the
        column of the chain's first actuator where they do, else 0. lam : of every link, given by other chains; NaN
        where it is free. rate_hz : bars that pass in a second; NaN where that follows from the width.
    """

    amplitude: Floats
    phase: Floats
    weight: Floats
    width: float = 0.0
    place: float = 0.0
    lam: float = math.nan
    rate_hz: float = math.nan

    @property
    def key(self) -> bytes:
        """The wish as bytes, other than those of any amplitudes alone."""
        rest = [self.width, self.place, self.lam, self.rate_hz]
        return MARK + np.concatenate([self.amplitude, self.phase, self.weight, rest]).tobytes()

    @classmethod
    def of_key(cls, key: bytes) -> ChainWish | None:
        """The wish a key stands for; None for the bytes of amplitudes alone."""
        if len(key) % 8 != 1:
            return None
        numbers = np.frombuffer(key[1:])
        amplitude, phase, weight = numbers[:-4].reshape(3, -1)
        return cls(amplitude, phase, weight, *numbers[-4:].tolist())


class Turned(NamedTuple):
    """A wish (or only its amplitudes, where any phases will do) and by how much it is turned, radians."""

    wish: ChainWish | Floats
    turn: float = 0.0


def wishes_of(pattern: TargetPattern, device: Device) -> Iterator[Turned]:
    """What a pattern wishes of every chain of `device`, row by row."""
    n = device.chain_length
    size, angle = np.abs(pattern.amplitude), np.angle(pattern.amplitude)
    weight = np.ones(size.shape) if pattern.weight is None else np.asarray(pattern.weight, dtype=np.float64)
    matters = np.full(size.shape, pattern.phase_matters) & (size > 0) & (weight > 0)
    if pattern.any_phase is not None:
        matters &= ~pattern.any_phase
    chains = (part.reshape(-1, n) for part in (size, np.where(matters, angle, np.nan), weight))
    for number, (amplitude, phase, heed) in enumerate(zip(*chains, strict=True)):
        if pattern.walking is not None and np.any(amplitude):
            place = float(number % device.chains_per_row * n)
            walking, phases = pattern.walking, np.full(n, np.nan)
            yield Turned(ChainWish(amplitude, phases, heed, walking.width, place, rate_hz=walking.rate_hz))
        else:
            yield _turned(amplitude, phase, heed)


def _turned(amplitude: Floats, phase: Floats, weight: Floats) -> Turned:
    phased = np.flatnonzero(~np.isnan(phase))
    turn = float(phase[phased[0]]) if len(phased) else 0.0
    if len(amplitude) == 1 or not len(phased):
        return Turned(amplitude if np.all(weight > 0) else amplitude * (weight > 0), turn)
    straight = np.round(np.remainder(phase - turn + np.pi, 2 * np.pi) - np.pi, PHASE_DECIMALS)
    # Half a turn one way is half a turn the other way.
    straight = np.where(straight <= -np.round(np.pi, PHASE_DECIMALS), -straight, straight)
    return Turned(ChainWish(np.round(amplitude, 12), straight + 0.0, weight), turn)
