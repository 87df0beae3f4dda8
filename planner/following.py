"""What changes leave ringing in the chains of a device, followed from frame to frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from .closed_forms.ringing import carried, exponential, first_harmonic, ringing
from .drive import links_at
from .operating_point import OperatingPoint
from .plan import Ramp

__all__ = ["Following"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Stages magnify up to a billion times, and the rounding of the simulation that measures a residue is magnified with it:
# so much more than estimated may be felt.
SURE = 2.0
# What is kept of frames, and of changes: the latest; those of all changes of a long text would not fit.
MOST_KEPT = 4096
# Pieces of a ramp in which links count as constant, for what the change makes of what rang before it.
PIECES = 128


class _Ringing(NamedTuple):
    """What a deviation at the end of a ramp becomes: first harmonics felt while the pattern stands; its end."""

    felt: Complexes
    end: Floats


class Following:
    """Deviations of every chain from the motion planned for it, positions and velocities, dimensionless.

    What a ramp leaves (`Ramp.residue`), turned with the carrier, is added to what rings on from before. All of it rings
    on by the linear equations. A chain whose ramp leaves nothing known stands as planned after it.
    """

    def __init__(self, device: Device) -> None:
        places = [(row, index) for row in range(device.rows) for index in range(device.chains_per_row)]
        self._device = device
        self._chains = [device.chain_at(*place) for place in places]
        self._gains = [device.lam_gain(*place) for place in places]
        # Chains that are alike share what is kept.
        self._kinds = [b"%d" % (place if device.actuators else 0) for place in range(len(places))]
        self._kept: dict[bytes, _Ringing] = {}
        self._ways: dict[bytes, Floats] = {}
        self._states: Sequence[OperatingPoint | None] = [None] * len(places)
        self.rest()

    def rest(self) -> None:
        """All chains are at rest."""
        self._away = [np.zeros(2 * chain.n) for chain in self._chains]

    def through(
        self,
        states: Sequence[OperatingPoint],
        ramps: Sequence[Ramp | None],
        start: float,
        settled: float,
        standing: float,
    ) -> float:
        """Follow a frame.

        Parameters
        ----------
        start : of the frame, from that of the plan, in tau.
        settled : after how long its pattern stands.
        standing : for how long it does.

        Returns
        -------
        The largest deviation that may be felt while the pattern stands, in units of full scale.
        """
        worst = 0.0
        for place, (state, ramp) in enumerate(zip(states, ramps, strict=True)):
            away = self._away[place] if ramp is None else self._led(place, state, ramp, start)
            if away.any():
                passed = 0.0 if ramp is None else ramp.duration_s * self._device.tau_per_s
                ringing_on = self._ringing(place, state, settled - passed, standing)
                worst = max(worst, float(np.abs(ringing_on.felt @ away).max()))
                away = ringing_on.end @ away
            self._away[place] = away
        self._states = states
        return SURE * worst / self._device.full_scale

    def _led(self, place: int, state: OperatingPoint, ramp: Ramp, start: float) -> Floats:
        """The deviation at the end of a ramp that began at `start`."""
        away, before = self._away[place], self._states[place]
        if ramp.residue is None:
            return np.zeros_like(away)
        if before is not None and away.any():
            away = self._way(place, before, state, ramp) @ away
        phase = state.omega * start
        return np.asarray(away + math.cos(phase) * ramp.residue[0] + math.sin(phase) * ramp.residue[1])

    def _way(self, place: int, before: OperatingPoint, state: OperatingPoint, ramp: Ramp) -> Floats:
        """What a ramp makes of what rang before it."""
        key = self._kinds[place] + b"".join(
            one.tobytes() for one in (before.phasor, before.lam, state.phasor, state.lam)
        )
        if key not in self._ways:
            if len(self._ways) >= MOST_KEPT:
                self._ways.clear()
            x = np.linspace(0.0, 1.0, PIECES + 1)
            links = links_at(state, ramp, x * ramp.duration_s, before=True) * self._gains[place]
            begin, end = np.abs(before.phasor), np.abs(state.phasor)
            amplitude = begin + np.multiply.outer(x, end - begin)
            duration = ramp.duration_s * self._device.tau_per_s
            self._ways[key] = carried(self._chains[place], links, amplitude, duration)
        return self._ways[key]

    def _ringing(self, place: int, state: OperatingPoint, waiting: float, standing: float) -> _Ringing:
        times = np.array([waiting, standing])
        key = self._kinds[place] + state.phasor.tobytes() + state.lam.tobytes() + times.tobytes()
        if key not in self._kept:
            if len(self._kept) >= MOST_KEPT:
                self._kept.clear()
            matrix = ringing(self._chains[place], state.lam * self._gains[place], np.abs(state.phasor))
            settled, over = exponential(matrix * waiting), exponential(matrix * standing)
            felt = first_harmonic(matrix, state.omega, standing, over)
            self._kept[key] = _Ringing(felt @ settled, over @ settled)
        return self._kept[key]
