"""What the planner decided: for every frame, what each chain holds and how it gets there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome
from encoders import Frame

from .operating_point import OperatingPoint
from .wish import FrameWish

if TYPE_CHECKING:
    from .outlook import FrameSpread

__all__ = ["AMPLITUDE_ERROR_LIMIT", "FramePlan", "Plan", "Ramp", "ToneRamp"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

AMPLITUDE_ERROR_LIMIT = 0.02
"""Largest deviation of an amplitude that is right, in units of full scale."""


@dataclass(frozen=True)
class ToneRamp:
    """The envelope of one more tone at the nodes of a ramp.

    Attributes
    ----------
    omega : its frequency over f0.
    epsilon, epsilon_slope : complex128, shape (K,), as in `Ramp`.
    place : of the actuator that it drives, as in `PointTone`.
    """

    omega: float
    epsilon: Complexes
    epsilon_slope: Complexes | None = None
    place: int = 0


@dataclass(frozen=True)
class Ramp:
    """How one chain goes from one state to the next.

    Drive and bias are cubic Hermite curves between their nodes; links are linear between theirs.

    Attributes
    ----------
    t_s : float64, shape (K,), seconds from the start of the frame; first 0, last the ramp's length.
    epsilon : complex128, shape (K,), drive envelope: force = Re(epsilon e^{i omega tau}), tau from the
        start of the whole plan, omega that of the state it leads to; `epsilon_slope` per second. None when the
        drive stays zero.
    bias : float64, shape (K, n); `bias_slope` per second. None when no bias changes.
    lam_t_s : float64, shape (L,);
    lam : float64, shape (L, n-1), the links. None when they jump to the new state's values at the start of the frame.
    lacking : one clause on what the device lacks for this way, empty when it can go it.
    tones : envelopes at other frequencies, which add to the drive.
    residue : float64, shape (2, 2n): how far the chain's positions and velocities (in tau) are at the end of the ramp
        from the motion it leads to, when it began at phase 0 of the carrier and at pi/2; None where that is not known.
    left : largest deviation from the point it leads to that was found behind it, in units of full scale; 0 where none
        was looked for.
    """

    t_s: Floats
    epsilon: Complexes | None = None
    epsilon_slope: Complexes | None = None
    bias: Floats | None = None
    bias_slope: Floats | None = None
    lam_t_s: Floats | None = None
    lam: Floats | None = None
    lacking: str = ""
    tones: tuple[ToneRamp, ...] = ()
    residue: Floats | None = None
    left: float = 0.0

    @cached_property
    def duration_s(self) -> float:
        """Length of the ramp in seconds."""
        return float(self.t_s[-1])


@dataclass(frozen=True, repr=False)
class FramePlan:
    """One frame on the time line.

    `states` and `ramps` go row by row, chain by chain (`Device.chains` of them); a ramp of None
    means the chain already stands. `frame` is None for the way out after the last frame.
    `note` is one sentence when the outcome is not ok. `spread` is what the frame becomes under the device's spread,
    where it has one and the frame can be made. `contrast_db` is what was asked for, None where nothing was.
    `residue` is the largest deviation that changes leave while the pattern stands, in units of full scale.

    Examples
    --------
    >>> import numpy as np
    >>> from chainsim import load_device
    >>> from encoders import Frame, GridShape, Scene, TargetPattern
    >>> from planner import plan_scene
    >>> scene = Scene(GridShape(6, 6), (Frame(TargetPattern(np.eye(6, dtype=complex)), dwell_s=1.0),))
    >>> frame, way_out = plan_scene(scene, load_device("paper-6x6")).frames
    >>> frame
    FramePlan(0.000 to 1.000 s, settled at 0.060 s, ok)
    >>> frame.error < 1e-6, len(frame.states), frame.states[0].target
    (True, 6, array([1., 0., 0., 0., 0., 0.]))
    """

    frame: Frame | None
    start_s: float
    settled_s: float
    end_s: float
    states: tuple[OperatingPoint, ...]
    ramps: tuple[Ramp | None, ...]
    outcome: Outcome = Outcome.OK
    note: str = ""
    spread: FrameSpread | None = None
    contrast_db: float | None = None
    residue: float = 0.0

    def __repr__(self) -> str:
        times = f"{self.start_s:.3f} to {self.end_s:.3f} s, settled at {self.settled_s:.3f} s"
        return f"FramePlan({times}, {self.outcome})"

    @property
    def wish(self) -> FrameWish | None:
        """What the scene asks for, whatever the states aim at; None for the way out."""
        return None if self.frame is None else FrameWish.of(self.frame, self.contrast_db)

    @property
    def error(self) -> float:
        """Predicted worst deviation of any actuator from what is aimed at, in units of full scale."""
        return max([state.error for state in self.states]) + self.residue


@dataclass(frozen=True)
class Plan:
    """A device and its frames, made lazily: iterating `frames` again plans again (rows come from the cache).

    `encoding` is handed through from the scene.
    """

    device: Device
    frames: Iterable[FramePlan]
    encoding: Mapping[str, Any]
