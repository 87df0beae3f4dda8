"""What came out of a solve: harmonics, stability, an error estimate and the work done."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum, StrEnum

import numpy as np
from numpy.typing import NDArray

__all__ = ["Branch", "Outcome", "Response", "Stats"]


class Outcome(StrEnum):
    """How a solve or a plan ended. `sentence` says it to a person.

    Examples
    --------
    >>> from chainsim import Outcome
    >>> Outcome("unreachable").sentence
    'This device cannot make this pattern; the nearest it can make is given.'
    """

    OK = "ok"
    ESCAPED = "escaped"
    NOT_LOCKED = "not_locked"
    UNSTABLE = "unstable"
    UNREACHABLE = "unreachable"
    NO_CONVERGENCE = "no_convergence"
    OUT_OF_BUDGET = "out_of_budget"

    @property
    def sentence(self) -> str:
        """One helpful sentence."""
        return _SENTENCES[self]


_SENTENCES = {
    Outcome.OK: "Solved.",
    Outcome.ESCAPED: "The motion leaves the softening well and grows without bound: lower epsilon, or start by a ramp.",
    Outcome.NOT_LOCKED: "The motion does not repeat with the drive: change lam or omega, or lower the gain per stage.",
    Outcome.UNSTABLE: "A periodic answer exists but is not stable, so it will not be felt: choose another branch.",
    Outcome.UNREACHABLE: "This device cannot make this pattern; the nearest it can make is given.",
    Outcome.NO_CONVERGENCE: "The solver did not converge: use a dearer rung, or a setting farther from a fold.",
    Outcome.OUT_OF_BUDGET: "The work budget ran out before an answer was sure: raise the budget or the tolerance.",
}


class Branch(IntEnum):
    """Which of the answers of a multistable oscillator: counted from the smallest amplitude."""

    LOW = 0
    MIDDLE = 1
    HIGH = 2


@dataclass(frozen=True)
class Stats:
    """Work done; adds up with ``+``."""

    rhs_evals: int = 0
    newton_steps: int = 0
    oscillators_solved: int = 0
    periods: int = 0
    seconds: float = 0.0

    def __add__(self, other: Stats) -> Stats:
        return Stats(
            self.rhs_evals + other.rhs_evals,
            self.newton_steps + other.newton_steps,
            self.oscillators_solved + other.oscillators_solved,
            self.periods + other.periods,
            self.seconds + other.seconds,
        )


@dataclass(frozen=True, repr=False)
class Response:
    """Periodic steady states of N settings of a chain of n.

    ``z_m(tau) = mean_m + Re(sum_k harmonics[k-1, m] e^{i k omega tau})``, k = 1..K.

    Attributes
    ----------
    rung : which solver answered.
    outcome : object array of `Outcome`, shape (N,).
    harmonics : complex128, shape (N, K, n), dimensionless; NaN where the outcome is not ok and no
        periodic answer is known.
    mean : float64, shape (N, n).
    stable : bool, shape (N,).
    locked : bool, shape (N,), the motion repeats with the drive.
    multipliers : complex128, shape (N, n, 2), the two Floquet multipliers of each 2 x 2 block (open
        chain), or all 2n in the same shape (ring); NaN when unknown.
    branch : int8, shape (N, n), `Branch` of each oscillator.
    error_estimate : float64, shape (N,), relative to each setting's largest amplitude.
    stats : the work of the whole batch.
    """

    rung: str
    outcome: NDArray[np.object_]
    harmonics: NDArray[np.complex128]
    mean: NDArray[np.float64]
    stable: NDArray[np.bool_]
    locked: NDArray[np.bool_]
    multipliers: NDArray[np.complex128]
    branch: NDArray[np.int8]
    error_estimate: NDArray[np.float64]
    stats: Stats = field(default_factory=Stats)

    def __repr__(self) -> str:
        ok = int(sum(outcome is Outcome.OK for outcome in self.outcome))
        return f"Response({len(self)} settings of {self.mean.shape[1]} oscillators by {self.rung}, {ok} ok)"

    @property
    def phasor(self) -> NDArray[np.complex128]:
        """First harmonic, complex128, shape (N, n): z = Re(phasor e^{i omega tau})."""
        first: NDArray[np.complex128] = self.harmonics[:, 0, :]
        return first

    @property
    def third(self) -> NDArray[np.complex128]:
        """Third harmonic, complex128, shape (N, n); zero where the rung does not model it."""
        if self.harmonics.shape[1] < 3:
            return np.where(np.isnan(self.phasor), self.phasor, 0.0)
        third: NDArray[np.complex128] = self.harmonics[:, 2, :]
        return third

    @property
    def phase_step(self) -> NDArray[np.float64]:
        """Phase of m minus phase of m-1, radians in (-pi, pi], shape (N, n-1); negative = lag."""
        step: NDArray[np.float64] = np.angle(self.phasor[:, 1:] * np.conj(self.phasor[:, :-1]))
        return step

    def __len__(self) -> int:
        return len(self.outcome)
