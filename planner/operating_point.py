"""What one chain is driven at, and what comes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Closure, Outcome, Setting

__all__ = ["Margins", "OperatingPoint", "PointTone", "setting_of"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True)
class Margins:
    """How far a state stays from what it must not reach, and what it is sensitive to.

    Attributes
    ----------
    volts : peak voltage over the amplifier's; 1 is at the limit.
    well : of a deflection the largest bias over the bias of the static fold, of a vibration the largest
        deflection over that of the hilltop; 1 is at the limit, 0 unless beta < 0.
    noise_gain : how many times more a disturbance on the drive, at the worst frequency and lasting for
        ever, is magnified than the drive itself is, at the worst actuator; 1 where nothing vibrates.
    slew : fastest change of the steady drive over the amplifier's; 1 is at the limit.
    multiplier : modulus of the largest Floquet multiplier of the motion; below 1 where it is stable, 0 where
        nothing vibrates or no multipliers are known.
    """

    volts: float
    well: float
    noise_gain: float = 1.0
    slew: float = 0.0
    multiplier: float = 0.0


@dataclass(frozen=True)
class PointTone:
    """One more tone of a drive: force = Re(epsilon e^{i omega tau}), tau from the start of the whole plan.

    Attributes
    ----------
    phasor : complex128, shape (n,), predicted amplitudes at omega, dimensionless.
    side : it is not itself wanted, but keeps those that are at their amplitudes.
    place : which actuator of the chain it drives, from 0; only those of a grid drive others than the first.
    """

    omega: float
    epsilon: complex
    phasor: Complexes
    side: bool = False
    place: int = 0


def _no_numbers() -> Floats:
    return np.empty(0)


def _no_motion() -> Complexes:
    return np.empty(0, dtype=np.complex128)


@dataclass(frozen=True)
class OperatingPoint:
    """What one chain of n actuators is driven at, the motion it has there, and how near that is to what was wanted.

    Drive and links are what the device is set to, in the units of its profile; what actuators and links that were
    measured make of them, the device says. On the way to a plan a point is first its drive and links alone, then has a
    motion, and is judged last: arrays of which nothing is known or wanted yet are empty.

    It holds no `chainsim.Setting`, but makes one (`setting_of`): a setting is a batch of drives of one tone, amplitude
    and phase apart, and links that count the one which closes a ring. A point has one phasor, which amplitude and phase
    would not give back to the last digit, may have several tones, and has the links that a device has.

    Attributes
    ----------
    epsilon : complex drive phasor (modulus = drive amplitude, argument = psi).
    lam : float64, shape (n-1,), links; of a grid `Device.links` of them.
    omega : drive frequency over f0 (1.0 where nothing vibrates).
    phasor : complex128, shape (n,), predicted first harmonic, dimensionless.
    mean : float64, shape (n,).
    bias : float64, shape (n,), DC force on each actuator.
    tones : further tones of the drive; `target` is then the largest amplitude that passes by, which the tones
        make in equal parts, side tones apart.
    beats : depth and period in seconds that are asked of a motion that never settles; `target` and `phasor` are then
        the loudest that passes by. None where it settles.
    target : float64, shape (n,), the amplitude that is to be felt, in units of full scale (floor included).
    phase : float64, shape (n,), wanted phases in radians, NaN where any will do; None where none matters. Phases
        are those of the motion at omega; one that is common to all chains at that omega makes no difference.
    error : predicted worst deviation from `target`, in units of full scale.
    lacking : one clause on what the device lacks for the target, empty when it can make it or the family says it.
    modulated : `target` is felt in how the motion swells (`chainsim.felt_modulation`); all tones are side tones.
    """

    epsilon: complex
    lam: Floats
    omega: float
    phasor: Complexes = field(default_factory=_no_motion)
    _: KW_ONLY
    mean: Floats = field(default_factory=_no_numbers)
    bias: Floats = field(default_factory=_no_numbers)
    tones: tuple[PointTone, ...] = ()
    beats: tuple[float, float] | None = None
    target: Floats = field(default_factory=_no_numbers)
    phase: Floats | None = None
    error: float = 0.0
    margins: Margins = Margins(0.0, 0.0)
    outcome: Outcome = Outcome.OK
    lacking: str = ""
    modulated: bool = False

    @property
    def moving(self) -> bool:
        """Whether the target is an amplitude of vibration, not a deflection."""
        return bool(self.epsilon) or bool(self.tones)

    @property
    def walks(self) -> bool:
        """Whether several tones of one actuator are wanted, which beat as bars that walk."""
        return any(not tone.place and not tone.side for tone in self.tones)

    @property
    def resting(self) -> bool:
        """Whether nothing vibrates: links are then free."""
        return not self.phasor.any()

    @property
    def every_tone(self) -> tuple[PointTone, ...]:
        """All tones of the drive, that at `omega` first."""
        return (PointTone(self.omega, self.epsilon, self.phasor), *self.tones)


def setting_of(chain: Chain, points: Sequence[OperatingPoint]) -> Setting:
    """The points as a batch for the simulator; of several tones, or driven actuators, the first.

    A ring is closed by a link like its first.

    Parameters
    ----------
    chain : as measured, if it was; then the points are what it makes of them.
    """
    lam = np.array([point.lam for point in points])
    if chain.closure is Closure.RING:
        lam = np.concatenate([lam[:, :1], lam], axis=1)
    down: Floats | float = 0.0
    if chain.rows > 1:
        along = chain.rows * (chain.cols - 1)
        down = lam[:, along:].reshape(-1, chain.rows - 1, chain.cols)
        lam = lam[:, :along].reshape(-1, chain.rows, chain.cols - 1)
    epsilon = np.array([point.epsilon for point in points])
    bias = np.array([point.bias for point in points])
    omega = np.array([point.omega for point in points])
    return Setting.of(
        chain, epsilon=np.abs(epsilon), phase=np.angle(epsilon), lam=lam if lam.size else 0.0, omega=omega,
        bias=bias if bias.size else 0.0, lam_y=down,
    )  # fmt: skip
