"""The levels that devices as built make felt in every frame of a waveform."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from chainsim import AsBuilt, CommonAmplifier, Device, DrawnDevices, Surroundings, beats_of, felt_modulation
from drivers import FrameMark, Manifest, SampleReader

from ..verification import forces_under, frequencies

__all__ = ["FeltLevels", "felt_levels", "most_at_once"]

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]

# Forces, links and weights of a block of samples stay near 8 MB each, whatever the grid.
BLOCK_VALUES = 1 << 20
# Numbers that are collected of all devices together, and devices that are moved at a time.
# Tones of a modulated carrier that are told to each side of it.
SIDES = 6
MOST_COLLECTED, MOST_DEVICES, FEWEST_DEVICES = 8_000_000, 1024, 32


class FeltLevels:
    """Levels of `count` devices: float64, shape (count, frames, rows, cols), in units of full scale, NaN where unknown.

    Attributes
    ----------
    level : the mean of a bias pattern, else the amplitude at the drive's frequency, or the sum of those at all tones.
    escaped : bool, shape (count,), devices on which an actuator left its softening well.
    """

    def __init__(self, level: Floats, escaped: NDArray[np.bool_]) -> None:
        self.level, self.escaped = level, escaped


def most_at_once(manifest: Manifest) -> int:
    """How many devices to move together, so that memory does not grow with the length of the waveform."""
    device = manifest.device
    each = device.rows * device.cols * max(1, len(manifest.frames)) * _weights(manifest)
    fitting = MOST_COLLECTED // each // FEWEST_DEVICES * FEWEST_DEVICES
    return int(np.clip(fitting, FEWEST_DEVICES, MOST_DEVICES))


def felt_levels(
    manifest: Manifest, reader: SampleReader, around: Surroundings, *, first: int, count: int, seed: int,
    told: Callable[[int], None],
) -> FeltLevels:  # fmt: skip
    """Integrate the full equations of devices `first` to ``first + count`` of a seed under the samples.

    `told` is called with how many samples were taken in each block.
    """
    device, rate_hz = manifest.device, manifest.rate_hz
    weights = _weights(manifest)
    drawn = DrawnDevices(
        device, around, first=first, count=count, seed=seed, rate_hz=rate_hz, frames=len(manifest.frames),
        weights=weights,
    )  # fmt: skip
    amplifier, built = CommonAmplifier(device, around), AsBuilt(device)
    fit = _Weights(manifest, weights)
    position = 0
    for volts in reader.blocks(max(256, BLOCK_VALUES // (device.rows * device.cols))):
        index = np.arange(position, position + len(volts))
        force = forces_under(amplifier.advance(volts), manifest, built)
        frame, basis = fit.of(index)
        drawn.advance(force, manifest.lam_at(index / rate_hz), frame, basis)
        position += len(volts)
        told(len(volts))
    return FeltLevels(fit.levels(drawn.load), drawn.escaped >= 0)


def _weights(manifest: Manifest) -> int:
    """1, and cosine and sine of as many frequencies as any row of any frame has."""
    rates = (_rates(manifest.device, mark, row) for mark in manifest.frames for row in range(manifest.device.rows))
    return 1 + 2 * max(map(len, rates), default=1)


def _rates(device: Device, mark: FrameMark, row: int) -> list[float]:
    """The frequencies over f0 at which motions of a row are told."""
    omega = float(mark.omega[row])
    if mark.modulated[row] and omega and device.modulation is not None:
        return [omega + k * device.modulation.hz / device.f0_hz for k in range(-SIDES, SIDES + 1)]
    return frequencies(omega, mark.tones[row])


class _Weights:
    """Least squares of 1, cosines and sines over the samples of every frame, for all devices at once."""

    def __init__(self, manifest: Manifest, weights: int) -> None:
        self._manifest, self._weights = manifest, weights
        self._gram = np.zeros((len(manifest.frames), manifest.device.rows, weights, weights))

    def of(self, index: Whole) -> tuple[Whole, Floats]:
        """The frame of each sample, -1 for none, and its weights: int64 (S,), float64 (rows, S, weights)."""
        manifest, rate_hz = self._manifest, self._manifest.rate_hz
        frame = np.full(len(index), -1, dtype=np.int64)
        basis = np.zeros((manifest.device.rows, len(index), self._weights))
        for number, mark in enumerate(manifest.frames):
            inside = slice(*np.searchsorted(index, [round(mark.settled_s * rate_hz), round(mark.end_s * rate_hz)]))
            if inside.start == inside.stop:
                continue
            frame[inside] = number
            tau = index[inside] / rate_hz * manifest.device.tau_per_s
            for row in range(manifest.device.rows):
                rates = np.array(_rates(manifest.device, mark, row))
                angle = np.outer(tau, rates)
                basis[row, inside, 0] = 1.0
                basis[row, inside, 1 : 1 + 2 * len(rates) : 2] = np.cos(angle)
                basis[row, inside, 2 : 2 + 2 * len(rates) : 2] = np.sin(angle)
                self._gram[number, row] += basis[row, inside].T @ basis[row, inside]
        return frame, basis

    def levels(self, load: Floats) -> Floats:
        """Levels from the sums of weights times tips, shape (devices, frames, rows, cols, weights)."""
        manifest = self._manifest
        found = np.empty(load.shape[:-1])
        for number, mark in enumerate(manifest.frames):
            for row, tones in enumerate(mark.tones):
                gram, sums = self._gram[number, row], load[:, number, row]
                if mark.modulated[row] and mark.omega[row]:
                    found[:, number, row] = _swelling(manifest.device, gram, sums)
                    continue
                level = _level(gram, sums, 1 + len(tones), moving=mark.moving[row])
                found[:, number, row] = level / manifest.device.full_scale
        return found


def _parts(gram: Floats, sums: Floats) -> Floats:
    """What each weight has of the motion, shape (devices, cols, weights) as `sums`; NaN where it is not known."""
    if gram[0, 0] < np.count_nonzero(np.diagonal(gram)):
        return np.full(sums.shape, np.nan)
    # A device that escaped within the frame has sums that are no numbers.
    known = np.asarray(np.isfinite(sums).all(axis=2))[..., None]
    wanted = np.where(known, sums, 0.0).reshape(-1, len(gram))
    parts = np.asarray(np.linalg.lstsq(gram, wanted.T)[0]).T.reshape(sums.shape)
    return np.where(known, parts, np.nan)


def _swelling(device: Device, gram: Floats, sums: Floats) -> Floats:
    """What is felt of how carriers swell: the beats of every two of their tones."""
    assert device.modulation is not None
    parts = _parts(gram, sums)
    tones = parts[..., 1 : 4 * SIDES + 3 : 2] - 1j * parts[..., 2 : 4 * SIDES + 3 : 2]
    square = [
        2 * (tones[..., beat:] * np.conj(tones[..., :-beat])).sum(axis=-1)
        for beat in range(1, beats_of(device.modulation) + 1)
    ]
    return felt_modulation(np.array(square), device.modulation, device.full_scale)


def _level(gram: Floats, sums: Floats, tones: int, *, moving: bool) -> Floats:
    """Levels of the actuators of one row, before the scale; `sums` has shape (devices, cols, weights)."""
    parts = _parts(gram, sums)
    wave = np.hypot(parts[..., 1 : 1 + 2 * tones : 2], parts[..., 2 : 2 + 2 * tones : 2]).sum(axis=-1)
    return np.asarray(wave if moving else parts[..., 0])
