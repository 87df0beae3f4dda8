"""A device as far as it is known, page by page: what its actuators are, and the profile that says so."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Actuator, Closure, Device, PlusMinus

from ..errors import PlanError
from ..operating_point import OperatingPoint
from ..robustness.spread import RelativeSpread, known_spread
from .amplitudes import PAGES_KEPT, fit_amplitudes
from .measurement import Measured
from .stages import ChainEstimate, ChainPage, SensorNoise

__all__ = ["DeviceEstimate", "EstimateError", "prior_spread"]

Floats = NDArray[np.float64]

# Where the profile says nothing of its actuators' spread: as `assumed` has it for natural frequencies; 5 % of damping,
# 10 % of the cubic term, 2 % of what links make of lam; and 3 % of what a drive makes of a volt, which no profile says.
ASSUMED = RelativeSpread(f0=0.01, delta=0.05, beta=0.1, lam=0.02)
ASSUMED_DRIVE = 0.03
# Half width of a 95 % confidence interval over its standard deviation.
HALF_WIDTH = NormalDist().inv_cdf(0.975)
# A number is told where its standard deviation has become this share of what it was, or less.
TOLD = 0.7
# Of a device in use this share of what was known fades with every page; and a page whose balances lie so many variances
# off, in the mean, is one of a chain that has changed.
FADED, SURPRISE = 0.001, 8.0


class EstimateError(PlanError, ValueError):
    """A device cannot be identified from the pages it shows.

    Examples: chains that are rings; measurements of another number of actuators.
    """


def prior_spread(device: Device) -> RelativeSpread:
    """How far actuators are taken to lie from the profile's numbers: as it says, and else assumed."""
    told = known_spread(device)
    return RelativeSpread(*(getattr(told, name) or getattr(ASSUMED, name) for name in ("f0", "delta", "beta", "lam")))


@dataclass(frozen=True)
class DeviceEstimate:
    """What is known of every actuator, before any page and after those shown.

    Attributes
    ----------
    device : the profile all numbers are relative to; what it says of single actuators is where the estimate begins.
    prior, chains : of every chain, row by row, what was known before any page, and what is known now.
    pages : the last pages of every chain, where only amplitudes are measured.
    """

    device: Device
    prior: tuple[ChainEstimate, ...]
    chains: tuple[ChainEstimate, ...]
    pages: tuple[tuple[ChainPage, ...], ...]

    @classmethod
    def of(cls, device: Device) -> DeviceEstimate:
        """Before any page: the profile's numbers, with its spread or, of single actuators, their confidence intervals.

        Raises
        ------
        EstimateError
            When its chains are rings.
        """
        if device.coupling.closure is not Closure.OPEN:
            raise EstimateError(
                f"{device.name}: its chains are {device.coupling.closure}; only open chains are identified"
            )
        places = [(row, index) for row in range(device.rows) for index in range(device.chains_per_row)]
        known = {(one.row, one.col): one for one in device.actuators}
        prior = tuple(_prior(device, known, *place) for place in places)
        return cls(device, prior, prior, ((),) * len(prior))

    def after(
        self,
        states: Sequence[OperatingPoint],
        measured: Measured,
        noise: SensorNoise,
        *,
        phases: bool = True,
        window: float | None = None,
    ) -> DeviceEstimate:
        """The estimate after one more page.

        Parameters
        ----------
        states : what every chain was set to, as the plan of the page has it. Chains at rest, held by a bias, or driven
            at several tones tell nothing here.
        measured : how the actuators moved.
        phases : whether phases were measured; where they were not, the last pages are fitted together.
        window : for how long it was measured, in tau, where the page has not settled.
        """
        chains, pages = list(self.chains), list(self.pages)
        for number, page in self._pages_seen(states, measured, window):
            if phases:
                chains[number] = chains[number].after(page, noise)
            else:
                pages[number] = (*pages[number], page)[-PAGES_KEPT:]
                chains[number] = fit_amplitudes(self.prior[number], pages[number], noise)
        return replace(self, chains=tuple(chains), pages=tuple(pages))

    def followed(
        self,
        states: Sequence[OperatingPoint],
        measured: Measured,
        noise: SensorNoise,
        *,
        phases: bool = True,
        window: float | None = None,
    ) -> tuple[DeviceEstimate, int]:
        """The estimate after one more page of a device that changes while it is used; arguments as of `after`.

        What was known before fades a little with every page of its chain. A chain that moves as nobody could expect is
        learned anew from where it is; how many did is given too.
        """
        chains, pages, anew = list(self.chains), list(self.pages), 0
        for number, page in self._pages_seen(states, measured, window):
            prior = self.prior[number]
            if phases:
                chains[number] = chains[number].faded(prior, FADED)
                if chains[number].surprise(page, noise) > SURPRISE:
                    chains[number], pages[number], anew = chains[number].faded(prior, 1.0), (), anew + 1
        faded = replace(self, chains=tuple(chains), pages=tuple(pages))
        return faded.after(states, measured, noise, phases=phases, window=window), anew

    def _pages_seen(
        self, states: Sequence[OperatingPoint], measured: Measured, window: float | None
    ) -> Iterator[tuple[int, ChainPage]]:
        """The pages of the chains that were driven at one tone, by their numbers."""
        n = self.device.chain_length
        for number, (state, phasor) in enumerate(zip(states, self._seen(measured), strict=True)):
            if state.epsilon and not state.tones:
                turn = np.exp(-1j * np.angle(state.epsilon))
                page = ChainPage(abs(state.epsilon), state.lam, state.omega, phasor * turn)
                if window is not None and measured.change is not None and measured.rest is not None:
                    place = slice(number * n, number * n + n)
                    page = page._replace(rate=measured.change[place] * turn / window, rest=measured.rest[place])
                yield number, page

    def _seen(self, measured: Measured) -> NDArray[np.complex128]:
        count = self.device.rows * self.device.cols
        if len(measured.harmonic) != count:
            seen = len(measured.harmonic)
            raise EstimateError(f"{self.device.name} has {count} actuators, {seen} were measured; give its own profile")
        return measured.harmonic.reshape(-1, self.device.chain_length)

    @property
    def mean(self) -> Floats:
        """The numbers of all actuators, row by row, float64, shape (actuators, 4), within what can be believed."""
        return np.concatenate([one.believed(prior) for one, prior in zip(self.chains, self.prior, strict=True)])

    @property
    def deviation(self) -> Floats:
        """Standard deviations of these, float64, shape (actuators, 4)."""
        return np.concatenate([one.deviation for one in self.chains])

    @property
    def told(self) -> NDArray[np.bool_]:
        """Which numbers the pages have told, bool, shape (actuators, 4); of the others what was known before stays."""
        before: Floats = np.concatenate([one.deviation for one in self.prior])
        return np.asarray((self.deviation <= TOLD * before) & (before > 0), dtype=np.bool_)

    @property
    def strange(self) -> NDArray[np.bool_]:
        """Actuators that lie beyond what can be believed, bool, shape (actuators,)."""
        mean: Floats = np.concatenate([one.mean for one in self.chains])
        return np.asarray(np.any(mean != self.mean, axis=1))

    def corrected(self) -> Device:
        """The device with its actuators as they are known now; its spread, if it has one, is what is left.

        An estimate that begins with this device has forgotten which errors of an actuator's numbers go together.
        """
        device, mean, wide = self.device, self.mean, self.deviation
        actuators = tuple(
            _entry(device, divmod(at, device.cols), mean[at], HALF_WIDTH * wide[at]) for at in range(len(mean))
        )
        return device.model_copy(update={"actuators": actuators, "spread": self._left()})

    def _left(self) -> Any:
        """The profile's spread with what is left of each number's."""
        told = self.device.spread
        if told is None:
            return None
        share = np.sqrt(np.mean((self.deviation / np.maximum(np.abs(self.mean), np.finfo(float).tiny)) ** 2, axis=0))
        left = dict(zip(("frequency", "damping", "beta", "lam"), (share * [0.5, 1, 1, 1]).tolist(), strict=True))
        return told.model_copy(update={name: min(value, getattr(told, name)) for name, value in left.items()})


def _prior(device: Device, known: Mapping[tuple[int, int], Actuator], row: int, index: int) -> ChainEstimate:
    """What is known of one chain before any page."""
    chain, spread, first = device.chain_at(row, index), prior_spread(device), index * device.chain_length
    drive = device.drive_per_volt(row, index) / device.epsilon_per_volt
    gain = np.append(drive, device.lam_gain(row, index))
    mean = np.stack(np.broadcast_arrays(chain.stiffness, chain.deltas, chain.betas, gain), axis=1)
    share = np.tile([2 * spread.f0, spread.delta, spread.beta, spread.lam], (device.chain_length, 1))
    share[0, 3] = ASSUMED_DRIVE
    wide = share * np.abs(mean)
    for m in range(device.chain_length):
        one = known.get((row, first + m))
        for k, width in enumerate(_told_before(device, one) if one else ()):
            wide[m, k] = wide[m, k] if width is None else width / HALF_WIDTH
    return ChainEstimate(mean, np.diag(wide.ravel() ** 2))


def _told_before(device: Device, one: Actuator) -> tuple[float | None, ...]:
    """Half widths of what is known of an actuator, in the order and units of the estimate; None where nothing is."""
    wide = one.plus_minus
    stiffness = None if wide.f0_hz is None or one.f0_hz is None else 2 * one.f0_hz * wide.f0_hz / device.f0_hz**2
    drive = None if wide.epsilon_per_volt is None else wide.epsilon_per_volt / device.epsilon_per_volt
    link = None if wide.lam is None or one.lam_set is None else wide.lam / one.lam_set
    return stiffness, wide.delta, wide.beta, drive if link is None else link


def _entry(device: Device, place: tuple[int, int], mean: Floats, wide: Floats) -> Actuator:
    """One actuator of a profile: `mean` and half widths `wide`, float64, shape (4,) each."""
    (row, col), (stiffness, delta, beta, gain) = place, mean.tolist()
    f0_hz = device.f0_hz * stiffness**0.5
    near = {"f0_hz": device.f0_hz**2 * float(wide[0]) / (2 * f0_hz), "delta": float(wide[1]), "beta": float(wide[2])}
    found: dict[str, float] = {"f0_hz": f0_hz, "delta": delta, "beta": beta}
    if col % device.chain_length:
        lam_set = device.coupling.lam.max or 1.0
        found |= {"lam": gain * lam_set, "lam_set": lam_set}
        near["lam"] = float(wide[3]) * lam_set
    else:
        found["epsilon_per_volt"] = gain * device.epsilon_per_volt
        near["epsilon_per_volt"] = float(wide[3]) * device.epsilon_per_volt
    return Actuator(row=row, col=col, plus_minus=PlusMinus(**near), **found)
