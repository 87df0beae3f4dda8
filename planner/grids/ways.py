"""Ways of plane waves in and out: computed backwards from the far edge of the grid, which is flat like a chain.

In complex envelopes one stage reads ``G_rc = lam_x (A_r,c-1 - A_rc) + lam_y (A_r-1,c - A_rc)``,
``G = (kappa + i delta omega) A + (2 i omega + delta) A' + A''``. The last row and the first column follow one smooth
step times the wave. Then each actuator above them is known from the one below it and its left neighbour, row by row,
and the drives of the first row and column from what is left there (theory.md section 2.6). Where lam_x is the
stronger, rows and columns change places.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..closed_forms.grid import GridLinks
from ..drive import samples
from ..margins import WELL_SHARE
from ..operating_point import OperatingPoint
from ..plan import AMPLITUDE_ERROR_LIMIT, Ramp
from ..transitions import jets
from ..transitions.jets import Jet
from .point import ramp_of

__all__ = ["enter_grid", "leave_grid", "quickest"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Lengths tried in seconds, and the nodes and smoothness of a way.
LENGTHS_S = (1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0)
NODES, SMOOTHNESS = 401, 11
# How long a wave is watched behind its way in, and in how many parts.
WATCHED_S, PARTS = 0.3, 3


def enter_grid(device: Device, point: OperatingPoint) -> Ramp:
    """From rest to a plane wave, the quickest that keeps to the limits and stands in the full equations."""
    return quickest(device, point, LENGTHS_S, lambda length_s: _Way(device, point, length_s, rises=True).told)


def leave_grid(device: Device, point: OperatingPoint) -> Ramp:
    """From a plane wave to rest, on the same way backwards; its links stay as they are."""
    ramp = quickest(
        device, point, LENGTHS_S, lambda length_s: _Way(device, point, length_s, rises=False).told, rises=False
    )
    ends = np.array([0.0, ramp.duration_s])
    return replace(ramp, lam_t_s=ends, lam=np.repeat(point.lam[None, :], 2, axis=0))


def quickest(
    device: Device,
    point: OperatingPoint,
    lengths_s: Sequence[float],
    way: Callable[[float], tuple[Ramp, str]],
    *,
    rises: bool = True,
) -> Ramp:
    """The shortest way, of one or more, that keeps to the limits and, if it rises, leaves next to nothing ringing.

    Parameters
    ----------
    way : gives the ramp of a length in seconds, and a clause on what it takes too much of.
    """
    for length_s in lengths_s:
        ramp, lacking = way(length_s)
        if not lacking and rises:
            ramp = replace(ramp, left=_error_after(device, point, ramp))
            if ramp.left > AMPLITUDE_ERROR_LIMIT / 2:
                lacking = f"its way in leaves {100 * ramp.left:.2g} % of full scale ringing; it lacks time"
        if not lacking:
            return ramp
    return replace(ramp, lacking=lacking)


class _Way:
    """One way of a length in seconds: the drives at its nodes, and the largest amplitude on it."""

    def __init__(self, device: Device, point: OperatingPoint, length_s: float, *, rises: bool) -> None:
        duration = length_s * device.tau_per_s
        self._device, self._omega = device, point.omega
        links, shape = GridLinks.of(device, point.lam), (device.rows, device.cols)
        phasor, across, along = point.phasor.reshape(shape), links.right, links.down
        # The recursion divides by the links that run along it.
        self._turned = bool(links.right.max() > links.down.max())
        if self._turned:
            phasor, across, along = phasor.T, links.down.T, links.right.T
        envelopes = self._envelopes(phasor, across, along, _step(duration, 2 * len(phasor) + 4, rises))
        self._peak = max(float(np.abs(one[0]).max()) for row in envelopes for one in row)
        force = self._drives(envelopes, across, along)
        epsilon, slope = (np.array([force[place][k] for place in device.driven], dtype=np.complex128) for k in (0, 1))
        t_s = np.linspace(0.0, length_s, NODES)
        self.ramp = ramp_of(device, point.omega, t_s, epsilon, slope * device.tau_per_s)
        self._strongest = float(np.abs(epsilon).max())

    @property
    def told(self) -> tuple[Ramp, str]:
        """The ramp, and what it lacks."""
        return self.ramp, self._lacking()

    def _lacking(self) -> str:
        """One clause on what the way takes too much of, "" when nothing."""
        device = self._device
        if self._strongest > device.epsilon_max:
            return f"its way in takes {self._strongest / device.epsilon_per_volt:.3g} V; it lacks volts"
        if self._peak > device.escape_amplitude * WELL_SHARE:
            return "its way in comes too near the edge of the softening well; it lacks depth of the well"
        slew = self._strongest / device.epsilon_per_volt * self._omega * device.tau_per_s
        return "its way in takes more than the amplifier's slew; it lacks slew" if (
            slew > device.amplifier.slew_v_per_s
        ) else ""  # fmt: skip

    def _envelopes(self, phasor: Complexes, across: Floats, along: Floats, step: Jet) -> list[list[Jet]]:
        rows, cols = phasor.shape
        last: list[Jet] = [step * phasor[-1, col] for col in range(cols)]
        found = [last]
        for row in range(rows - 1, 0, -1):
            # Where nothing couples across, the first column follows from its own end too, and takes one drive.
            below, above = found[0], [step * phasor[row - 1, 0]] if across.any() else []
            for col in range(len(above), cols):
                force = self._force(below[col])
                here, left = below[col][: len(force)], below[col - 1][: len(force)]
                above.append(here + (force - across[row, col] * (left - here)) / along[row, col])
            found.insert(0, above)
        return found

    def _drives(self, envelopes: list[list[Jet]], across: Floats, along: Floats) -> dict[tuple[int, int], Jet]:
        """What is left for the drives of the first row and column, value and slope."""
        found = {}
        for row, line in enumerate(envelopes):
            for col, own in enumerate(line):
                if not (row and col):
                    force = self._force(own)[:2]
                    if col:
                        force = force - across[row, col] * (line[col - 1][:2] - own[:2])
                    if row:
                        force = force - along[row, col] * (envelopes[row - 1][col][:2] - own[:2])
                    found[(col, row) if self._turned else (row, col)] = force
        return found

    def _force(self, envelope: Jet) -> Jet:
        """G, two orders shorter than the envelope."""
        device, omega = self._device, self._omega
        first = jets.derivative(envelope)
        second = jets.derivative(first)
        length = len(second)
        stiffness = 0.75 * device.beta * jets.norm2(envelope)[:length] + 0j
        stiffness[0] += 1 - omega**2 + 1j * device.delta * omega
        return jets.multiply(stiffness, envelope[:length]) + (2j * omega + device.delta) * first[:length] + second


def _step(duration: float, length: int, rises: bool) -> Jet:
    """A jet of the smooth step up, or down, over `duration` in tau."""
    timed = jets.smoothstep(SMOOTHNESS, NODES, length) * (duration ** -np.arange(length, dtype=np.float64))[:, None]
    if not rises:
        timed = -timed
        timed[0] += 1.0
    return np.asarray(timed)


def _error_after(device: Device, point: OperatingPoint, ramp: Ramp) -> float:
    """Worst deviation from a point behind a way in, of full scale, in the full equations."""
    from chainsim import AsBuilt

    rate = device.amplifier.rate_hz
    count = int((ramp.duration_s + WATCHED_S) * rate)
    tau = np.asarray(np.arange(count) * (device.tau_per_s / rate), dtype=np.float64)
    force = np.zeros((count, device.rows, device.cols))
    for row, col in device.driven:
        force[:, row, col] = samples(device, point, ramp, tau, place=row * device.cols + col)
    links = GridLinks.of(device, point.lam)
    z = AsBuilt(device).integrator(rate).advance(force, links.right, links.down).reshape(count, -1)
    worst = 0.0
    for part in np.array_split(np.arange(int(ramp.duration_s * rate) + 1, count), PARTS):
        angle = point.omega * tau[part]
        found = np.linalg.lstsq(np.stack([np.cos(angle), -np.sin(angle)], axis=1), z[part])[0]
        worst = max(worst, float(np.abs(found[0] + 1j * found[1] - point.phasor).max()))
    return worst / device.full_scale
