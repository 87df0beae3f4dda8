"""What one chain holds for a wave, how far that is from every limit, and what the device lacks for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Closure, Device, Outcome

from ..closed_forms.links import detuning_gain
from ..closed_forms.nearest import nearest_geometric
from ..closed_forms.wave_fit import FittedPoint
from ..family import RisingFamily
from ..margins import lacking_of, noise_error, slew_of, well_of
from ..operating_point import Margins, OperatingPoint
from ..plan import Ramp
from ..targets import AmplitudeTarget, ChainTarget, WaveTarget
from ..transitions.waves import enter_wave, leave_wave
from .joint_fit import JointFit
from .wave_fit import GOOD, WaveFit

__all__ = ["Waves", "wave_state"]

Floats = NDArray[np.float64]

# Rounding lam by half a step turns each lag by about half the step over lam; errors up to so many times what that
# makes along the chain are laid to it.
ROUNDING = 2.0
# Amplitudes this far (of full scale) from every geometric row are out of reach by their shape, whatever else is.
UNEVEN = 0.1


class Waves(RisingFamily):
    """Waves of one tone, and amplitudes where the device has no better way: the nearest that one lam can make."""

    def held(self, target: ChainTarget, started: bool) -> ChainTarget:
        """Amplitudes are a wave of any phases, unless they are rest."""
        if not isinstance(target, AmplitudeTarget) or target.resting:
            return target
        n = len(target.amplitude)
        return WaveTarget(target.amplitude, phase=(None,) * n, weight=(1.0,) * n)

    def points(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        """One by one."""
        return [self._point(target) for target in targets]

    def _point(self, target: ChainTarget) -> OperatingPoint:
        return wave_state(self.device, target) if isinstance(target, WaveTarget) else _rest(self.device, target)

    def enter(self, point: OperatingPoint, moves: bool) -> Ramp:
        """The quickest way that is found."""
        return enter_wave(self.device, point, moves, GOOD)

    def leave(self, point: OperatingPoint, moves: bool) -> Ramp:
        """The quickest way that is found."""
        return leave_wave(self.device, point, moves)


def _rest(device: Device, target: ChainTarget) -> OperatingPoint:
    n = device.chain_length
    return OperatingPoint(
        target=target.levels, epsilon=0j, lam=np.full(n - 1, device.coupling.lam.min), bias=np.zeros(n), omega=1.0,
        phasor=np.zeros(n, dtype=np.complex128), mean=np.zeros(n),
    )  # fmt: skip


def wave_state(device: Device, target: WaveTarget) -> OperatingPoint:
    """The settings for a wave, or for amplitudes that one lam can make.

    Where the target cannot be made the nearest is given: the same wave with as much amplitude as stands, or the
    nearest motion of all.
    """
    task = (JointFit if _joint(device, target) else WaveFit)(device, target)
    found, share = task.best(1.0), 1.0
    near = np.isfinite(found.error) and found.error > GOOD * task.scale and found.outcome is Outcome.OK
    if not task.stands(found) and not near and not task.jagged:
        lower = task.lower()
        share, found = (1.0, found) if lower is None else lower
    return _Told(task, found, share).state()


def _joint(device: Device, target: WaveTarget) -> bool:
    """Whether closed forms of waves do not say it: links act both ways, or each of a ring is for amplitudes alone."""
    linked = device.chain.law.closed and device.coupling.scope == "link"
    return device.chain.law.both_ways or (linked and int(np.count_nonzero(~np.isnan(target.phases))) <= 1)


@dataclass(frozen=True)
class _Told:
    """What was found for `share` of a target, to be told."""

    task: WaveFit
    found: FittedPoint
    share: float

    def state(self) -> OperatingPoint:
        """The state."""
        task, device, point = self.task, self.task.device, self.found.point
        n, known = device.chain_length, bool(np.isfinite(self.found.error))
        phasor = self.found.phasor if known else np.zeros(n, dtype=np.complex128)
        noise = noise_error(device, point) if known else 0.0
        error = task.wanted(1.0).error(phasor) + noise
        margins = self._margins() if known else Margins(0.0, 0.0)
        lacking = self._lacking(error, noise) or lacking_of(margins)
        return OperatingPoint(
            target=task.target.levels,
            epsilon=point.epsilon,
            lam=point.lam,
            bias=np.zeros(n),
            omega=point.omega,
            phasor=phasor,
            mean=np.zeros(n),
            error=error / device.full_scale,
            margins=margins,
            outcome=Outcome.UNREACHABLE if lacking else Outcome.OK,
            phase=task.target.phases if np.any(task.phased) else None,
            lacking=lacking,
        )

    def _margins(self) -> Margins:
        device, point, found = self.task.device, self.found.point, self.found
        gain = detuning_gain(device.chain, np.abs(found.phasor)[None, :], point.lam[None, :], point.omega)
        return Margins(
            volts=abs(point.epsilon) / device.epsilon_max,
            well=well_of(device, found.response),
            noise_gain=float(gain[0]),
            slew=slew_of(device, abs(point.epsilon), point.omega),
            multiplier=float(np.nan_to_num(np.abs(found.response.multipliers)).max()),
        )

    def _lacking(self, error: float, noise: float) -> str:
        """One clause on what keeps the device from the target, "" when nothing."""
        task, found, scale = self.task, self.found, self.task.scale
        if task.stands(found) and self.share == 1.0:
            small = error <= 2 * GOOD * scale
            return (
                ""
                if small
                else f"its amplifier's steps and noise leave {100 * noise / scale:.1g} % error; it lacks bits"
            )
        if self._uneven():
            return self._no_freedom()
        if self.share < 1.0:
            part = f"{100 * self.share:.0f} % of this amplitude"
            return f"no more than {part} was found to stand on one branch; it lacks linearity (a smaller beta)"
        if task.backwards:
            return "waves travel away from a drive, lagging by 0 to 180 degrees; it lacks a drive for every actuator"
        if found.outcome is not Outcome.OK:
            return "nothing near it is stable; it lacks damping, or linearity (a smaller beta)"
        # Where actuators act on each other the nearest may lie anywhere, and more range would bring it no nearer.
        return ("" if isinstance(task, JointFit) else self._out_of_range()) or self._no_freedom()

    def _uneven(self) -> bool:
        """Whether neighbours are to differ as one lam and one drive never let them."""
        device, levels = self.task.device, self.task.target.levels
        if device.coupling.scope == "link":
            return False
        near = nearest_geometric(device, levels, 1.0)
        return bool(np.abs(near.first * near.ratio ** np.arange(len(levels)) - levels).max() > UNEVEN)

    def _out_of_range(self) -> str:
        point, lam, omega = self.found.point, self.task.device.coupling.lam, self.task.device.omega
        # Zero is a link that passes nothing on, which may be wanted; nothing lies below it.
        low = lam.min > 0 and bool(np.any(point.lam <= lam.min))
        if self.task.freedom.lam and (low or np.any(point.lam >= lam.max)):
            return f"it takes a lam {'below' if low else 'above'} {lam.min:.3g}..{lam.max:.3g}; it lacks range of lam"
        if not omega.min < point.omega < omega.max:
            return f"it takes a frequency outside {omega.min:g}..{omega.max:g}; it lacks range of omega"
        return ""

    def _no_freedom(self) -> str:
        device = self.task.device
        rounding = device.chain_length * device.coupling.lam_step / max(float(self.found.point.lam.max()), 1e-9) / 2
        if self.found.error < ROUNDING * rounding * self.task.scale:
            return f"lam can only be set in steps of {device.coupling.lam_step:.2g}; it lacks bits of lam"
        shape = "ring" if device.coupling.closure is Closure.RING else "chain"
        if device.coupling.scope == "link":
            return f"no links of this {shape} hold it at one frequency; it lacks a drive for every actuator"
        return (
            f"one lam and one drive per {shape} fix the ratio between neighbours; "
            "it lacks a bias per actuator or a lam per link of an open chain"
        )
