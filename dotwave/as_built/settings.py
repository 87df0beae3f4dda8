"""What many chains, drawn around one as they are built, make of each setting of a sweep."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Closure, CommonAmplifier, CouplingKind, Device, DrawnDevices, Surroundings, surroundings_of

from ..errors import AppError
from .effects import VARYING, alone, present

__all__ = ["AS_BUILT_FIELDS", "AsBuiltSettings", "OutcomeOfMany"]

Floats = NDArray[np.float64]

AS_BUILT_FIELDS = ("yield", "worst", "deviation", "spoiler")
"""What is written for every setting beside the fields of the sweep."""

# Outcomes that a motion can be seen to have; of any other nominal one nothing is known.
SEEN = ("ok", "escaped", "not_locked")
EFFECT_DEVICES = 32
# What a sudden drive stirs up has died down after so many times (n + 1)/delta; then two stretches of so many periods
# agree to a part of the largest amplitude where the motion is locked.
DIED_DOWN, PERIODS, AGREE = 4.0, 20, 0.01
BLOCK, MOST_SAMPLES = 4096, 20_000_000
# Largest angle from sample to sample: lines between samples are then still a tone.
COARSEST = 1.0


@dataclass(frozen=True)
class OutcomeOfMany:
    """What D chains reach at one setting.

    outcome : str, shape (D,). amplitude : float64, shape (D, n), of the first harmonic; NaN where one escaped.
    """

    outcome: NDArray[np.str_]
    amplitude: Floats


@dataclass(frozen=True)
class AsBuiltSettings:
    """What is asked beside a sweep.

    Attributes
    ----------
    device : its surroundings act on the chains that are drawn; also its f0, volts and rate count.
    devices : how many are drawn.
    seed : of the draws and the noise; chain k of a seed is the same at every setting.

    Raises
    ------
    AppError
        When a number is out of range.
    """

    device: Device
    devices: int = 64
    seed: int = 0

    def __post_init__(self) -> None:
        if self.devices < 1:
            raise AppError(f"devices: expected 1 or more, got {self.devices}")
        if self.seed < 0:
            raise AppError(f"seed: expected 0 or more, got {self.seed}")

    @cached_property
    def around(self) -> Surroundings:
        """What acts on a chain; there is no row beside it."""
        return surroundings_of(self.device).model_copy(update={"row_lam": 0.0})

    def single(self, chain: Chain) -> Device:
        """The device with nothing but that chain.

        Raises
        ------
        AppError
            When chains of its kind are not drawn.
        """
        if chain.rows > 1 or chain.spread or chain.kind is not CouplingKind.RESISTOR or chain.closure not in (
            Closure.OPEN, Closure.RING,
        ):  # fmt: skip
            raise AppError("--as-built: expected an open chain or a ring of equal oscillators over resistors")
        coupling = {"scope": "chain", "closure": chain.closure.value, "lam": {"min": 0.0, "max": 1.0}}
        changes: dict[str, Any] = {
            "rows": 1, "cols": chain.n, "chain_length": chain.n, "delta": chain.delta, "beta": chain.beta,
            "coupling": coupling if chain.n > 1 else {"scope": "none"}, "actuators": [], "spread": None, "notes": {},
        }  # fmt: skip
        try:
            return Device.model_validate(self.device.as_dict() | changes)
        except ValueError as error:
            first = str(error).splitlines()[0]
            raise AppError(f"--as-built: {self.device.name} cannot be made of such chains: {first}") from None

    def answers(
        self, chain: Chain, epsilon: Floats, lam: Floats, omega: Floats, nominal: OutcomeOfMany, *, suddenly: bool
    ) -> dict[str, NDArray[Any]]:
        """`AS_BUILT_FIELDS` of N settings.

        Parameters
        ----------
        epsilon, lam, omega : float64, shape (N,), (N, n), (N,).
        nominal : what the chain itself reaches at each.
        suddenly : the drive begins at its height; else it rises slowly.
        """
        single, effects = self.single(chain), (None, *present(self.around))
        found = []
        for at in range(len(epsilon)):
            drive = _Drive(float(epsilon[at]), lam[at], float(omega[at]), suddenly)
            each = {effect: self._reached(single, drive, effect) for effect in effects}
            found.append(_judged(each, str(nominal.outcome[at]), nominal.amplitude[at]))
        kinds = (np.float64, np.int64, np.float64, np.str_)
        columns = zip(AS_BUILT_FIELDS, zip(*found, strict=True), kinds, strict=True)
        # A width of its own for every chunk would not join.
        width = max(map(len, present(self.around)), default=1)
        return {
            name: np.array(values, dtype=f"<U{width}" if kind is np.str_ else kind) for name, values, kind in columns
        }

    def _reached(self, single: Device, drive: _Drive, effect: str | None) -> OutcomeOfMany:
        around = self.around if effect is None else alone(self.around, effect)
        count = 1
        if effect is None or effect in VARYING:
            count = self.devices if effect is None else min(self.devices, EFFECT_DEVICES)
        return drive.reached(single, around, count, self.seed)


@dataclass(frozen=True)
class _Drive:
    epsilon: float
    lam: Floats
    omega: float
    suddenly: bool

    def reached(self, single: Device, around: Surroundings, count: int, seed: int) -> OutcomeOfMany:
        """Integrate the full equations until what the beginning stirs up has died down, and look."""
        rate_hz, n = single.amplifier.rate_hz, single.chain_length
        dtau = single.tau_per_s / rate_hz
        if not self.omega * dtau <= COARSEST:
            raise AppError(f"--as-built: omega {self.omega:g} is too fast for the {rate_hz:g} samples a second")
        settling, look = (
            DIED_DOWN * (n + 1) / max(single.delta, 1e-300),
            math.ceil(PERIODS * math.tau / self.omega / dtau),
        )
        begin = settling if self.suddenly else 2 * settling
        if begin / dtau > MOST_SAMPLES:
            raise AppError(f"--as-built: at a delta of {single.delta:g} a motion takes too long to settle")
        first = math.ceil(begin / dtau)
        drawn = DrawnDevices(
            single, around, first=0, count=count, seed=seed, rate_hz=rate_hz, frames=2, weights=3
        )  # fmt: skip
        amplifier, gram = CommonAmplifier(single, around), np.zeros((2, 3, 3))
        rise = 0.0 if self.suddenly else settling
        for index in _blocks(first + 2 * look):
            tau = dtau * index.astype(np.float64)
            frame = np.where(index < first, -1, np.where(index < first + look, 0, 1))
            basis = np.stack([np.ones(len(tau)), np.cos(self.omega * tau), np.sin(self.omega * tau)], axis=1)
            for number in range(2):
                gram[number] += basis[frame == number].T @ basis[frame == number]
            drawn.advance(self._force(tau, rise, dtau, single, amplifier), self._links(len(tau)), frame, basis[None])
        return _seen(drawn, gram)

    def _force(self, tau: Floats, rise: float, dtau: float, single: Device, amplifier: CommonAmplifier) -> Floats:
        # What lines between samples take from a tone.
        half = 0.5 * self.omega * dtau
        height = self.epsilon * (half / math.sin(half)) ** 2
        envelope = np.minimum(tau / rise, 1.0) if rise else 1.0
        volts = (height * envelope * np.cos(self.omega * tau) / single.epsilon_per_volt)[:, None]
        force = np.zeros((len(tau), 1, single.cols))
        force[:, 0, :1] = single.epsilon_per_volt * amplifier.advance(volts)
        return force

    def _links(self, samples: int) -> Floats:
        return np.broadcast_to(self.lam, (samples, 1, len(self.lam)))


def _blocks(samples: int) -> Iterator[NDArray[np.int64]]:
    for first in range(0, samples, BLOCK):
        yield np.arange(first, min(first + BLOCK, samples))


def _seen(drawn: DrawnDevices, gram: Floats) -> OutcomeOfMany:
    sums = drawn.load[:, :, 0]  # devices, stretches, n, weights
    escaped = (drawn.escaped >= 0) | ~np.isfinite(sums).all(axis=(1, 2, 3))
    sums = np.where(escaped[:, None, None, None], 0.0, sums)
    parts = np.stack(
        [np.linalg.solve(gram[k], sums[:, k].reshape(-1, 3).T).T.reshape(sums[:, k].shape) for k in (0, 1)]
    )
    phasor = parts[..., 1] - 1j * parts[..., 2]
    off = np.abs(phasor[1] - phasor[0]).max(axis=1) > AGREE * np.abs(phasor[1]).max(axis=1)
    outcome = np.where(escaped, "escaped", np.where(off, "not_locked", "ok"))
    return OutcomeOfMany(outcome, np.where(escaped[:, None], np.nan, np.abs(phasor[1])))


def _judged(each: dict[str | None, OutcomeOfMany], outcome: str, amplitude: Floats) -> tuple[float, int, float, str]:
    """`AS_BUILT_FIELDS` of one setting."""
    if outcome not in SEEN:
        return math.nan, -1, math.nan, ""
    shares = {effect: float(np.mean(one.outcome == outcome)) for effect, one in each.items()}
    off = {effect: _off(one, amplitude) for effect, one in each.items()}
    known = off[None][np.isfinite(off[None])]
    worst = int(np.nanargmax(off[None])) if len(known) else -1
    effects = [effect for effect in each if effect is not None]
    # The one that alone keeps most from it; where all reach it, the one that moves them farthest.
    spoiler = min(effects, key=lambda one: (shares[one], -np.nanmax(off[one], initial=0.0)), default="")
    return shares[None], worst, float(known.max()) if len(known) else math.nan, spoiler


def _off(reached: OutcomeOfMany, amplitude: Floats) -> Floats:
    """Median deviation of each actuator over the largest nominal amplitude; NaN where nothing is known."""
    scale = np.abs(amplitude).max()
    known = reached.amplitude[np.isfinite(reached.amplitude).all(axis=1)]
    if not (len(known) and np.isfinite(scale) and scale > 0):
        return np.full(len(amplitude), np.nan)
    return np.asarray(np.median(np.abs(known - np.abs(amplitude)), axis=0) / scale)
