"""A device corrected while it is used: what was measured of each frame leads those after it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..plan import FramePlan, Plan
from .bias_estimate import BiasEstimate, Held
from .chain_correction import Factors, factors_for, led
from .device_estimate import FADED, DeviceEstimate
from .measurement import Measured
from .stages import SensorNoise

__all__ = ["Adaptation", "AdaptationReport"]

Floats = NDArray[np.float64]

# Frames whose measurement may still come: a line that measures late is not waited for.
MOST_WAITING = 64
# Seconds of a way between two corrections of a pattern that stays, or a third of its frame.
WAY_S = 0.15
# Of what a sensor says, relative: its gain, and the harmonic's own balance while it still changes.
RELATIVE = 0.01
# A force that holds leaves the plan by no more than this share of what holds full scale.
ROOM = 0.3


@dataclass(frozen=True)
class AdaptationReport:
    """How the correction went.

    Attributes
    ----------
    errors : of each frame that was measured the mean over chains (or of a bias over actuators) of the largest
        deviation, as measured, in units of full scale.
    told : for how many actuators stiffness and gain together, or the deflection of a volt, were told.
    actuators : of how many.
    limited : how many times a correction stood at its limits.
    touched : how many times a chain moved as nobody could expect, such as under a finger.
    strange : rows and columns of actuators that are not of this device's kind.
    """

    errors: tuple[float, ...]
    told: int
    actuators: int
    limited: int
    touched: int
    strange: tuple[tuple[int, int], ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        return vars(self) | {"errors": list(self.errors), "strange": [list(place) for place in self.strange]}

    def as_lines(self) -> tuple[str, ...]:
        """Sentences of plain text."""
        if not self.errors:
            return ("Nothing was measured, so nothing was corrected; its controller must sense its actuators.",)
        first, last = self.errors[0], self.errors[-1]
        lines = [
            f"{len(self.errors)} frames measured: error of the first {first:.1%} of full scale, of the last {last:.1%}",
            f"identified: {self.told} of {self.actuators} actuators; the others stay as they were known",
        ]
        if self.touched:
            lines.append(f"{self.touched} times a chain moved as nobody could expect; it was learned anew.")
        if self.limited:
            lines.append(f"{self.limited} times a correction stood at its limits.")
        lines += [f"Row {row}, column {col}: no actuator of this profile moves so." for row, col in self.strange]
        return tuple(lines)


class Adaptation:
    """What is known of a device, and the frames of a plan corrected by it.

    Frames go through `corrected` in the order of the time line; `learned` takes what was measured of any of them as it
    comes. What is known fades slowly, so that a device that changes is followed; a chain that moves as nobody could
    expect is learned anew. Drives and links leave the plan in small steps, and within the device.

    Parameters
    ----------
    device : the profile that was planned for.
    noise : standard deviation of what a sensor says, in units of full scale.
    phases : whether sensors tell phases.

    Raises
    ------
    EstimateError
        When its chains are rings.
    """

    def __init__(self, device: Device, *, noise: float = 0.002, phases: bool = True) -> None:
        self._device, self._phases = device, phases
        absolute = max(noise, 1e-4) * device.full_scale
        self._noise, self._still = SensorNoise(RELATIVE, absolute), SensorNoise(0.0, absolute)
        self._known = DeviceEstimate.of(device)
        self._bias = BiasEstimate.of(device) if device.bias == "actuator" else None
        chains = device.chains
        self._factors = [Factors.none(device.chain_length)] * chains
        self._held = Held.at_rest(device.rows * device.cols)
        self._waiting: deque[tuple[int, FramePlan]] = deque(maxlen=MOST_WAITING)
        self._count = self._limited = self._touched = 0
        self._errors: list[float] = []

    def adapted(self, plan: Plan) -> Plan:
        """The plan with each frame corrected as it is drawn; to be drawn once."""
        return replace(plan, frames=self._drawn(plan))

    def _drawn(self, plan: Plan) -> Iterator[FramePlan]:
        for frame in plan.frames:
            yield self.corrected(frame)

    @property
    def device(self) -> Device:
        """The device with its actuators as they are known now."""
        return self._known.corrected()

    def corrected(self, frame: FramePlan) -> FramePlan:
        """The next frame of the time line as the device should be set to it."""
        if self._bias is not None and not any(state.moving for state in frame.states):
            done, self._held = self._holding(frame)
        else:
            done = self._vibrating(frame)
        if frame.frame is not None:
            self._waiting.append((self._count, done))
            self._count += 1
        return done

    def learned(self, measured: Measured) -> None:
        """Take what was measured of a frame; of one that is not waited for, nothing is learned."""
        frame = next((one for number, one in self._waiting if number == measured.frame), None)
        while self._waiting and self._waiting[0][0] <= measured.frame:
            number, passed = self._waiting.popleft()
            if self._bias is not None:
                seen = measured if number == measured.frame else None
                self._bias = self._bias.faded(FADED).after(passed, seen, self._still)
        if frame is None:
            return
        self._judge(frame, measured)
        if any(state.moving for state in frame.states):
            # Over the second half of the time that the pattern stands.
            window = (frame.end_s - frame.settled_s) / 2 * self._device.tau_per_s
            self._known, touched = self._known.followed(
                frame.states, measured, self._noise, phases=self._phases, window=window
            )
            self._touched += touched

    def report(self) -> AdaptationReport:
        """How it went so far."""
        told = np.any(self._known.told[:, [0, 3]], axis=1)
        if self._bias is not None:
            told = told | self._bias.told
        strange = tuple(divmod(int(at), self._device.cols) for at in np.flatnonzero(self._known.strange))
        return AdaptationReport(tuple(self._errors), int(told.sum()), told.size, self._limited, self._touched, strange)

    def _holding(self, frame: FramePlan) -> tuple[FramePlan, Held]:
        assert self._bias is not None
        ahead, most = self._bias, ROOM * self._bias.full_force
        for _, passed in self._waiting:
            ahead = ahead.after(passed, None, self._still)
        done, held = ahead.held(frame, self._held, most)
        within = self._device.bias_max
        if np.abs(held.set_to).max() > within:
            self._limited += 1
            done, held = ahead.held(frame, self._held, 0.0)
        return done, held

    def _vibrating(self, frame: FramePlan) -> FramePlan:
        length_s = frame.end_s - frame.start_s
        way_s = frame.settled_s - frame.start_s or min(WAY_S, length_s / 3)
        states, ramps = list(frame.states), list(frame.ramps)
        known = [one.believed(prior) for one, prior in zip(self._known.chains, self._known.prior, strict=True)]
        for at, (state, ramp) in enumerate(zip(frame.states, frame.ramps, strict=True)):
            before = after = self._factors[at]
            if state.epsilon and not state.tones:
                after = factors_for(self._device, self._known.prior[at].mean, known[at], state, before)
                rising = ramp is not None and ramp.epsilon is not None and ramp.epsilon[0] == 0
                before = after if rising else before
            elif ramp is None:
                continue
            states[at], ramps[at] = led(self._device, state, ramp, way_s, before, after)
            self._factors[at] = after
        longest = max((ramp.duration_s for ramp in ramps if ramp is not None), default=0.0)
        settled_s = max(frame.settled_s, frame.start_s + longest)
        return replace(frame, states=tuple(states), ramps=tuple(ramps), settled_s=settled_s)

    def _judge(self, frame: FramePlan, measured: Measured) -> None:
        n, scale = self._device.chain_length, self._device.full_scale
        target = np.array([state.target for state in frame.states])
        moving = np.array([state.moving for state in frame.states])
        felt = np.where(moving[:, None], np.abs(measured.harmonic).reshape(-1, n), measured.mean.reshape(-1, n)) / scale
        off = np.nan_to_num(np.abs(felt - target))
        self._errors.append(float(off.max(axis=1).mean() if moving.any() else np.sqrt(np.mean(off**2))))
