"""Plane waves on a grid coupled in two dimensions, with any lag to the right and downwards, in closed form."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome

from ..closed_forms.grid import GridLinks, GridWave, drives_of, motion_under, plane_wave
from ..family import RisingFamily
from ..margins import lacking_of
from ..operating_point import OperatingPoint
from ..plan import AMPLITUDE_ERROR_LIMIT, Ramp
from ..targets import AmplitudeTarget, ChainTarget, WalkingTarget, WaveTarget
from ..transitions.joining import as_tone
from .point import margins_of, noise_of, point_tones, rest_of
from .ways import enter_grid, leave_grid

__all__ = ["GridWaves"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# The share of the damping that the weaker of the two directions carries: the more of it one carries, the quicker ways
# along that one are.
WEAKER = 0.1
# Lags nearer to 0 or pi than this carry nothing.
LEAST_LAG = 1e-3
# Drives this small, as a part of the largest, are rounding.
EXACT = 1e-9
WALKS_NOT = "bars walk along chains that stand alone, and its rows are coupled; it lacks separate rows"
# Where any phases will do.
FREE_LAG = math.pi / 2


class GridWaves(RisingFamily):
    """Plane waves; of all else the nearest that one lam each way and the drives can hold, which is not the wish."""

    def held(self, target: ChainTarget, started: bool) -> ChainTarget:
        """Amplitudes are a wave of any phases, unless they are rest."""
        if not isinstance(target, AmplitudeTarget) or target.resting:
            return target
        n = len(target.amplitude)
        return WaveTarget(target.amplitude, phase=(None,) * n, weight=(1.0,) * n)

    def points(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        """One by one."""
        return [self._point(target) for target in targets]

    def enter(self, point: OperatingPoint, moves: bool) -> Ramp:
        """The quickest way that is found."""
        return enter_grid(self.device, point)

    def leave(self, point: OperatingPoint, moves: bool) -> Ramp:
        """The quickest way that is found."""
        return as_tone(leave_grid(self.device, point), point.omega)

    def _point(self, target: ChainTarget) -> OperatingPoint:
        device, wish = self.device, _Wish(self.device, target)
        if target.resting:
            return rest_of(device, target.levels)
        wave = _links_for(device, wish)
        links = GridLinks.alike(device, wave.lam_x, wave.lam_y)
        asked = drives_of(device, wish.plane if wish.plain else wish.phasor, links, wave.omega)
        drive = np.zeros_like(asked)
        for at in device.driven:
            drive[at] = asked[at]
        # Where the drives that are there are all that is asked, the wave stands, on whichever branch it is.
        whole = wish.plain and np.abs(asked - drive).max() <= EXACT * np.abs(asked).max()
        phasor = wish.plane if whole else motion_under(device, drive, links, wave.omega)
        epsilon = np.array([drive[at] for at in device.driven])
        margins = margins_of(device, epsilon, phasor, links, wave.omega)
        error = (wish.error(phasor) + noise_of(device, links)) / device.full_scale
        lacking = _lacking(device, wish, wave, error) or lacking_of(margins)
        if not lacking and margins.multiplier >= 1:
            lacking = "it is no stable motion; it lacks damping, or linearity (a smaller beta)"
        if isinstance(target, WalkingTarget):
            lacking = WALKS_NOT
        return OperatingPoint(
            target=target.levels, epsilon=complex(epsilon[0]), lam=links.flat, omega=wave.omega, phasor=phasor.ravel(),
            bias=np.zeros(device.chain_length), mean=np.zeros(device.chain_length),
            tones=point_tones(device, wave.omega, epsilon), error=error, margins=margins,
            phase=target.phases if isinstance(target, WaveTarget) and wish.phased.any() else None,
            outcome=Outcome.UNREACHABLE if lacking else Outcome.OK, lacking=lacking,
        )  # fmt: skip


class _Wish:
    """A target on a grid, and the plane wave that is nearest to it.

    Attributes
    ----------
    phasor : complex128, shape (rows, cols), as wished, phase 0 where any will do; dimensionless.
    phased, heeded : bool, the same shape: where the phase matters, and where anything does.
    lag_x, lag_y : radians, how far each actuator lags its left and its upper neighbour in the plane wave.
    plane : complex128, shape (rows, cols), that wave.
    """

    def __init__(self, device: Device, target: ChainTarget) -> None:
        shape, n = (device.rows, device.cols), device.chain_length
        phases, weights = (
            (target.phases, target.weights) if isinstance(target, WaveTarget) else (np.full(n, np.nan), np.ones(n))
        )
        size = (target.levels * device.full_scale).reshape(shape)
        self.phased, self.heeded = ~np.isnan(phases).reshape(shape), weights.reshape(shape) > 0
        self.phasor: Complexes = size * np.exp(1j * np.nan_to_num(phases).reshape(shape))
        known = np.where(self.phased, self.phasor, 0.0)
        self.lag_x, self.lag_y = (
            -float(np.angle(one)) if abs(one) else FREE_LAG
            for one in (np.vdot(known[:, :-1], known[:, 1:]), np.vdot(known[:-1], known[1:]))
        )
        self.level = float(size[self.heeded].max(initial=0.0))
        row, col = np.ogrid[: shape[0], : shape[1]]
        self.plane: Complexes = self.level * np.exp(-1j * (self.lag_x * col + self.lag_y * row))
        if self.phased.any():
            self.plane *= np.exp(1j * np.angle(np.vdot(self.plane, known)))

    @property
    def plain(self) -> bool:
        """Whether it is a plane wave."""
        return self.error(self.plane) < 1e-6 * self.level

    def error(self, phasor: Complexes) -> float:
        """Worst deviation of a motion from the wish where that is heeded, dimensionless."""
        away = np.where(self.phased, np.abs(phasor - self.phasor), np.abs(np.abs(phasor) - np.abs(self.phasor)))
        return float(away[self.heeded].max(initial=0.0))


def _carries(lag: float) -> bool:
    """Whether a wave with such a lag takes energy from a neighbour that it lags behind."""
    return LEAST_LAG < lag < math.pi - LEAST_LAG


def _links_for(device: Device, wish: _Wish) -> GridWave:
    """The links of the wave: strong along the direction in which ways are quicker, as long as they are to be had."""
    right, down = _carries(wish.lag_x), _carries(wish.lag_y) and device.coupling.drives == "border"
    shares = [0.0] if down else [1.0]
    if right and down:
        shares = [WEAKER, 1 - WEAKER, 0.0, 1.0]
        if math.sin(wish.lag_x) < math.sin(wish.lag_y):
            shares = [1 - share for share in shares]
    lag_x = wish.lag_x if right or down else FREE_LAG
    waves = [plane_wave(device, wish.level, lag_x, wish.lag_y, share) for share in shares]
    return next((wave for wave in waves if not _out_of_range(device, wave)), waves[0])


def _out_of_range(device: Device, wave: GridWave) -> str:
    """One clause on the lam that cannot be had, "" when both can."""
    for lam, span, name in (
        (wave.lam_x, device.coupling.lam, "lam"),
        (wave.lam_y, device.coupling.lam_y, "lam_y"),
    ):
        if span is not None and not span.min <= lam <= span.max:
            return f"it takes a {name} of {lam:.3g}, beside {span.min:.3g}..{span.max:.3g}; it lacks range of {name}"
    return ""


def _lacking(device: Device, wish: _Wish, wave: GridWave, error: float) -> str:
    """One clause on what the device lacks, "" when nothing."""
    coupling, right, down = device.coupling, _carries(wish.lag_x), _carries(wish.lag_y)
    if not wish.plain:
        return (
            "one lam to the right and one downwards let amplitudes go on from the driven edge in one way; "
            "it lacks a lam per link"
        )
    if not (right or down):
        return (
            "waves travel away from the drives, lagging by 0 to 180 degrees to the right or downwards; "
            "it lacks a drive for every actuator"
        )
    if coupling.drives == "corner" or (coupling.drives == "column" and not right):
        return "only its corner or first column is driven; it lacks drives on the first row and column"
    if beyond := _out_of_range(device, wave):
        return beyond
    if not device.omega.min <= wave.omega <= device.omega.max:
        return f"it takes an omega of {wave.omega:.4g}; it lacks range of omega"
    if error > AMPLITUDE_ERROR_LIMIT:
        return f"drive and links leave {100 * error:.2g} % error; it lacks linearity (a smaller beta)"
    return ""
