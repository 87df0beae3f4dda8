"""Deflection per volt, hysteresis and creep of biased actuators, learned from the pages they hold, and made good."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome

from ..operating_point import OperatingPoint
from ..plan import FramePlan, Plan, Ramp
from .bias_history import BiasHistory
from .device_estimate import TOLD, EstimateError
from .measurement import Measured
from .stages import SensorNoise

__all__ = ["BiasEstimate", "Held"]

Floats = NDArray[np.float64]

# Radii of the play operators, over the force that holds full scale.
RADII = np.array([1 / 16, 1 / 8, 1 / 4, 1 / 2])
# What is taken to be known before any page, standard deviations: what a volt makes, relative; the weights of all plays
# together (a loop of 10 % is usual); creep a decade.
BASE, LOOP, CREEP = 0.05, 0.1, 0.02
WIDE = np.array([BASE, *np.full(len(RADII), LOOP / np.sqrt(len(RADII))), CREEP])
# Resonance periods in which the volts go out at the end, as deflections do.
WAY_OUT_PERIODS = 8


@dataclass(frozen=True)
class BiasEstimate:
    """What a biased device makes of its voltages, as far as it is known, and what it remembers of them.

    The force on an actuator is ``terms @ numbers``: its share of the electric force, a weight for every play operator,
    and creep a decade. It is linear in the numbers, so each page is one step of Kalman's filter.

    Attributes
    ----------
    device : its stiffness, cubic term and links are taken as they are said to be.
    mean : float64, shape (actuators, R + 2).
    covariance : float64, shape (actuators, R + 2, R + 2).
    history : what the actuators remember.
    """

    device: Device
    mean: Floats
    covariance: Floats
    history: BiasHistory

    @classmethod
    def of(cls, device: Device) -> BiasEstimate:
        """Before any page, at rest: what the profile says, without hysteresis and creep.

        Raises
        ------
        EstimateError
            When the device has no bias.
        """
        if device.bias != "actuator":
            raise EstimateError(f"{device.name}: it has no bias on every actuator; nothing to be learned of one")
        count, size = device.rows * device.cols, len(RADII) + 2
        mean = np.zeros((count, size))
        mean[:, 0] = 1.0
        covariance, rest = np.tile(np.diag(WIDE**2), (count, 1, 1)), BiasHistory.at_rest(count, np.zeros(0))
        estimate = cls(device, mean, covariance, rest)
        return replace(estimate, history=estimate._fresh)

    @property
    def full_force(self) -> float:
        """What holds full scale by the profile."""
        return self.device.full_scale + self.device.beta * self.device.full_scale**3

    @property
    def gain(self) -> Floats:
        """What an actuator makes of the volts for full scale the first time, over the profile's; shape (actuators,)."""
        full = np.full(len(self.mean), self.full_force)
        return np.asarray(np.sum(self._fresh.terms(full, 0.0) * self.mean, axis=1) / full)

    @property
    def loop(self) -> Floats:
        """How much wider the force is at half of full scale on the way down, over that of full scale; as `gain`."""
        half, full = (np.full(len(self.mean), share * self.full_force) for share in (0.5, 1.0))
        ways = self._fresh, self._fresh.after(full, 0.0)
        up, down = (np.sum(way.terms(half, 0.0) * self.mean, axis=1) for way in ways)
        return np.asarray((down - up) / full)

    @property
    def creep(self) -> Floats:
        """Growth of a constant force's effect in a decade of time, over the force; shape (actuators,)."""
        return np.asarray(self.mean[:, -1])

    def after(self, frame: FramePlan, measured: Measured | None, noise: SensorNoise) -> BiasEstimate:
        """The estimate once a frame is over, as it was set.

        Parameters
        ----------
        measured : over the second half of the time its pattern stood; None where nothing was measured: it is
            remembered all the same.
        """
        force = np.concatenate([state.bias for state in frame.states])
        hold_s = frame.end_s - frame.settled_s
        kept = replace(self, history=self.history.after(force, hold_s))
        if measured is None:
            return kept
        terms = self.history.terms(force, 0.75 * hold_s)
        z = measured.mean
        deviation = self._stiffness(z) * np.maximum(noise.relative * np.abs(z), noise.absolute)
        with np.errstate(invalid="ignore"):
            spread = np.einsum("akl,al->ak", self.covariance, terms)
            total = np.einsum("ak,ak->a", terms, spread) + deviation**2
            gain = spread / np.where(total > 0, total, np.inf)[:, None]
            off = self._force(frame.states, z) - np.sum(terms * self.mean, axis=1)
        gain[~np.isfinite(off)], off[~np.isfinite(off)] = 0.0, 0.0
        rest = np.eye(terms.shape[1]) - gain[:, :, None] * terms[:, None, :]
        covariance = rest @ self.covariance @ rest.transpose(0, 2, 1)
        covariance += (
            np.where(np.isfinite(deviation), deviation, 0.0)[:, None, None] ** 2 * gain[:, :, None] * gain[:, None, :]
        )
        return replace(kept, mean=self.mean + gain * off[:, None], covariance=covariance)

    def corrected(self, plan: Plan) -> Plan:
        """The plan with voltages that hold its deflections on the device as it is known, from what it remembers on.

        A frame that would need more than the amplifier's volts is unreachable.
        """
        return replace(plan, frames=_Corrected(self, plan))

    def faded(self, share: float) -> BiasEstimate:
        """As much surer than before any page as is left when a share of it has faded; the numbers stay."""
        return replace(self, covariance=(1 - share) * self.covariance + share * np.diag(WIDE**2))

    def held(self, frame: FramePlan, before: Held, most: float = math.inf) -> tuple[FramePlan, Held]:
        """One frame with voltages that hold its deflections, from what is remembered on; and what is held then.

        `most` : by which forces may leave those of the frame.
        """
        wanted, set_to, stays = before
        force = np.concatenate([state.bias for state in frame.states])
        found = self.history.inverse(force, self.mean, 0.75 * (frame.end_s - frame.settled_s))
        found = np.clip(found, force - most, force + most)
        # What stays as it is gets no step, and the way out ends without volts.
        stays = stays | (frame.settled_s <= frame.start_s)
        found = np.where(stays & (force == wanted), set_to, found) if frame.frame else np.zeros_like(found)
        done = _led(frame, self.device.chain_length, (wanted, force), (set_to, found))
        return done, Held(force, found, np.ones_like(stays))

    @property
    def told(self) -> NDArray[np.bool_]:
        """Of which actuators the pages told what a volt makes; bool, shape (actuators,)."""
        return np.asarray(self.covariance[:, 0, 0] < (TOLD * BASE) ** 2, dtype=np.bool_)

    @property
    def _fresh(self) -> BiasHistory:
        return BiasHistory.at_rest(len(self.mean), RADII * self.full_force)

    def _stiffness(self, z: Floats) -> Floats:
        own = self._chains("stiffness") + 3 * self._chains("betas") * z**2
        return np.asarray(own + self.device.coupling.lam.min)

    def _force(self, states: Sequence[OperatingPoint], z: Floats) -> Floats:
        """What holds the deflections `z`, float64, shape (actuators,)."""
        n = self.device.chain_length
        lam = np.array([np.append(0.0, state.lam) for state in states]).ravel()
        before = np.roll(z, 1)
        before[::n] = 0.0
        pulled = np.where(lam == 0, 0.0, lam * (before - z))
        return np.asarray(self._chains("stiffness") * z + self._chains("betas") * z**3 - pulled)

    def _chains(self, name: str) -> Floats:
        device = self.device
        chains = (device.chain_at(*divmod(at, device.chains_per_row)) for at in range(device.chains))
        return np.concatenate([np.broadcast_to(getattr(chain, name), device.chain_length) for chain in chains])


class Held(NamedTuple):
    """What actuators are to be held at, what they are set to for it, float64, and whether the latter stays as it is;
    shape (actuators,) each.
    """

    wanted: Floats
    set_to: Floats
    stays: NDArray[np.bool_]

    @classmethod
    def at_rest(cls, actuators: int) -> Held:
        """Nothing held."""
        return cls(np.zeros(actuators), np.zeros(actuators), np.zeros(actuators, dtype=np.bool_))


class _Corrected:
    """The frames of a plan with other voltages, as often as they are asked for."""

    def __init__(self, known: BiasEstimate, plan: Plan) -> None:
        self._known, self._plan = known, plan

    def __iter__(self) -> Iterator[FramePlan]:
        known, device = self._known, self._known.device
        held, end_s = Held.at_rest(len(known.mean)), 0.0
        for frame in self._plan.frames:
            done, held = known.held(frame, held)
            most = float(np.abs(held.set_to).max())
            if frame.outcome is Outcome.OK and most > device.bias_max:
                takes = f"it takes {most / device.bias_per_volt:.3g} V"
                note = f"{device.name} cannot hold this pattern as it was found to be: {takes}."
                done = replace(done, outcome=Outcome.UNREACHABLE, note=note)
            yield done
            known, end_s = known.after(done, None, SensorNoise(0.0)), frame.end_s
        wanted, set_to, _ = held
        if set_to.any():
            # The plan thought itself at rest: what held off loops and creep still goes out.
            ramp_s = WAY_OUT_PERIODS / device.f0_hz
            stop_s = end_s + (int(ramp_s * device.amplifier.rate_hz) + 2) / device.amplifier.rate_hz
            last = replace(
                frame, frame=None, start_s=end_s, settled_s=end_s + ramp_s, end_s=stop_s,
                ramps=(None,) * len(frame.ramps), outcome=Outcome.OK, note="", spread=None,
            )  # fmt: skip
            yield _led(last, device.chain_length, (wanted, wanted), (set_to, np.zeros_like(set_to)))


def _led(frame: FramePlan, n: int, plain: tuple[Floats, Floats], led: tuple[Floats, Floats]) -> FramePlan:
    """A frame whose biases go from one to the other of `led`, float64, shape (actuators,), in the place of `plain`."""
    chains = [part.reshape(-1, n) for part in (*plain, *led)]
    way_s = frame.settled_s - frame.start_s
    ramps = [_ramp(ramp, way_s, *parts) for ramp, *parts in zip(frame.ramps, *chains, strict=True)]
    states = [replace(state, bias=bias) for state, bias in zip(frame.states, chains[-1], strict=True)]
    return replace(frame, states=tuple(states), ramps=tuple(ramps))


def _ramp(ramp: Ramp | None, way_s: float, before: Floats, after: Floats, first: Floats, last: Floats) -> Ramp | None:
    """A ramp from `before` to `after` led from `first` to `last`; float64, shape (n,) each.

    What had nowhere to go goes by a cubic that begins and ends level.
    """
    step = after - before
    if (ramp is None or ramp.bias is None) and np.array_equal(first, last):
        return ramp
    led = ramp or Ramp(t_s=np.array([0.0, way_s]))
    x = (led.t_s / led.duration_s)[:, None]
    bias, slope = (np.zeros((len(x), len(first))) if one is None else one for one in (led.bias, led.bias_slope))
    stretch = (last - first) / np.where(step == 0, 1.0, step)
    way = np.where(step == 0, first + (last - first) * x**2 * (3 - 2 * x), first + stretch * (bias - before))
    rate = np.where(step == 0, (last - first) * 6 * x * (1 - x) / led.duration_s, stretch * slope)
    return replace(led, bias=way, bias_slope=rate)
