"""Amplitudes on a grid with a lam on every link and a drive for every row: each row is a chain, links downwards rest.

Every pattern that a row could hold alone the grid holds, with the quick ways of chains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome

from ..amplitudes.vibration import Vibration
from ..closed_forms.grid import GridLinks
from ..drive import cubic, cubic_slope, links_at
from ..family import AmplitudeFamily, PatternFamily
from ..operating_point import Margins, OperatingPoint
from ..plan import Ramp
from .point import point_tones, ramp_of

__all__ = ["GridRows", "row_device"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def row_device(device: Device) -> Device:
    """One row of a grid as a device of its own."""
    coupling = device.coupling.model_copy(update={"lam_y": None, "drives": None})
    return device.model_copy(update={"rows": 1, "chain_length": device.cols, "coupling": coupling})


class GridRows(AmplitudeFamily):
    """Amplitudes by the rows' own drives and links."""

    def __init__(self, device: Device, contrast_db: float) -> None:
        super().__init__(device)
        self._row = Vibration(row_device(device), contrast_db)

    @classmethod
    def of(
        cls, device: Device, contrast_db: float, kinds: Sequence[Device] = (), whole: PatternFamily | None = None
    ) -> Self:
        """The family on a device."""
        return cls(device, contrast_db)

    @property
    def ramp_s(self) -> float:
        """Length of the longest ramps in seconds."""
        return self._row.ramp_s

    def note(self) -> str:
        """What is lacking."""
        return self._row.note()

    def levels(self, target: Floats, started: bool) -> Floats:
        """As each row alone holds its part."""
        rows = target.reshape(self.device.rows, -1)
        return np.concatenate([self._row.levels(row, started) for row in rows])

    def states(self, targets: Floats) -> list[OperatingPoint]:
        """The points of all rows, put together."""
        rows = targets.reshape(-1, self.device.cols)
        found = self._row.states(rows)
        per_grid = self.device.rows
        return [self._whole(found[at : at + per_grid]) for at in range(0, len(found), per_grid)]

    def _whole(self, rows: Sequence[OperatingPoint]) -> OperatingPoint:
        epsilon = np.array([row.epsilon for row in rows])
        failed = next((row for row in rows if row.outcome is not Outcome.OK), rows[0])
        return replace(
            rows[0],
            target=np.concatenate([row.target for row in rows]),
            lam=self._links(np.concatenate([row.lam for row in rows])),
            phasor=np.concatenate([row.phasor for row in rows]),
            mean=np.zeros(self.device.chain_length),
            bias=np.zeros(self.device.chain_length),
            tones=point_tones(self.device, rows[0].omega, self._driven(epsilon)),
            error=max(row.error for row in rows),
            margins=_worst([row.margins for row in rows]),
            outcome=failed.outcome,
            lacking=failed.lacking,
        )

    def _driven(self, of_rows: Complexes) -> Complexes:
        """What the rows are driven with, shape (rows, ...), for all driven actuators: those of the first row rest."""
        others = len(self.device.driven) - self.device.rows
        return np.concatenate([of_rows, np.zeros((others, *of_rows.shape[1:]), dtype=np.complex128)])

    def _links(self, right: Floats) -> Floats:
        """With those downwards, which rest; float64, shape (..., links)."""
        span, coupling = (*right.shape[:-1], self.device.links - right.shape[-1]), self.device.coupling
        return np.concatenate([right, np.full(span, 0.0 if coupling.lam_y is None else coupling.lam_y.min)], axis=-1)

    def ramps(
        self,
        before: Sequence[OperatingPoint],
        after: Sequence[OperatingPoint],
        moves: bool = True,
        length_s: float | None = None,
    ) -> list[Ramp | None]:
        """Every row on its own way, all from one moment on."""
        old, new = ([row for point in points for row in self._rows(point)] for points in (before, after))
        ways = self._row.ramps(old, new, moves, length_s)
        per_grid = self.device.rows
        each = [slice(at * per_grid, (at + 1) * per_grid) for at in range(len(after))]
        return [self._together(new[one], ways[one]) for one in each]

    def _rows(self, point: OperatingPoint) -> list[OperatingPoint]:
        """The points of the rows that a grid's is made of."""
        device, n = self.device, self.device.cols
        epsilon = {0: point.epsilon} | {tone.place: tone.epsilon for tone in point.tones}
        right = GridLinks.of(device, point.lam).right
        parts = (getattr(point, name).reshape(device.rows, n) for name in ("target", "phasor"))
        return [
            replace(
                point, target=target, phasor=phasor, lam=right[row, 1:], epsilon=epsilon.get(row * n, 0j), tones=(),
                bias=np.zeros(n), mean=np.zeros(n),
            )
            for row, (target, phasor) in enumerate(zip(*parts, strict=True))
        ]  # fmt: skip

    def _together(self, after: Sequence[OperatingPoint], ways: Sequence[Ramp | None]) -> Ramp | None:
        moving = [way for way in ways if way is not None]
        if not moving:
            return None
        t_s = _union([way.t_s for way in moving])
        curves = [_drive(t_s, point, way) for point, way in zip(after, ways, strict=True)]
        epsilon, slope = (self._driven(np.array(part)) for part in zip(*curves, strict=True))
        lam_t_s = _union([way.lam_t_s for way in moving if way.lam_t_s is not None] or [t_s[[0, -1]]])
        # At the end of the way the course still counts: afterwards the state's links do.
        right = np.concatenate(
            [links_at(point, way, lam_t_s, before=True) for point, way in zip(after, ways, strict=True)], axis=1
        )
        return replace(
            ramp_of(self.device, after[0].omega, t_s, epsilon, slope),
            lam_t_s=lam_t_s,
            lam=self._links(right),
            lacking=next((way.lacking for way in moving if way.lacking), ""),
            residue=self._residue(ways),
        )

    def _residue(self, ways: Sequence[Ramp | None]) -> Floats | None:
        """What the rows' ways leave, as one; None where one of them does not say it."""
        n = self.device.cols
        each = [np.zeros((2, 2 * n)) if way is None else way.residue for way in ways]
        known = [one.reshape(2, 2, n) for one in each if one is not None]
        return np.concatenate(known, axis=2).reshape(2, -1) if len(known) == len(each) else None


def _union(nodes: Sequence[Floats]) -> Floats:
    """All nodes, each once."""
    return np.array(sorted({one for each in nodes for one in each.tolist()}))


def _drive(t_s: Floats, point: OperatingPoint, way: Ramp | None) -> tuple[Complexes, Complexes]:
    """A row's envelope and its slope per second at nodes among which its own are: the same curve."""
    if way is None or way.epsilon is None or way.epsilon_slope is None:
        return np.full(len(t_s), point.epsilon), np.zeros(len(t_s), dtype=np.complex128)
    inside = t_s < way.duration_s
    values = np.where(inside, cubic(t_s, way.t_s, way.epsilon, way.epsilon_slope), point.epsilon)
    return values, cubic_slope(t_s, way.t_s, way.epsilon, way.epsilon_slope)


def _worst(margins: Sequence[Margins]) -> Margins:
    return Margins(*(max(getattr(one, name) for one in margins) for name in Margins.__dataclass_fields__))
