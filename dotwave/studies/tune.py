"""A device identified from the pages it shows, and corrected from page to page: what `dotwave tune` does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Actuator, Device, Outcome, load_device
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import DEFAULT_CONTRAST_DB, FramePlan, Plan, SensorNoise, plan_scene

from ..errors import AppError
from .device_file import check_device_path, rounded, write_device

if TYPE_CHECKING:
    from planner import DeviceEstimate, Measured

__all__ = ["Line", "TuneReport", "TunedPage", "tune"]

Floats = NDArray[np.float64]
Line = Callable[[Plan], Sequence["Measured"]]
"""Plays a plan on the device and gives what was measured of its frames."""

# Decay times of the profile's actuators for which a page stands: what is left of the way in, and of a plan that was
# wrong, is gone when the second half of it begins.
DECAYS = 10
# Of what a sensor says, relative: its gain is not known better.
GAIN_NOISE = 0.01
# A device is tuned when the last page is felt so well, in units of full scale: mean over chains of the worst actuator.
TUNED = 0.05
NAMES = {"stiffness": "f0_hz", "delta": "delta", "beta": "beta", "gain": "lam or epsilon_per_volt"}


@dataclass(frozen=True)
class TunedPage:
    """One page that was shown.

    Attributes
    ----------
    levels : what every chain showed, in units of full scale.
    error : mean over chains of the largest deviation of any actuator, as measured, in units of full scale.
    worst : the largest of any.
    measured : how many actuators were measured.
    """

    levels: tuple[float, ...]
    error: float
    worst: float
    measured: int


@dataclass(frozen=True)
class TuneReport:
    """What was found of a device, and where it was written ('' where it was not).

    Attributes
    ----------
    path, device : the file, and the profile it began with.
    pages : as they were shown, each planned with what was known after the one before; the last is the first again.
    expected : error expected of any page, before and after, in units of full scale.
    told : of each number, for how many actuators the pages told it.
    actuators : of how many in all.
    strange : places of actuators that are not of this device's kind.
    stopped : why it ended early, or ''.
    """

    path: str
    device: str
    pages: tuple[TunedPage, ...]
    expected: tuple[float, float]
    told: dict[str, int]
    actuators: int
    strange: tuple[tuple[int, int], ...]
    stopped: str

    @property
    def ok(self) -> bool:
        """Whether the last page was felt as wanted, and every actuator is of the profile's kind."""
        return not self.stopped and not self.strange and bool(self.pages) and self.pages[-1].error <= TUNED

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        return {
            "outcome": str(Outcome.OK if self.ok else Outcome.NO_CONVERGENCE), "path": self.path, "device": self.device,
            "pages": [vars(page) | {"levels": list(page.levels)} for page in self.pages],
            "expected": {"before": self.expected[0], "after": self.expected[1]}, "told": self.told,
            "actuators": self.actuators, "strange": [list(place) for place in self.strange], "stopped": self.stopped,
        }  # fmt: skip

    def as_text(self) -> str:
        """A line for each page, then what is known and what is not."""
        lines = [f"{self.device}: error of a page, of full scale, expected before: {self.expected[0]:.1%}"]
        lines += [
            f"  page {number}: {page.error:.1%} measured, worst actuator {page.worst:.1%}"
            for number, page in enumerate(self.pages, 1)
        ]
        lines.append(f"  expected of any page now: {self.expected[1]:.1%}")
        lines += [
            f"  {NAMES[name]}: told for {count} of {self.actuators} actuators"
            + ("" if count else "; these pages do not tell it, and it stays as it was known")
            for name, count in self.told.items()
        ]
        lines += [
            f"Row {row}, column {col}: no actuator of this profile moves so; look at it, its sensor and its cable."
            for row, col in self.strange
        ]
        if self.stopped:
            lines.append(self.stopped)
        elif not self.ok and not self.strange:
            lines.append(
                "The last page is not felt as wanted; see that the profile is of this device, then tune again."
            )
        return "\n".join([*lines, f"Written: {self.path}" if self.path else "Not written."])


def tune(
    name: str,
    line: Line,
    out: Path | None,
    *,
    goal: float,
    noise: float,
    phases: bool = True,
) -> TuneReport:
    """Show the pages that tell most of a device, correct it after each, and write its profile.

    Nothing is written when it is not `ok`.

    Parameters
    ----------
    name : of the profile it begins with, built in or a file; what a file says of single actuators counts.
    line : plays a plan and measures.
    out : the YAML file to write; None to look only.
    goal : error of a page that is expected in the end, in units of full scale.
    noise : standard deviation of what a sensor says of an amplitude, in units of full scale.
    phases : whether the sensors tell phases.

    Raises
    ------
    AppError
        When nothing is measured, or the device shows its pages by a bias.
    planner.PlanError
        When the device can show no page to be identified by.
    chainsim.ProfileError, drivers.DriverError
        When there is no such device; as `line` raises them.
    """
    from planner import DeviceEstimate, choose_pages, expected_error

    device = load_device(name)
    check_device_path(out)
    if device.bias == "actuator":
        raise AppError(
            f"{name}: its pages are held by a bias, and a profile has no place for loops and creep; "
            "leave out --output to look at them"
        )
    sensed = SensorNoise(GAIN_NOISE, noise * device.full_scale)
    choice = choose_pages(device, sensed, goal, contrast_db=DEFAULT_CONTRAST_DB)
    estimate, pages, stopped = DeviceEstimate.of(device), list[TunedPage](), ""
    before = float(choice.expected[0])
    for number, levels in enumerate([*choice.levels, *choice.levels[:1]]):
        plan = _page_plan(estimate.corrected() if number else device, levels)
        frame = next(iter(plan.frames))
        if frame.outcome is not Outcome.OK:
            stopped = f"Page {number + 1} cannot be shown any more: {frame.note}"
            break
        measured = _first(line(plan), name)
        estimate = estimate.after(frame.states, measured, sensed, phases=phases)
        pages.append(_judged(device, levels, frame, measured))
    report = _report(estimate, pages, (before, expected_error(estimate, contrast_db=DEFAULT_CONTRAST_DB)), stopped)
    if out is None or not report.ok:
        return report
    write_device(out, estimate.corrected(), [_entry(one) for one in estimate.corrected().actuators])
    return replace(report, path=str(out))


def _page_plan(device: Device, levels: Floats) -> Plan:
    """One page, the same for every chain, that stands until what was before has faded."""
    whole = np.tile(levels, (device.rows, device.chains_per_row)).astype(np.complex128)
    hold_s = DECAYS * 2 / (device.delta * device.tau_per_s)
    scene = Scene(GridShape(device.rows, device.cols), (Frame(TargetPattern(whole), hold_s),))
    return plan_scene(scene, device, contrast_db=DEFAULT_CONTRAST_DB)


def _first(measured: Sequence[Measured], name: str) -> Measured:
    """What was measured of the page itself."""
    found = next((one for one in measured if one.frame == 0 and np.isfinite(one.harmonic).any()), None)
    if found is None:
        raise AppError(
            f"{name}: nothing was measured; its controller must sense its actuators (drivers/PROTOCOL.md, MEASURED)"
        )
    return found


def _judged(device: Device, levels: Floats, frame: FramePlan, measured: Measured) -> TunedPage:
    n = device.chain_length
    felt = np.abs(measured.harmonic).reshape(-1, n) / device.full_scale
    off = np.abs(felt - [state.target for state in frame.states])
    worst = np.max(np.nan_to_num(off), axis=1)
    return TunedPage(tuple(levels.tolist()), float(worst.mean()), float(worst.max()), int(np.isfinite(felt).sum()))


def _report(
    estimate: DeviceEstimate, pages: Sequence[TunedPage], expected: tuple[float, float], stopped: str
) -> TuneReport:
    device, told = estimate.device, estimate.told.sum(axis=0).tolist()
    strange = tuple(divmod(int(at), device.cols) for at in np.flatnonzero(estimate.strange))
    return TuneReport(
        path="", device=device.name, pages=tuple(pages), expected=expected,
        told=dict(zip(NAMES, told, strict=True)), actuators=device.rows * device.cols, strange=strange, stopped=stopped,
    )  # fmt: skip


def _entry(actuator: Actuator) -> dict[str, Any]:
    """The actuator in a device profile."""
    plain = actuator.model_dump(exclude_none=True)
    return {name: rounded(value) if isinstance(value, float) else value for name, value in plain.items()} | {
        "plus_minus": {name: rounded(value) for name, value in plain["plus_minus"].items()}
    }
