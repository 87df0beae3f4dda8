"""A device whose actuators nobody knows, and the pages it shows: harmonic balance of what it really is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Actuator, Device, Outcome, Setting, balance_near
from planner import Measured, OperatingPoint
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
    """What shows pages and is measured; `noise` of either part of a phasor, relative."""

    truth: Device
    noise: float
    rng: np.random.Generator

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
        """What a sensor says of a page, phases against the drive."""
        seen = self.motion(states) * np.exp(-1j * np.angle([[state.epsilon] for state in states]))
        noise = self.rng.standard_normal(seen.shape) + 1j * self.rng.standard_normal(seen.shape)
        seen = (seen * (1 + self.noise * noise)).ravel()
        return Measured(frame, np.zeros(len(seen)), seen)

    def errors(self, states: Sequence[OperatingPoint]) -> NDArray[np.float64]:
        """Largest deviation from the target of every chain, in units of full scale."""
        felt = np.abs(self.motion(states)) / self.truth.full_scale
        return np.abs(felt - np.array([state.target for state in states])).max(axis=1)
