"""A biased device identified from pages held still: deflection per volt, hysteresis and creep, and what undoes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import Plan, SensorNoise, plan_scene

from ..errors import AppError
from .tune import Line

if TYPE_CHECKING:
    from planner import BiasEstimate, Measured

__all__ = ["BiasTuneReport", "tune_bias"]

Floats = NDArray[np.float64]

# Pages of the levels 0, 1/2 and 1, the same each time, and how long each stands.
PAGES, LEVELS, SEED = 16, 3, 1
DWELL_S = 2.0
# Root mean square error that a corrected page may have besides the sensor's noise, in units of full scale.
TUNED = 0.02


@dataclass(frozen=True)
class BiasTuneReport:
    """What was found of a biased device.

    Attributes
    ----------
    device : its profile.
    blind, corrected : root mean square error of every page as measured, in units of full scale, as the profile has it,
        and shown again with what was learned.
    gain, loop, creep : median over actuators, as in `BiasEstimate`; gain_spread its standard deviation.
    noise : of the sensors, in units of full scale.
    """

    device: str
    blind: tuple[float, ...]
    corrected: tuple[float, ...]
    gain: float
    gain_spread: float
    loop: float
    creep: float
    noise: float

    @property
    def ok(self) -> bool:
        """Whether corrected pages are held as wanted."""
        return float(np.mean(self.corrected)) <= float(np.hypot(TUNED, self.noise))

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        return {"outcome": str(Outcome.OK if self.ok else Outcome.NO_CONVERGENCE)} | vars(self)

    def as_text(self) -> str:
        """A few lines."""
        lines = [
            f"{self.device}: {len(self.blind)} pages held by a bias, errors of full scale (root mean square)",
            f"  as the profile has it: {np.mean(self.blind):.1%}",
            f"  shown again with what was learned: {np.mean(self.corrected):.1%}",
            f"  a volt makes {self.gain:.3f} of the profile's, from actuator to actuator +- {self.gain_spread:.1%}",
            f"  loop at half of full scale: {self.loop:.1%}, creep: {self.creep:.1%} a decade",
        ]
        if not self.ok:
            lines.append("The pages are not held as wanted; see that the profile is of this device, then tune again.")
        return "\n".join(lines)


def tune_bias(device: Device, line: Line, *, noise: float) -> BiasTuneReport:
    """Hold pages twice: as the profile has them, then with voltages that undo what was learned.

    Parameters
    ----------
    line : plays a plan and measures.
    noise : standard deviation of what a sensor says of a deflection, in units of full scale.

    Raises
    ------
    AppError
        When nothing is measured.
    drivers.DriverError
        As `line` raises it.
    """
    from planner import BiasEstimate

    plan, sensed = _pages(device), SensorNoise(0.0, max(noise, 1e-6) * device.full_scale)
    estimate = BiasEstimate.of(device)
    errors: list[tuple[float, ...]] = []
    for number in range(2):
        shown = estimate.corrected(plan) if number else plan
        estimate, error = _learned(estimate, shown, line(shown), sensed)
        errors.append(error)
    return BiasTuneReport(
        device=device.name, blind=errors[0], corrected=errors[1], gain=float(np.median(estimate.gain)),
        gain_spread=float(np.std(estimate.gain)), loop=float(np.median(estimate.loop)),
        creep=float(np.median(estimate.creep)), noise=noise,
    )  # fmt: skip


def _pages(device: Device) -> Plan:
    rng = np.random.default_rng(SEED)
    shape = GridShape(device.rows, device.cols)
    wanted = rng.integers(0, LEVELS, (PAGES, device.rows, device.cols)) / (LEVELS - 1)
    frames = tuple(Frame(TargetPattern(one.astype(np.complex128)), DWELL_S) for one in wanted)
    return plan_scene(Scene(shape, frames), device)


def _learned(
    estimate: BiasEstimate, plan: Plan, measured: Sequence[Measured], noise: SensorNoise
) -> tuple[BiasEstimate, tuple[float, ...]]:
    """The estimate after a plan was played, and the error of every page that was measured."""
    seen = {one.frame: one for one in measured}
    errors = list[float]()
    for number, frame in enumerate(plan.frames):
        found = seen.get(number) if frame.frame is not None else None
        if found is not None:
            target = np.concatenate([state.target for state in frame.states])
            off = found.mean / estimate.device.full_scale - target
            errors.append(float(np.sqrt(np.nanmean(off**2))))
        estimate = estimate.after(frame, found, noise)
    if not errors:
        raise AppError(
            f"{estimate.device.name}: nothing was measured; its controller must sense its actuators "
            "(drivers/PROTOCOL.md, MEASURED)"
        )
    return estimate, tuple(errors)
