"""BeatingTones that beat at some actuators of a chain and pass others evenly, though one lam holds all of its links.

A stage turns and magnifies each tone of a drive in its own way. So the envelope of several tones swells at one actuator
and stands at the next, as their phases fall. Small motions are searched from many starts, in closed form with exact
slopes; the best are then followed up to full scale, where the cubic term mixes the tones.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Modulation, beats_of, felt_modulation, skin_gain

from ..wish import CONTRAST_LIMIT_DB, DOT_THRESHOLD
from .beating import beats_in, driven

__all__ = ["BeatingTones", "beating_over"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# BeatingTones to each side of the middle one; instants of a beat; starts that are tried.
SIDES, INSTANTS, STARTS = 3, 32, 400
# Steps of one search, and of following to full scale.
STEPS, FOLLOWED = 80, 40
# Parts of full scale on the way there, and how many small motions are followed.
SCALES, FOLLOWS = (0.1, 0.3, 0.6, 1.0), 4
# Levels beyond this are all alike to a search; one that is farther off than this on its way is lost.
MOST_LEVEL, LOST = 10.0, 0.1
# Weights of what is not to be felt, of what is, and of large tones; the largest envelope that is taken, of full scale.
SILENT, RAISED, LARGE, HIGHEST = 2.0, 4.0, 0.003, 4.0
# Decibels kept beyond those that are needed, and how near a raised level must come.
SPARE_DB, NEAR = 0.5, 0.015
SEED = 20


class BeatingTones(NamedTuple):
    """What one chain is to do: links, middle tone over f0, tones of its last actuator, and the levels then felt."""

    lam: Floats
    omega: float
    last: Complexes
    levels: Floats


def beating_over(device: Device, beat: Modulation, levels: Floats, contrast_db: float) -> BeatingTones | None:
    """BeatingTones that make levels felt; None where none were found.

    Parameters
    ----------
    levels : float64, shape (n,), in units of full scale; those below half count as flat.
    contrast_db : wished between raised and flat; the usual least of 12 dB is taken, too.
    """
    rng = np.random.default_rng(SEED)
    wanted, follows = min(contrast_db, CONTRAST_LIMIT_DB) + SPARE_DB, FOLLOWS
    for lam, omega in _places(device, beat, rng):
        small = _Small(device, beat, levels, lam, omega)
        last = small.found(rng)
        if last is None or small.contrast_db(last) < wanted:
            continue
        found = _followed(device, beat, levels, lam, omega, last)
        if found is not None and _contrast_db(levels, found.levels) >= wanted:
            return found
        follows -= 1
        if not follows:
            break
    return None


def _places(device: Device, beat: Modulation, rng: np.random.Generator) -> Iterator[tuple[float, float]]:
    """Links and middle tones to start from, whose outermost tones the device can make."""
    lam, omega, reach = device.coupling.lam, device.omega, SIDES * beat.hz / device.f0_hz
    low, high = max(lam.min, device.delta / 2), max(lam.max, device.delta / 2)
    for _ in range(STARTS):
        middle = rng.uniform(min(omega.min + reach, 1.0), max(omega.max - reach, 1.0))
        yield float(low * (high / low) ** rng.uniform()), float(middle)


def _contrast_db(levels: Floats, felt: Floats) -> float:
    raised = levels >= DOT_THRESHOLD
    if raised.all() or not raised.any():
        return np.inf
    return float(20 * np.log10(max(felt[raised].min(), 1e-12) / max(felt[~raised].max(), 1e-12)))


class _Small:
    """Small motions: every stage passes each tone by a number of its own."""

    def __init__(self, device: Device, beat: Modulation, levels: Floats, lam: float, omega: float) -> None:
        n, step, beats = device.chain_length, beat.hz / device.f0_hz, INSTANTS // 2 - 1
        self._levels, self._raised = levels, levels >= DOT_THRESHOLD
        k, phase = np.arange(-SIDES, SIDES + 1), 2 * np.pi * np.arange(INSTANTS) / INSTANTS
        at = omega + step * k
        stage = (1 - at**2 + lam + 1j * device.delta * at) / lam
        # Of unit tones of the last actuator, what all do, with each tone's size evened out.
        every = np.exp(1j * np.outer(phase, k)) * stage ** np.arange(n - 1, -1, -1)[:, None, None]
        self._size = 1 / np.sqrt((np.abs(every) ** 2).mean(axis=(0, 1)))
        self._every = every * self._size
        self._both = np.concatenate([self._every, 1j * self._every], axis=2)
        gain = skin_gain(beat.hz * np.arange(1, beats + 1))
        depth = beat.depth
        plain = np.linalg.norm(np.array([2 * depth, depth**2 / 2]) / (1 + depth) ** 2 * gain[:2])
        hear = np.exp(-1j * np.outer(np.arange(1, beats + 1), phase)) * 2 / INSTANTS
        self._hear = hear * (gain / plain)[:, None]

    def found(self, rng: np.random.Generator) -> Complexes | None:
        """BeatingTones of the last actuator for levels, from one start; None where they would have to be too large."""
        from scipy.optimize import least_squares

        tones = 2 * len(self._size)
        start = rng.normal(size=tones) * rng.choice([0.2, 0.5, 1.0])
        best = least_squares(self._away, start, self._slopes, method="lm", max_nfev=STEPS).x
        if np.abs(self._motion(best)).max() > HIGHEST:
            return None
        felt = np.linalg.norm(self._beats(self._motion(best)), axis=1)
        if np.abs(felt - self._levels)[self._raised].max() > 0.2:
            return None
        return np.asarray(self._size * (best[: tones // 2] + 1j * best[tones // 2 :]))

    def contrast_db(self, last: Complexes) -> float:
        """Decibels between raised and flat ones."""
        motion = self._every @ (last / self._size)
        return _contrast_db(self._levels, np.linalg.norm(self._beats(motion), axis=1))

    def _motion(self, x: Floats) -> Complexes:
        half = len(x) // 2
        return np.asarray(self._every @ (x[:half] + 1j * x[half:]))

    def _beats(self, motion: Complexes) -> Complexes:
        return np.asarray(np.abs(motion) ** 2 @ self._hear.T)

    def _away(self, x: Floats) -> Floats:
        beats = self._beats(self._motion(x))
        silent = SILENT * beats[~self._raised].ravel()
        felt = np.linalg.norm(beats[self._raised], axis=1)
        return np.concatenate([silent.real, silent.imag, RAISED * (felt - self._levels[self._raised]), LARGE * x])

    def _slopes(self, x: Floats) -> Floats:
        motion = self._motion(x)
        change = np.matmul(self._hear, 2 * (np.conj(motion)[:, :, None] * self._both).real)
        silent = SILENT * change[~self._raised].reshape(-1, len(x))
        beats = self._beats(motion)[self._raised]
        felt = np.maximum(np.linalg.norm(beats, axis=1), 1e-9)
        turned = (np.conj(beats)[:, :, None] * change[self._raised]).real.sum(axis=1) / felt[:, None]
        return np.concatenate([silent.real, silent.imag, RAISED * turned, LARGE * np.eye(len(x))])


def _followed(
    device: Device, beat: Modulation, levels: Floats, lam: float, omega: float, small: Complexes
) -> BeatingTones | None:
    """The tones at full scale, where the cubic term counts; None where they are lost on the way."""
    from scipy.optimize import least_squares

    links, step, beats = np.full(device.chain_length - 1, lam), beat.hz / device.f0_hz, beats_of(beat)
    raised, one, half = levels >= DOT_THRESHOLD, np.ones((1, 1)), len(small)
    sizes = np.tile(np.abs(small) + 1e-3 * np.abs(small).max(), 2)

    def felt(x: Floats, scale: float) -> Floats:
        last: Complexes = np.asarray(scale * device.full_scale * (x[:half] + 1j * x[half:]), np.complex128)
        with np.errstate(over="ignore", invalid="ignore"):
            motion = driven(device.chain, links, omega, step, last, one).motion[:, :, 0]
            found = felt_modulation(beats_in(motion, beats), beat, scale * device.full_scale)
        return np.minimum(np.nan_to_num(found, nan=MOST_LEVEL), MOST_LEVEL)

    def away(y: Floats, scale: float) -> Floats:
        now = felt(y * sizes, scale)
        return np.concatenate([RAISED * (now - levels)[raised], SILENT * now[~raised], LARGE * y])

    x = np.concatenate([small.real, small.imag]) / sizes
    for scale in SCALES:
        x = least_squares(away, x, args=(scale,), max_nfev=FOLLOWED).x
        if np.abs(felt(x * sizes, scale) - levels)[raised].max() > LOST:
            return None
    now = felt(x * sizes, 1.0)
    if np.abs(now - levels)[raised].max() > NEAR:
        return None
    last = device.full_scale * (x * sizes)[:half] + 1j * device.full_scale * (x * sizes)[half:]
    return BeatingTones(links, omega, last, np.where(raised, levels, now))
