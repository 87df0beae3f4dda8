"""A device whose actuators nobody knows, and the pages it shows: harmonic balance of what it really is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Actuator, AsBuilt, Device, Outcome, Setting, balance_near
from drivers import Waveform
from planner import FramePlan, Measured, OperatingPoint, Plan
from planner.robustness.batch_march import BatchParts, march

Complexes = NDArray[np.complex128]


def drawn(
    device: Device, seed: int, *, f0: float, delta: float = 0.05, lam: float = 0.02, drive: float = 0.03
) -> Device:
    """The device as it really is: every number drawn, standard deviations relative."""
    rng, n, actuators = np.random.default_rng(seed), device.chain_length, []
    for row, col in np.ndindex(device.rows, device.cols):
        x, first = rng.standard_normal(4), col % n == 0
        actuators.append(
            Actuator(
                row=row, col=col, f0_hz=device.f0_hz * (1 + f0 * x[0]), delta=device.delta * (1 + delta * x[1]),
                lam=None if first else 1 + lam * x[2], lam_set=None if first else 1.0,
                epsilon_per_volt=device.epsilon_per_volt * (1 + drive * x[3]) if first else None,
            )
        )  # fmt: skip
    return device.model_copy(update={"actuators": tuple(actuators)})


@dataclass(frozen=True)
class HiddenDevice:
    """What shows pages and is measured; `noise` of either part of a phasor, relative, `floor` of full scale."""

    truth: Device
    noise: float
    rng: np.random.Generator
    floor: float = 0.0

    def motion(self, states: Sequence[OperatingPoint]) -> Complexes:
        """First harmonics of every chain set to a state, shape (chains, n)."""
        device = self.truth
        places = [(row, index) for row in range(device.rows) for index in range(device.chains_per_row)]
        return np.array([self._motion(state, *place) for state, place in zip(states, places, strict=True)])

    def _motion(self, state: OperatingPoint, row: int, index: int) -> Complexes:
        device, chain = self.truth, self.truth.chain_at(row, index)
        epsilon = state.epsilon * device.drive_per_volt(row, index) / device.epsilon_per_volt
        lam = state.lam * device.lam_gain(row, index)
        force = np.append(epsilon, np.zeros(len(lam)))
        parts = BatchParts(chain.stiffness, chain.deltas, chain.betas, np.ones(chain.n))
        guess = march(parts, force, np.append(0.0, lam), state.omega).phasor
        setting = Setting.of(
            chain, epsilon=abs(epsilon), phase=np.angle(epsilon), lam=lam[None] if len(lam) else 0.0, omega=state.omega
        )
        answer = balance_near(chain, setting, guess[None], tol=1e-9)
        assert Outcome(answer.outcome[0]) is Outcome.OK
        return np.asarray(answer.phasor[0])

    def measured(self, states: Sequence[OperatingPoint], frame: int = 0) -> Measured:
        """What a sensor says of a page."""
        seen = self.motion(states)
        noise = self.rng.standard_normal(seen.shape) + 1j * self.rng.standard_normal(seen.shape)
        seen = (seen + (self.noise * seen + self.floor * self.truth.full_scale) * noise).ravel()
        return Measured(frame, np.zeros(len(seen)), seen)

    def errors(self, states: Sequence[OperatingPoint]) -> NDArray[np.float64]:
        """Largest deviation from the target of every chain, in units of full scale."""
        felt = np.abs(self.motion(states)) / self.truth.full_scale
        return np.asarray(np.abs(felt - np.array([state.target for state in states])).max(axis=1))


@dataclass(frozen=True)
class HiddenGrid:
    """A line to a device whose chains are driven: the full equations under the samples of a plan.

    Each frame is measured over the second half of the time its pattern stands; `noise` is relative.
    """

    truth: Device
    noise: float
    rng: np.random.Generator

    def __call__(self, plan: Plan) -> list[Measured]:
        """Play from rest and measure."""
        device, frames = self.truth, list(plan.frames)
        wave, built = Waveform.of(plan), AsBuilt(device)
        volts = np.concatenate(list(wave.blocks(1 << 14)))
        force = np.zeros((len(volts), device.rows, device.cols))
        for channel in wave.channels:
            place = channel.row, channel.col or 0
            force[:, *place] += volts[:, channel.index] * built.drive_per_volt[place]
        z = built.integrator(wave.rate_hz).advance(force, self._lam(frames, len(volts), wave.rate_hz) * built.lam_gain)
        return [self._seen(number, frame, z, wave.rate_hz) for number, frame in enumerate(frames) if frame.frame]

    def _lam(self, frames: Sequence[FramePlan], samples: int, rate_hz: int) -> NDArray[np.float64]:
        """What the links are set to at every sample, float64, shape (S, rows, cols)."""
        device = self.truth
        lam, t_s = (
            np.zeros((samples, device.rows * device.chains_per_row, device.chain_length)),
            np.arange(samples) / rate_hz,
        )
        for frame in frames:
            here = (t_s >= frame.start_s) & (t_s < frame.end_s)
            for chain, (state, ramp) in enumerate(zip(frame.states, frame.ramps, strict=True)):
                lam[here, chain, 1:] = state.lam
                if ramp is not None and ramp.lam is not None and ramp.lam_t_s is not None:
                    on_the_way = here & (t_s < frame.start_s + ramp.lam_t_s[-1])
                    since_s = t_s[on_the_way] - frame.start_s
                    course = [np.interp(since_s, ramp.lam_t_s, one) for one in ramp.lam.T]
                    lam[on_the_way, chain, 1:] = np.stack(course, axis=1)
        return lam.reshape(samples, device.rows, device.cols)

    def _seen(self, number: int, frame: FramePlan, z: NDArray[np.float64], rate_hz: int) -> Measured:
        device = self.truth
        first, stop = round((frame.settled_s + frame.end_s) / 2 * rate_hz), round(frame.end_s * rate_hz)
        tau = np.arange(first, stop) / rate_hz * device.tau_per_s
        turning = np.exp(-1j * frame.states[0].omega * tau)
        basis = np.stack([np.ones(len(tau)), turning.real, -turning.imag])
        mean, real, imaginary = np.linalg.solve(basis @ basis.T, basis @ z[first:stop].reshape(len(tau), -1))
        harmonic = real - 1j * imaginary
        noise = self.rng.standard_normal(harmonic.shape) + 1j * self.rng.standard_normal(harmonic.shape)
        return Measured(number, mean, harmonic * (1 + self.noise * noise))
