"""Link strengths over time: the events a controller gets, and the lam they amount to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Device
from planner import FramePlan, OperatingPoint, Ramp, links_at

__all__ = ["CouplingEvent", "CouplingWriter", "LamTrack", "on_samples"]

Floats = NDArray[np.float64]

DIGITS = 12  # significant digits of lam in a file
TIME_DECIMALS = 12  # a picosecond: drops the noise of adding start and node times


@dataclass(frozen=True)
class CouplingEvent:
    """The links of one row start to move.

    Attributes
    ----------
    t_s : when, seconds.
    row : which.
    lam : cols - 1 numbers, ``lam[m - 1]`` couples actuator m-1 into m; 0 between chains.
    ramp_s : seconds that the linear change from the present value to `lam` takes; 0 is a jump.
    lam_y : cols numbers, from the row above into this one, of a grid coupled in two dimensions; 0 in its first row.
        Empty elsewhere.
    """

    t_s: float
    row: int
    lam: tuple[float, ...]
    ramp_s: float
    lam_y: tuple[float, ...] = ()

    @property
    def every_lam(self) -> tuple[float, ...]:
        """All of them, those downwards last."""
        return (*self.lam, *self.lam_y)

    def as_dict(self) -> dict[str, Any]:
        """The event in plain JSON types, as it stands in a manifest."""
        down = {"lam_y": self.lam_y} if self.lam_y else {}
        return {"t_s": self.t_s, "row": self.row, "lam": self.lam, "ramp_s": self.ramp_s, **down}


class CouplingWriter:
    """Turns frames, in order, into the events that change something.

    Parameters
    ----------
    sampled : for what changes links with samples only: a node between two of them is moved along the course to the
        nearer one, so that only its corner is a little beside. A chain magnifies what is left of that.
    """

    def __init__(self, device: Device, *, sampled: bool = False) -> None:
        self._device, self._sampled = device, sampled
        self._current: list[tuple[float, ...] | None] = [None] * device.rows

    def events(self, frame: FramePlan) -> list[CouplingEvent]:
        """The events of the next frame by time, then row; none when the device has no coupling."""
        if self._device.coupling.scope == "none":
            return []
        events: list[CouplingEvent] = []
        for row, path in enumerate(self._paths(frame)):
            events.extend(self._row_events(row, frame.start_s, path))
        return sorted(events, key=lambda event: (event.t_s, event.row))

    def _paths(self, frame: FramePlan) -> Iterator[_RowPath]:
        if self._device.grid:
            yield from _RowPath.of_grid(self._device, frame.states[0], frame.ramps[0], self._sampled)
            return
        per_row = self._device.chains_per_row
        for row in range(self._device.rows):
            chains = slice(row * per_row, (row + 1) * per_row)
            yield _RowPath.of(self._device, frame.states[chains], frame.ramps[chains], self._sampled)

    def _row_events(self, row: int, start_s: float, path: _RowPath) -> Iterator[CouplingEvent]:
        times = [round(start_s + t, TIME_DECIMALS) for t in path.t_s.tolist()]
        jumps = np.any(path.before != path.after, axis=1)
        yield from self._change(row, times[0], path.after[0], 0.0)
        for k in range(1, len(times)):
            ramp_s = round(times[k] - times[k - 1], TIME_DECIMALS)
            yield from self._change(row, times[k - 1], path.before[k], ramp_s)
            if jumps[k]:
                yield from self._change(row, times[k], path.after[k], 0.0)

    def _change(self, row: int, t_s: float, lam: Floats, ramp_s: float) -> Iterator[CouplingEvent]:
        rounded = tuple(float(f"{value:.{DIGITS}g}") for value in lam.tolist())
        if rounded != self._current[row]:
            self._current[row] = rounded
            along = self._device.cols - 1
            yield CouplingEvent(t_s, row, rounded[:along], ramp_s, rounded[along:])


@dataclass(frozen=True)
class _RowPath:
    """A row's links in one frame: linear between the times, with a jump at a time where before != after.

    t_s : float64, shape (K,), from the frame's start. before, after : float64, shape (K, cols-1), in a grid
    (K, 2 cols-1): the links downwards behind those to the right.
    """

    t_s: Floats
    before: Floats
    after: Floats

    @classmethod
    def of(
        cls, device: Device, states: Sequence[OperatingPoint], ramps: Sequence[Ramp | None], sampled: bool
    ) -> _RowPath:
        t_s, at_s = _times(device, ramps, sampled)
        links: Floats = np.zeros((3, len(t_s), device.cols - 1))
        n = device.chain_length
        for chain, (state, ramp) in enumerate(zip(states, ramps, strict=True)):
            links[:, :, chain * n : chain * n + n - 1] = _around(state, ramp, t_s, at_s)
        return cls._moved(at_s, *links)

    @classmethod
    def of_grid(cls, device: Device, state: OperatingPoint, ramp: Ramp | None, sampled: bool) -> Iterator[_RowPath]:
        """The paths of all rows of a grid coupled in two dimensions."""
        t_s, at_s = _times(device, [ramp], sampled)
        links, along = _around(state, ramp, t_s, at_s), device.rows * (device.cols - 1)
        right = links[..., :along].reshape(*links.shape[:2], device.rows, device.cols - 1)
        down = links[..., along:].reshape(*links.shape[:2], device.rows - 1, device.cols)
        rows = np.concatenate([right, np.pad(down, ((0, 0), (0, 0), (1, 0), (0, 0)))], axis=3)
        for row in range(device.rows):
            yield cls._moved(at_s, *rows[:, :, row])

    @classmethod
    def _moved(cls, at_s: Floats, before: Floats, after: Floats, along: Floats) -> _RowPath:
        """The path with its nodes at other times: along the course, except for jumps."""
        smooth = np.all(before == after, axis=1)
        before[smooth] = after[smooth] = along[smooth]
        return cls(at_s, before, after)


def _times(device: Device, ramps: Sequence[Ramp | None], sampled: bool) -> tuple[Floats, Floats]:
    """Where the links of ramps have nodes, and where these are put."""
    nodes = [ramp.lam_t_s for ramp in ramps if ramp is not None and ramp.lam_t_s is not None]
    # Not np.unique: it imports numpy.ma, which takes longer than planning a short text.
    t_s = np.array(sorted({0.0}.union(*(node.tolist() for node in nodes))))
    return t_s, np.rint(t_s * device.amplifier.rate_hz) / device.amplifier.rate_hz if sampled else t_s


def _around(state: OperatingPoint, ramp: Ramp | None, t_s: Floats, at_s: Floats) -> Floats:
    """Links before and after the nodes `t_s`, and at `at_s`: float64, shape (3, K, links)."""
    return np.stack([links_at(state, ramp, t_s, before=True), links_at(state, ramp, t_s), links_at(state, ramp, at_s)])


def on_samples(events: Iterable[CouplingEvent], rate_hz: int, rows: int, cols: int) -> Iterator[CouplingEvent]:
    """Events at samples, row by row, that keep to the same course: only its corners are a little beside.

    A ramp that ends between two samples ends at the nearer one, where the course is then; before a jump, at its height.
    """
    of_row: list[list[CouplingEvent]] = [[] for _ in range(rows)]
    for event in events:
        of_row[event.row].append(event)
    for row in of_row:
        if not row:
            continue
        end_s = np.array([event.t_s + event.ramp_s for event in row])
        near_s = np.rint(end_s * rate_hz) / rate_hz
        along = _RowTrack.of(row, cols - 1).at(near_s)
        after = [(event.t_s, event.ramp_s) for event in row[1:]] + [(np.inf, 0.0)]
        for k, (event, (next_s, ramp_s)) in enumerate(zip(row, after, strict=True)):
            goes_on = event.ramp_s > 0 and (ramp_s > 0 or next_s > near_s[k])
            at_s = round(event.t_s * rate_hz) / rate_hz
            lam = tuple(along[k].tolist()) if goes_on else event.lam
            yield CouplingEvent(at_s, event.row, lam, max(0.0, float(near_s[k]) - at_s))


class LamTrack:
    """lam of every link at any time, from the events of a manifest.

    Parameters
    ----------
    events : by time within each row.
    rows, cols : the grid.
    down : whether it is coupled in two dimensions.
    """

    def __init__(self, events: Iterable[CouplingEvent], rows: int, cols: int, *, down: bool = False) -> None:
        of_row: list[list[CouplingEvent]] = [[] for _ in range(rows)]
        for event in events:
            of_row[event.row].append(event)
        self._rows = [_RowTrack.of(row, 2 * cols - 1 if down else cols - 1) for row in of_row]
        self._cols = cols

    def at(self, times_s: Floats) -> Floats:
        """Links at the given times.

        Parameters
        ----------
        times_s : float64, shape (S,), seconds.

        Returns
        -------
        float64, shape (S, rows, cols); ``[:, r, m]`` couples actuator m-1 of row r into m, and column 0 is 0.
        """
        lam = np.zeros((len(times_s), len(self._rows), self._cols))
        for row, track in enumerate(self._rows):
            lam[:, row, 1:] = track.at(times_s)[:, : self._cols - 1]
        return lam

    def down_at(self, times_s: Floats) -> Floats:
        """Links downwards of a grid at the given times.

        Returns
        -------
        float64, shape (S, rows, cols); ``[:, r, c]`` couples actuator (r - 1, c) into (r, c), and row 0 is 0.
        """
        return np.stack([track.at(times_s)[:, self._cols - 1 :] for track in self._rows], axis=1)


@dataclass(frozen=True)
class _RowTrack:
    """Segments of one row: from `before` at start_s linearly to `after` at start_s + ramp_s, then constant."""

    start_s: Floats
    ramp_s: Floats
    before: Floats
    after: Floats

    @classmethod
    def of(cls, events: Sequence[CouplingEvent], links: int) -> _RowTrack:
        after = np.zeros((len(events) + 1, links))
        after[1:] = [event.every_lam for event in events] or np.zeros((0, links))
        before = np.zeros_like(after)
        # Until the first event every link is 0.
        start_s = np.array([-np.inf, *(event.t_s for event in events)])
        ramp_s = np.array([0.0, *(event.ramp_s for event in events)])
        for k in range(1, len(after)):
            done = min(1.0, (start_s[k] - start_s[k - 1]) / ramp_s[k - 1]) if ramp_s[k - 1] > 0 else 1.0
            before[k] = (1 - done) * before[k - 1] + done * after[k - 1]
        return cls(start_s, ramp_s, before, after)

    def at(self, times_s: Floats) -> Floats:
        k = np.searchsorted(self.start_s, times_s, side="right") - 1
        ramp_s = self.ramp_s[k]
        jump = ramp_s == 0
        done = np.where(jump, 1.0, np.minimum(1.0, (times_s - self.start_s[k]) / np.where(jump, 1.0, ramp_s)))
        mixed: Floats = (1 - done)[:, np.newaxis] * self.before[k] + done[:, np.newaxis] * self.after[k]
        return mixed
