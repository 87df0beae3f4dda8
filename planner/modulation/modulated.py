"""Amplitudes that are felt in how a carrier swells: held by links, or by what one lam lets through of several tones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from chainsim import Closure, Device, Modulation, Outcome, beats_of, felt_modulation

from ..amplitudes.vibration import Vibration
from ..closed_forms.links import detuning_gain
from ..family import PatternFamily, RisingFamily
from ..margins import lacking_of, noise_error, slew_of
from ..operating_point import Margins, OperatingPoint, PointTone
from ..plan import AMPLITUDE_ERROR_LIMIT, Ramp, ToneRamp
from ..targets import AmplitudeTarget, ChainTarget
from ..transitions import jets
from ..transitions.envelopes import SMOOTHEST
from ..transitions.joining import as_tone
from .beating import HIGHEST, Beating, beats_in, driven
from .tried import felt_of

__all__ = ["Modulated"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Times that amplitudes are mended by what their carriers make felt.
MENDED = 4
# Tones of the drive below this part of the largest are left out.
LEAST_TONE = 3e-6
# Lengths of a way that are tried, in e-folds of a single actuator, and its nodes.
WAYS, NODES = (16.0, 32.0, 64.0, 128.0), 81


class Modulated(RisingFamily):
    """Levels of modulation. Level L takes a carrier of sqrt(L) of full scale, which swells at `device.modulation`.

    Where every link has its own lam these hold the carriers' profile, far from resonance, so that all swell alike. Over
    one lam the tones of the drive are chosen such that they beat where something is to be felt, and only there.
    """

    def __init__(
        self, device: Device, contrast_db: float, kinds: Sequence[Device], whole: PatternFamily | None
    ) -> None:
        super().__init__(device)
        assert device.modulation is not None
        self._beat: Modulation = device.modulation
        self._contrast_db = contrast_db
        # Decibels of what is felt are half as many of the carriers.
        carriers = whole._carriers if isinstance(whole, Modulated) else None
        # How actuators differ is not counted on here.
        known = device.model_copy(update={"spread": None})
        self._carriers: Vibration = Vibration(known, contrast_db / 2, kinds, carriers)

    @classmethod
    def of(
        cls, device: Device, contrast_db: float, kinds: Sequence[Device] = (), whole: PatternFamily | None = None
    ) -> Self:
        """The family on a device, or on one of its chains."""
        return cls(device, contrast_db, kinds, whole)

    @cached_property
    def _step(self) -> float:
        return self._beat.hz / self.device.f0_hz

    @property
    def _linked(self) -> bool:
        return self.device.chain_length == 1 or self.device.coupling.scope == "link"

    def held(self, target: ChainTarget, started: bool) -> ChainTarget:
        """Over links flat actuators idle, so that something reaches those behind them."""
        if target.resting or not self._linked:
            return target
        levels = self._carriers.levels(np.sqrt(target.levels), started=True) ** 2
        return AmplitudeTarget.of(np.minimum(levels, 1.0))

    def points(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        """One by one."""
        return [self._point(target) for target in targets]

    def _point(self, target: ChainTarget) -> OperatingPoint:
        if target.resting:
            return self._rest(target.levels, "")
        if self.device.coupling.closure is Closure.RING:
            return self._rest(target.levels, "modulation goes along open chains; it lacks an open end")
        if self._linked:
            return self._over_links(target.levels)
        from .one_lam import beating_over

        found = beating_over(self.device, self._beat, target.levels, self._contrast_db)
        if found is None:
            none = "no tones were found that beat over one lam where this is raised, and nowhere else"
            return self._rest(target.levels, f"{none}; it lacks a lam per link")
        return self._judged(found.levels, found.lam, found.omega, found.last)

    def _rest(self, levels: Floats, lacking: str) -> OperatingPoint:
        n = self.device.chain_length
        return OperatingPoint(
            target=levels, epsilon=0j, lam=np.full(n - 1, self.device.coupling.lam.min), bias=np.zeros(n), omega=1.0,
            phasor=np.zeros(n, dtype=np.complex128), mean=np.zeros(n), lacking=lacking,
            outcome=Outcome.UNREACHABLE if lacking else Outcome.OK, error=float(levels.max()) if lacking else 0.0,
        )  # fmt: skip

    def _over_links(self, levels: Floats) -> OperatingPoint:
        """The links that hold the carriers, mended until the felt levels are right."""
        depth, carriers = self._beat.depth, np.sqrt(levels)
        tones = np.array([depth / 2, 1.0, depth / 2]) / (1 + depth)
        for _ in range(MENDED):
            held = self._carriers.states(carriers[None])[0]
            if held.outcome is not Outcome.OK:
                return self._rest(levels, held.lacking or self._carriers.band.lacking or "its links cannot hold it")
            last = tones * abs(held.phasor[-1])
            steady = self._steady(held.lam, held.omega, last)
            felt = self._felt(steady)
            carriers = carriers * np.sqrt(levels / np.maximum(felt, 1e-9))
        return self._judged(levels, held.lam, held.omega, last)

    def _steady(self, lam: Floats, omega: float, last: Complexes) -> Beating:
        return driven(self.device.chain, lam, omega, self._step, last, np.ones((1, 1)))

    def _felt(self, steady: Beating) -> Floats:
        beats = beats_in(steady.motion[:, :, 0], beats_of(self._beat))
        return felt_modulation(beats, self._beat, self.device.full_scale)

    def _judged(self, levels: Floats, lam: Floats, omega: float, last: Complexes) -> OperatingPoint:
        """The point, tried in the full equations from rest."""
        device, steady = self.device, self._steady(lam, omega, last)
        drive = steady.drive[:, 0]
        motion = np.fft.fft(steady.motion[:, :, 0], axis=1) / steady.motion.shape[1]
        tones = [
            PointTone(omega + k * self._step, complex(drive[k + HIGHEST]), motion[:, k], side=True)
            for k in range(-HIGHEST, HIGHEST + 1)
            if k and abs(drive[k + HIGHEST]) > LEAST_TONE * np.abs(drive).max()
        ]
        n, peak = device.chain_length, float(np.abs(steady.forces).max())
        size = np.sqrt((np.abs(steady.motion[:, :, 0]) ** 2).mean(axis=1))
        margins = Margins(
            volts=peak / device.epsilon_max,
            well=float(np.abs(steady.motion).max()) / device.escape_amplitude,
            noise_gain=float(detuning_gain(device.chain, size[None], lam[None], omega)[0]),
            slew=slew_of(device, peak, omega),
        )
        point = OperatingPoint(
            target=levels, epsilon=complex(drive[HIGHEST]), lam=lam, bias=np.zeros(n), omega=omega,
            phasor=motion[:, 0].copy(), mean=np.zeros(n), tones=tuple(tones), margins=margins, modulated=True,
        )  # fmt: skip
        return self._tried(point, lacking_of(margins))

    def _tried(self, point: OperatingPoint, lacking: str) -> OperatingPoint:
        if lacking:
            return replace(point, outcome=Outcome.UNREACHABLE, lacking=lacking, error=1.0)
        ramp = self.enter(point, moves=False)
        felt = felt_of(self.device, self._beat, point, ramp)
        noise = noise_error(self.device, point) / self.device.full_scale
        error = float(np.abs(felt - point.target).max()) + noise
        if ramp.lacking:
            lacking = ramp.lacking
        elif not error <= AMPLITUDE_ERROR_LIMIT:
            lacking = "its motion does not stay as it is meant; it lacks linearity (a smaller full_scale)"
        return replace(point, error=error, lacking=lacking, outcome=Outcome.UNREACHABLE if lacking else Outcome.OK)

    def enter(self, point: OperatingPoint, moves: bool) -> Ramp:
        """Up a smooth step of the last actuator's envelope; the shortest that volts and well allow."""
        return self._way(point, rises=True)

    def leave(self, point: OperatingPoint, moves: bool) -> Ramp:
        """Down such a step."""
        return as_tone(self._way(point, rises=False), point.omega)

    def _way(self, point: OperatingPoint, *, rises: bool) -> Ramp:
        device = self.device
        number = {round((tone.omega - point.omega) / self._step): tone for tone in point.every_tone}
        most = max(map(abs, number))
        last = np.array([number[k].phasor[-1] if k in number else 0j for k in range(-most, most + 1)])
        for folds in WAYS:
            length = folds * 2 / device.delta
            blend = jets.smoothstep(SMOOTHEST, NODES, 2 * device.chain_length + 2)
            blend = blend * (length ** -np.arange(len(blend), dtype=np.float64))[:, None]
            if not rises:
                blend = -blend
                blend[0] += 1.0
            made = driven(device.chain, point.lam, point.omega, self._step, last, blend)
            volts = float(np.abs(made.forces).max()) / device.epsilon_max
            well = float(np.abs(made.motion).max()) / device.escape_amplitude
            lacking = lacking_of(Margins(volts=volts, well=well))
            if not lacking:
                break
        t_s = np.linspace(0.0, length / device.tau_per_s, NODES)
        per_s = made.slope * device.tau_per_s
        ramps = {k: ToneRamp(tone.omega, made.drive[k + HIGHEST], per_s[k + HIGHEST]) for k, tone in number.items()}
        own = ramps.pop(0)
        words = f"the way in fails: {lacking}" if lacking else ""
        return Ramp(
            t_s=t_s, epsilon=own.epsilon, epsilon_slope=own.epsilon_slope, tones=tuple(ramps.values()), lacking=words
        )
