"""Devices drawn at random around one profile, moved together under common samples."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ProfileError
from ..model.device import Device
from ..model.parts import HigherMode, Surroundings
from ..threads import in_threads
from ..time_domain.as_built import AsBuilt
from ..time_domain.integrate import limit_of
from .acting import creep_of, plays_of
from .composition import DISTINCT, LONGEST_STEP
from .kernel import ChainSamples, Shared, advance_drawn, flows_of_step
from .lanes import BETA_RUN, CREEPS, FLOWS_AT, GAIN_RUN, MODES, MOVES_RUN, RUNS, WIDTH

__all__ = ["DrawnDevices", "DrawnNumbers"]

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]

# A factor that a draw would take below this counts as this, so that no number changes its sign.
_LEAST = 0.01
# Creep takes a step at least so often: in tau, and in units of its first time.
_CREEP_STEP, _CREEP_SHARE = 0.25, 0.002


class DrawnDevices:
    """`count` devices of a profile with their surroundings, at rest; advanced block by block.

    Device k of a seed is the same in whatever company. Sample k of force and lam holds at the sample's instant; between
    instants both are linear. The first sample sets the instant of the state, in which everything is at rest.

    Parameters
    ----------
    device : the profile; actuators that were measured are drawn around what they were measured to be.
    around : what acts on it; `bandwidth_hz` and `converter_bits` are not looked at.
    first, count : number of the first device, and how many.
    seed : of the draws and of the noise.
    rate_hz : samples a second.
    frames, weights : how many frames collect what is felt, and how many weights each.

    Raises
    ------
    ProfileError
        When links act both ways.
    """

    def __init__(
        self, device: Device, around: Surroundings, *, first: int, count: int, seed: int, rate_hz: float, frames: int,
        weights: int,
    ) -> None:  # fmt: skip
        if device.chain.law.both_ways:
            raise ProfileError(f"{device.name}: devices are drawn of chains whose links act one way, not of these")
        self._device, self._around, self._count = device, around, count
        self._chains, self._n = device.chains, device.chain_length
        blocks = -(-count // WIDTH)
        drawn = DrawnNumbers(device, around, range(first, first + blocks * WIDTH), seed)
        self._seeds = drawn.seeds.reshape(blocks, WIDTH)
        softest = drawn.beta[drawn.beta < 0].max(initial=-np.inf)
        dtau = device.tau_per_s / rate_hz
        fastest = math.sqrt(max(float(drawn.stiffness.max()), 1.0))
        substeps = math.ceil(dtau * fastest / LONGEST_STEP)
        self._shared = _shared(device, around, dtau, substeps, limit_of(float(softest)))
        self._work = self._at_rest(drawn, blocks, dtau / substeps)
        self._load = np.zeros((blocks, self._chains, frames, self._n, weights, WIDTH))
        self._escaped = np.full((blocks, self._chains, WIDTH), np.iinfo(np.int64).max)
        self._noise, self._done = _noise(device, around), 0
        self._last: tuple[Floats, Floats] | None = None

    @property
    def load(self) -> Floats:
        """Sums of weights times tips: float64, shape (count, frames, rows, cols, weights)."""
        device = self._device
        found = np.moveaxis(self._load, -1, 1)  # blocks, WIDTH, chains, frames, n, weights
        frames, weights = found.shape[3], found.shape[5]
        found = found.reshape(-1, device.rows, device.chains_per_row, frames, self._n, weights)[: self._count]
        return np.moveaxis(found, 3, 1).reshape(self._count, frames, device.rows, device.cols, weights)

    @property
    def escaped(self) -> Whole:
        """Sample at which a device was seen to escape, -1 where none did; int64, shape (count,)."""
        first = self._escaped.min(axis=1).reshape(-1)[: self._count]
        return np.where(first == np.iinfo(np.int64).max, -1, first)

    def advance(self, force: Floats, lam: Floats, frame: Whole, basis: Floats) -> None:
        """Move through the next S samples.

        Parameters
        ----------
        force, lam : float64, shape (S, rows, cols), as of `GridIntegrator`, before what each device makes of them.
        frame : int64, shape (S,), the frame that each sample counts for, -1 for none.
        basis : float64, shape (rows, S, weights).
        """
        forces, links = self._by_chain(force), self._by_chain(lam)
        if not self._shared.ring:
            links[:, :, 0] = 0.0
        skip = 1 if self._last is None else 0
        before = (forces[:, 0], links[:, 0]) if self._last is None else self._last
        forces = np.concatenate([before[0][:, None], forces[:, skip:]], axis=1)
        links = np.concatenate([before[1][:, None], links[:, skip:]], axis=1)
        self._last = forces[:, -1].copy(), links[:, -1].copy()
        first, basis = self._done + skip, np.repeat(basis[:, skip:], self._device.chains_per_row, axis=0)
        place = np.arange(self._chains * self._n).reshape(self._chains, self._n)
        # Chains that know nothing of each other are moved one by one.
        together = self._chains if self._shared.row_lam else 1

        def work(part: slice) -> None:
            for unit in range(part.start, part.stop):
                block, number = divmod(unit, self._chains // together)
                chains = slice(number * together, (number + 1) * together)
                given = ChainSamples(
                    forces[chains], links[chains], self._noise[chains], place[chains], place.size, first, frame[skip:],
                    basis[chains],
                )  # fmt: skip
                advance_drawn(
                    self._work[block, chains], self._seeds[block], given, self._shared, self._load[block, chains],
                    self._escaped[block, chains],
                )  # fmt: skip

        in_threads(work, len(self._work) * self._chains // together, 1)
        self._done += len(force)

    def _by_chain(self, values: Floats) -> Floats:
        """(S, rows, cols) as (chains, S, n), a copy."""
        return np.array(np.moveaxis(values.reshape(len(values), self._chains, self._n), 1, 0), order="C")

    def _at_rest(self, drawn: DrawnNumbers, blocks: int, step: float) -> Floats:
        n = self._n
        work = np.zeros((blocks, self._chains, n + 1, RUNS, WIDTH))

        def laid(values: Floats) -> Floats:
            """(devices, rows, cols) as (blocks, chains, n, WIDTH)."""
            return np.moveaxis(values.reshape(blocks, WIDTH, self._chains, n), 1, -1)

        actuators = work[:, :, 1:]
        actuators[..., GAIN_RUN, :], actuators[..., BETA_RUN, :] = laid(drawn.lam_gain), laid(drawn.beta)
        actuators[..., MOVES_RUN, :] = 1.0
        flows = flows_of_step(drawn.delta.ravel(), drawn.stiffness.ravel(), step)
        for run, values in enumerate(flows.reshape(3 * DISTINCT, *drawn.delta.shape)):
            actuators[..., FLOWS_AT // WIDTH + run, :] = laid(values)
        return work.reshape(blocks, self._chains, -1)


class DrawnNumbers:
    """What differs from device to device: float64, shape (devices, rows, cols) each; and the seeds of their noise."""

    def __init__(self, device: Device, around: Surroundings, numbers: range, seed: int) -> None:
        shape, built, spread = (device.rows, device.cols), AsBuilt(device), around.spread
        normal = np.empty((len(numbers), 4, *shape))
        self.seeds = np.empty(len(numbers), dtype=np.uint64)
        for at, number in enumerate(numbers):
            rng = np.random.default_rng([seed, number])
            self.seeds[at] = rng.integers(0, 2**64, dtype=np.uint64, endpoint=False)
            normal[at] = rng.standard_normal((4, *shape))

        def factor(index: int, sigma: float) -> Floats:
            return np.maximum(1 + sigma * normal[:, index], _LEAST)

        self.stiffness = built.stiffness * factor(0, spread.frequency) ** 2 + around.touch_stiffness
        self.delta = built.delta * factor(1, spread.damping) + around.touch_damping
        self.beta = built.beta * (1 + spread.beta * normal[:, 2])
        self.lam_gain = built.lam_gain * factor(3, spread.lam)


def _shared(device: Device, around: Surroundings, dtau: float, substeps: int, limit: float) -> Shared:
    play, creep = plays_of(around), creep_of(around, device.tau_per_s)
    # A mode of no gain does nothing.
    modes = (*around.modes, *[HigherMode(omega=1.0, delta=0.0, gain=0.0)] * MODES)[:MODES]
    delta, square = np.array([[mode.delta, mode.omega**2] for mode in modes]).T
    flows = flows_of_step(np.ascontiguousarray(delta), np.ascontiguousarray(square), dtau / substeps)
    times = np.full(CREEPS, np.inf) if creep is None else np.array(creep.times)
    every = 0 if creep is None else max(1, int(min(_CREEP_STEP, _CREEP_SHARE * creep.times[0]) / dtau))
    piezo = np.concatenate([[play.base + sum(play.weight)], play.radius, play.weight, [mode.gain for mode in modes]])
    return Shared(
        dtau, substeps, limit, device.chain.law.closed, around.row_lam, device.chains_per_row, around.preload, piezo,
        np.ascontiguousarray(np.moveaxis(flows, -1, 0)), any(play.weight), every,
        -np.expm1(-dtau * every / times), 0.0 if creep is None else creep.per_decade / creep.each,
    )  # fmt: skip


def _noise(device: Device, around: Surroundings) -> Floats:
    """Rms of the force on each actuator, the noise of its channels together; float64, shape (chains, n)."""
    volts = around.amplifier_noise * device.amplifier.volts
    drive: ArrayLike = AsBuilt(device).drive_per_volt
    driven = np.arange(device.cols) % device.chain_length == 0
    bias = device.bias_per_volt if device.bias == "actuator" else 0.0
    found = volts * np.hypot(np.where(driven, drive, 0.0), bias)
    return np.ascontiguousarray(found).reshape(-1, device.chain_length)
