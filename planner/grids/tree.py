"""Amplitudes on a grid with a lam on every link and fewer drives than rows: links pass on what one drive gives.

A pattern rises and falls with its own links while the drive follows a smooth step, so slowly that no stage rings; how
slowly, the full equations say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome

from ..closed_forms.grid import GridLinks, drives_of, motion_of
from ..closed_forms.grid_tree import routed, tree_links
from ..family import PatternFamily, RisingFamily
from ..margins import lacking_of
from ..operating_point import OperatingPoint
from ..plan import Ramp
from ..targets import AmplitudeTarget, ChainTarget
from ..transitions import jets
from ..transitions.joining import as_tone
from .point import margins_of, noise_of, places_of, point_tones, ramp_of, rest_of
from .ways import quickest

__all__ = ["GridTree"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Frequencies tried, as parts of the way from resonance up to the highest: the further, the quicker.
PARTS = (1.0, 0.8, 0.6, 0.45, 0.3, 0.2)
# A disturbance of the drive that is magnified more than this many times is not kept quiet by a file's own rounding.
MOST_GAIN = 1e9
LENGTHS_S = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0)
NODES, SMOOTHNESS = 401, 9


class GridTree(RisingFamily):
    """Each actuator that moves listens to its left or its upper neighbour."""

    def __init__(self, device: Device, contrast_db: float) -> None:
        super().__init__(device)
        self._floor = 10.0 ** (-contrast_db / 20)

    @classmethod
    def of(
        cls, device: Device, contrast_db: float, kinds: Sequence[Device] = (), whole: PatternFamily | None = None
    ) -> Self:
        """The family on a device."""
        return cls(device, contrast_db)

    def held(self, target: ChainTarget, started: bool) -> ChainTarget:
        """Flat dots that pass something on idle at the floor, all others are silent."""
        level = routed(self.device, target.levels.reshape(self.device.rows, -1), self._floor)
        return AmplitudeTarget.of(level.ravel())

    def points(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        """One by one."""
        return [self._point(target.levels) for target in targets]

    def enter(self, point: OperatingPoint, moves: bool) -> Ramp:
        """The quickest smooth step that leaves nothing ringing."""
        return quickest(self.device, point, LENGTHS_S, lambda length_s: (self._step(point, length_s, rises=True), ""))

    def leave(self, point: OperatingPoint, moves: bool) -> Ramp:
        """As long as the way in, and as smooth."""
        ramp = self._step(point, self.enter(point, moves).duration_s, rises=False)
        ends = np.array([0.0, ramp.duration_s])
        return as_tone(replace(ramp, lam_t_s=ends, lam=np.repeat(point.lam[None, :], 2, axis=0)), point.omega)

    def _point(self, levels: Floats) -> OperatingPoint:
        device = self.device
        if not levels.any():
            return rest_of(device, levels)
        amplitude = (levels * device.full_scale).reshape(device.rows, device.cols)
        tried = [self._at(levels, amplitude, 1 + part * (device.omega.max - 1)) for part in PARTS]
        return next((one for one in tried if one.outcome is Outcome.OK), tried[-1])

    def _at(self, levels: Floats, amplitude: Floats, omega: float) -> OperatingPoint:
        device, floor = self.device, self._floor * self.device.full_scale
        links = tree_links(device, amplitude, floor * (1 + 1e-9), omega)
        known = bool(np.isfinite(links.flat).all())
        whole = links if known else GridLinks(np.nan_to_num(links.right), np.nan_to_num(links.down))
        phasor = motion_of(device, amplitude, whole, omega)
        asked = drives_of(device, phasor, whole, omega)
        epsilon = np.array([asked[at] for at in device.driven])
        margins = margins_of(device, epsilon, phasor, whole, omega)
        lacking = self._lacking(whole, known, margins.noise_gain) or lacking_of(margins)
        away = np.abs(np.abs(phasor) - amplitude).max() + noise_of(device, whole)
        return OperatingPoint(
            target=levels, epsilon=complex(epsilon[0]), lam=whole.flat, omega=omega, phasor=phasor.ravel(),
            bias=np.zeros(device.chain_length), mean=np.zeros(device.chain_length),
            tones=point_tones(device, omega, epsilon), error=float(away) / device.full_scale, margins=margins,
            outcome=Outcome.UNREACHABLE if lacking else Outcome.OK, lacking=lacking,
        )  # fmt: skip

    def _lacking(self, links: GridLinks, known: bool, gain: float) -> str:
        coupling = self.device.coupling
        if not known:
            return "no link can make a step of that contrast; it lacks detuning (a higher omega.max)"
        for lam, span, name in ((links.right, coupling.lam, "lam"), (links.down, coupling.lam_y, "lam_y")):
            if span is not None and not span.min <= lam.min() <= lam.max() <= span.max:
                return f"it takes a {name} of {lam.max():.3g}; it lacks range of {name}"
        if gain > MOST_GAIN:
            return f"so many stages in a row magnify a disturbance of the drive {gain:.2g} times; it lacks drives"
        return ""

    def _step(self, point: OperatingPoint, length_s: float, *, rises: bool) -> Ramp:
        """The drives along a smooth step."""
        blend = jets.smoothstep(SMOOTHNESS, NODES, 2)
        value, slope = (blend[0], blend[1]) if rises else (1 - blend[0], -blend[1])
        drives = {0: point.epsilon} | {tone.place: tone.epsilon for tone in point.tones}
        epsilon = np.array([drives.get(place, 0j) for place in places_of(self.device)])[:, None]
        t_s = np.linspace(0.0, length_s, NODES)
        return ramp_of(self.device, point.omega, t_s, epsilon * value, epsilon * slope / length_s)
