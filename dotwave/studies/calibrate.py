"""Measured frequency sweeps to a device file that knows its actuators: what `dotwave calibrate` does."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chainsim import Closure, Device, Outcome, load_device

from ..errors import AppError
from .device_file import check_device_path, rounded, write_device
from .measured_sweeps import ChainPlace, read_sweeps

if TYPE_CHECKING:
    from planner import ChainFit

__all__ = ["CalibrateReport", "FittedActuator", "calibrate"]

CONFIDENCE = 0.95
# A number whose interval reaches farther than this share of it is worth less than the profile's.
WORTHWHILE = 0.25
NUMBERS = ("f0_hz", "delta", "beta", "lam", "epsilon_per_volt")


@dataclass(frozen=True)
class FittedActuator:
    """One actuator as fitted.

    Attributes
    ----------
    row, col : its place.
    values, plus_minus : numbers and half widths of their 95 % confidence intervals, by the names of the profile;
        lam and epsilon_per_volt exclude each other.
    left_out : names of numbers that the sweep hardly determines (to worse than a quarter): the profile's stay.
    noise : standard deviation of the measured phasor's real and imaginary part, dimensionless.
    points, outliers : measured, and left out because they lie far off.
    """

    row: int
    col: int
    values: dict[str, float]
    plus_minus: dict[str, float]
    left_out: tuple[str, ...]
    noise: float
    points: int
    outliers: int

    def entry(self, lam_set: float | None) -> dict[str, Any]:
        """The actuator in a device profile, numbers that are not determined left out."""
        kept = [name for name in self.values if name not in self.left_out]
        found: dict[str, Any] = {"row": self.row, "col": self.col}
        found |= {name: rounded(self.values[name]) for name in kept}
        if "lam" in kept and lam_set is not None:
            found["lam_set"] = lam_set
        return found | {"plus_minus": {name: rounded(self.plus_minus[name]) for name in kept}}


@dataclass(frozen=True)
class CalibrateReport:
    """What was fitted, and where it was written ('' where it was not)."""

    path: str
    device: str
    actuators: tuple[FittedActuator, ...]
    failed: tuple[ChainPlace, ...]

    @property
    def ok(self) -> bool:
        """Whether every chain could be fitted."""
        return not self.failed

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        fits = [vars(one) | {"left_out": list(one.left_out)} for one in self.actuators]
        failed = [{"row": place.row, "chain": place.chain} for place in self.failed]
        outcome = Outcome.OK if self.ok else Outcome.NO_CONVERGENCE
        return {"outcome": str(outcome), "path": self.path, "device": self.device, "actuators": fits, "failed": failed}

    def as_text(self) -> str:
        """A line for each actuator, with 95 % confidence."""
        lines = [f"{'row':>3} {'col':>3}  " + "  ".join(f"{name:<24}" for name in NUMBERS).rstrip()]
        lines += [_line(one) for one in self.actuators]
        for one in self.actuators:
            if one.left_out:
                names = ", ".join(one.left_out)
                lines.append(
                    f"Row {one.row}, column {one.col}: the sweep hardly determines {names}; the profile's value stays. "
                    "Drive harder, or take more points at its resonance."
                )
        for place in self.failed:
            lines.append(
                f"Row {place.row}, chain {place.chain}: no chain of this kind fits the points (or too many lie far "
                "off); check drive_v, the sign of phase_rad (negative = lag) and the unit of amplitude."
            )
        return "\n".join([*lines, f"Written: {self.path}" if self.path else "Not written."])


def _line(one: FittedActuator) -> str:
    cells = [f"{one.values[name]:.6g} +- {one.plus_minus[name]:.2g}" if name in one.values else "-" for name in NUMBERS]
    return f"{one.row:>3} {one.col:>3}  " + "  ".join(f"{cell:<24}" for cell in cells).rstrip()


def calibrate(source: str, *, device: str, out: Path | None, lam_set: float | None) -> CalibrateReport:
    """Fit the actuators of `device` to the sweeps in a CSV file (``-``: standard input), and write its profile.

    The profile written is the given one with a section ``actuators``; entries it had for other actuators stay. Nothing
    is written when a chain cannot be fitted.

    Parameters
    ----------
    out : the YAML file to write; None to fit only.
    lam_set : what the links were set to during the sweep; None where they cannot be set.

    Raises
    ------
    AppError
        When the table does not fit (with line and column), or the device's chains are rings.
    drivers.FileError
        When `out` cannot be written.
    chainsim.ProfileError
        When there is no such device.
    planner.PlanError
        When the points cannot determine the numbers.
    """
    from planner import SweepError, fit_chain

    profile = load_device(device)
    if profile.coupling.closure is not Closure.OPEN:
        raise AppError(f"{device}: its chains are {profile.coupling.closure}; only open chains are fitted")
    check_device_path(out)
    if lam_set is not None and not 0 < lam_set < math.inf:
        raise AppError(f"lam {lam_set:g}: expected a number > 0; what were the links set to during the sweep?")
    found: list[FittedActuator] = []
    failed: list[ChainPlace] = []
    for place, sweep in read_sweeps(source, profile).items():
        try:
            fit = fit_chain(sweep)
        except SweepError as error:
            raise AppError(f"{source}: row {place.row}, chain {place.chain}: {error}") from None
        found += _fitted(profile, place, fit)
        if fit.outcome is not Outcome.OK:
            failed.append(place)
    if out is not None and not failed:
        write_device(out, profile, [one.entry(lam_set) for one in found])
    return CalibrateReport(str(out) if out and not failed else "", profile.name, tuple(found), tuple(failed))


def _fitted(device: Device, place: ChainPlace, fit: ChainFit) -> list[FittedActuator]:
    wide = fit.half_width(CONFIDENCE)
    out = []
    for m in range(len(fit.natural)):
        fed = "epsilon_per_volt" if m == 0 else "lam"
        names = ("f0_hz", "delta", "beta", fed)
        unit = (device.f0_hz, 1.0, 1.0, 1.0)
        values = [float(v[m]) * u for v, u in zip((fit.natural, fit.delta, fit.beta, fit.feed), unit, strict=True)]
        widths = [float(w) * u for w, u in zip(wide[:, m], unit, strict=True)]
        left_out = tuple(n for n, v, w in zip(names, values, widths, strict=True) if w > WORTHWHILE * abs(v))
        points = int(fit.measured[:, m].sum())
        out.append(
            FittedActuator(
                place.row,
                place.chain * device.chain_length + m,
                dict(zip(names, values, strict=True)),
                dict(zip(names, widths, strict=True)),
                left_out,
                float(fit.noise[m]),
                points,
                points - int(fit.used[:, m].sum()),
            )
        )
    return out
