"""What a device can make: a few patterns of every kind, really planned, and a map of the waves that stand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import ActuatorSpread, Device, Outcome
from encoders import (
    Frame,
    GridShape,
    Region,
    Scene,
    TargetPattern,
    bars,
    levels,
    plane_wave,
    regions,
    unlocked,
    walking_bars,
)

from ..errors import DwellTooShort
from ..plan import FramePlan
from ..planner import Planner
from ..scene_plan import DEFAULT_CONTRAST_DB, plan_scene
from ..targets import WaveTarget

__all__ = ["KINDS", "ReachKind", "ReachRow", "WaveMap", "reach_row", "wave_map"]

Floats = NDArray[np.float64]

# Long enough for every way in; nothing is sampled.
DWELL_S = 120.0
SEED = 6
LAGS_DEG, LEVELS = tuple(range(15, 180, 15)), (1.0, 0.5, 0.25, 0.1)


class ReachKind(NamedTuple):
    """A kind of patterns: its name, and a few of them on a grid."""

    name: str
    patterns: Callable[[GridShape], list[TargetPattern]]


def _dots(shape: GridShape) -> list[TargetPattern]:
    rng = np.random.default_rng(SEED)
    return [levels(rng.integers(0, 2, (shape.rows, shape.cols))) for _ in range(2)]


def _levels(shape: GridShape) -> list[TargetPattern]:
    rng = np.random.default_rng(SEED)
    return [levels(rng.integers(0, 5, (shape.rows, shape.cols)) / 4) for _ in range(2)]


def _bars(*, vertical: bool) -> Callable[[GridShape], list[TargetPattern]]:
    return lambda shape: [bars(shape, vertical=vertical, width=width, gap=1) for width in (1, 2)]


def _waves(*lags: tuple[float, float]) -> Callable[[GridShape], list[TargetPattern]]:
    return lambda shape: [plane_wave(shape, lag_deg=lag, row_lag_deg=down) for lag, down in lags]


def _walking(shape: GridShape) -> list[TargetPattern]:
    return [walking_bars(shape, width=width, level=0.3) for width in (1.5, 2.0)]


def _regions(shape: GridShape) -> list[TargetPattern]:
    half = shape.rows // 2
    upper = Region(0, half, 0, shape.cols, plane_wave(shape, lag_deg=90, level=0.5))
    lower = Region(half, shape.rows, 0, shape.cols, plane_wave(shape, lag_deg=60, level=0.3))
    return [regions(shape, [upper, lower])] if half else []


# A line for each kind; whoever adds a family adds one here.
KINDS = (
    ReachKind("dots", _dots),
    ReachKind("levels", _levels),
    ReachKind("lying bars", _bars(vertical=False)),
    ReachKind("upright bars", _bars(vertical=True)),
    ReachKind("walking bars", _walking),
    ReachKind("waves", _waves((90.0, 0.0), (60.0, 0.0))),
    ReachKind("waves from row to row", _waves((90.0, 45.0))),
    ReachKind("waves in regions", _regions),
    ReachKind("beats", lambda shape: [unlocked(shape, depth=0.3, period_s=1.6)]),
)


@dataclass(frozen=True)
class ReachRow:
    """What comes of the patterns of a kind; of those that are made the worst.

    Attributes
    ----------
    tried, made : how many patterns.
    way_in_s : seconds from rest.
    error : predicted, in units of full scale.
    volts, well : of their limits.
    noise_gain : as in `Margins`.
    modulated : whether they are felt as carriers swell.
    yield_ : share of devices with the spread on which they are felt; None where no spread was given or it is not known.
    lacking : the sentence of the first that is not made.
    """

    kind: str
    tried: int
    made: int
    way_in_s: float = 0.0
    error: float = 0.0
    volts: float = 0.0
    well: float = 0.0
    noise_gain: float = 1.0
    modulated: bool = False
    yield_: float | None = None
    lacking: str = ""


def reach_row(kind: ReachKind, device: Device, spread: float | None = None) -> ReachRow:
    """Plan the patterns of a kind on a device, each from rest.

    Parameters
    ----------
    spread : relative standard deviation of natural frequencies that plans are made for; None: as the device says.
    """
    if spread is not None and device.modulation is None:
        device = device.model_copy(update={"spread": ActuatorSpread(frequency=spread)})
    shape = GridShape(device.rows, device.cols)
    frames, lacking = list[FramePlan](), ""
    patterns = kind.patterns(shape)
    for pattern in patterns:
        try:
            frame = next(iter(plan_scene(Scene(shape, (Frame(pattern, DWELL_S),)), device).frames))
        except DwellTooShort as error:
            lacking = lacking or f"{error}"
            continue
        if frame.outcome is Outcome.OK:
            frames.append(frame)
        else:
            lacking = lacking or frame.note
    return _row(kind.name, len(patterns), frames, lacking)


def _row(name: str, tried: int, frames: list[FramePlan], lacking: str) -> ReachRow:
    margins = [state.margins for frame in frames for state in frame.states]
    shares = [frame.spread.yield_ for frame in frames if frame.spread is not None]
    return ReachRow(
        name, tried, len(frames),
        way_in_s=max((frame.settled_s - frame.start_s for frame in frames), default=0.0),
        error=max((frame.error for frame in frames), default=0.0),
        volts=max((one.volts for one in margins), default=0.0),
        well=max((one.well for one in margins), default=0.0),
        noise_gain=max((one.noise_gain for one in margins), default=1.0),
        modulated=any(state.modulated for frame in frames for state in frame.states),
        yield_=min(shares) if shares else None,
        lacking=lacking,
    )  # fmt: skip


@dataclass(frozen=True)
class WaveMap:
    """Which waves of one lag and one level can stand on a chain of the device, whatever their way in.

    Attributes
    ----------
    lags_deg, levels : its columns and its rows.
    stands : bool, shape (levels, lags).
    """

    lags_deg: tuple[int, ...]
    levels: tuple[float, ...]
    stands: NDArray[np.bool_]


def wave_map(device: Device) -> WaveMap | None:
    """The map of a device; None where actuators are alone, which take any phase."""
    n = device.chain_length
    if n == 1:
        return None
    planner = Planner(device.alone(0) if device.actuators else device, DEFAULT_CONTRAST_DB)
    stands = np.zeros((len(LEVELS), len(LAGS_DEG)), dtype=np.bool_)
    for row, level in enumerate(LEVELS):
        for col, lag in enumerate(LAGS_DEG):
            turned = -np.deg2rad(lag) * np.arange(n)
            phases = np.round(np.remainder(turned + np.pi, 2 * np.pi) - np.pi, 9)
            target = WaveTarget.of(np.full(n, level), phases + 0.0, np.ones(n))
            stands[row, col] = planner.points([target])[0].outcome is Outcome.OK
    return WaveMap(LAGS_DEG, LEVELS, stands)
