"""Settings with the least expected error under spread, what they cost, and how much spread they can bear."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from chainsim import Device

from ..closed_forms.links import drive_for, links_for
from ..errors import PlanError
from ..operating_point import OperatingPoint
from .robust_search import RobustSearch, TradeRow, Trial
from .spread import RelativeSpread

__all__ = [
    "Accuracy",
    "RobustError",
    "RobustPlan",
    "TradeRow",
    "Trial",
    "accuracy_needed",
    "robust_plan",
]

OMEGAS = 12
HALVINGS = 10


class RobustError(PlanError, ValueError):
    """A robust setting cannot be searched for.

    Examples: the nominal setting needs more volts, or other frequencies, than the device has.
    """


@dataclass(frozen=True)
class RobustPlan:
    """The robust setting beside the nominal one, and the trade between error, drive and frequency.

    Attributes
    ----------
    nominal : the setting that was given.
    robust : the one with the least expected error the device can hold.
    trade : for ever higher frequencies the robust setting at each; empty where only the given one has a closed form.
    """

    nominal: TradeRow
    robust: TradeRow
    trade: tuple[TradeRow, ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        trade = [row.as_dict() for row in self.trade]
        return {"nominal": self.nominal.as_dict(), "robust": self.robust.as_dict(), "trade": trade}

    def table(self) -> str:
        """The trade as text, a line per frequency."""
        head = f"{'omega':>8} {'volts':>7} {'error':>8} {'expected':>9} {'median':>8} {'90 %':>8} {'yield':>7}"
        named = [("nominal", self.nominal), *(("", row) for row in self.trade), ("robust", self.robust)]
        return "\n".join([head, *(f"{_line(row)}  {name}".rstrip() for name, row in named)])


def _line(row: TradeRow) -> str:
    report = row.report
    return (
        f"{row.point.omega:8.4f} {row.volts:7.1%} {row.nominal_error:8.4f} {report.expected:9.4f} "
        f"{report.median:8.4f} {report.quantile(0.9):8.4f} {report.yield_:7.1%}"
    )


@dataclass(frozen=True)
class Accuracy:
    """How well actuators must be known, or made, for a pattern.

    Attributes
    ----------
    factor : what the spread must be multiplied by; 1 where it is good enough, 0 where no accuracy helps.
    spread : the spread that is left then: the standard deviations a calibration must reach.
    row : the setting for it, and what it gives.
    """

    factor: float
    spread: RelativeSpread
    row: TradeRow


def robust_plan(device: Device, trial: Trial, nominal: OperatingPoint, *, well_share: float) -> RobustPlan:
    """Minimise the expected error over drive, links and frequency.

    The search starts at `nominal` and, where every link has its own lam, at the closed forms for frequencies over the
    device's whole band. All settings keep to the device's volts, frequencies and links.

    Parameters
    ----------
    nominal : a setting for the pattern, such as the plan's.
    well_share : largest amplitude over the hilltop's.

    Raises
    ------
    RobustError
        When `nominal` itself is beyond what the device can hold.
    """
    search = RobustSearch(device, trial, trial.spread)
    given = search.row(nominal)
    if not search.fits(nominal) or given.well > well_share:
        raise RobustError(
            f"robust: the nominal setting (omega {nominal.omega:.4g}, {given.volts:.0%} of the volts, "
            f"{given.well:.0%} of the well) is beyond what {device.name} can hold; plan it for this device first"
        )
    starts = _closed_forms(device, trial) if device.coupling.scope == "link" else []
    trade = [search.row(search.least(start, free_omega=False)) for start in starts if search.fits(start)]
    allowed = [row for row in (given, *trade) if row.well <= well_share]
    best = min(allowed, key=lambda row: row.report.expected)
    last = [search.row(search.least(row.point, free_omega=True)) for row in {id(r): r for r in (best, given)}.values()]
    robust = min([best, *(row for row in last if row.well <= well_share)], key=lambda row: row.report.expected)
    return RobustPlan(given, robust, tuple(trade))


def _closed_forms(device: Device, trial: Trial) -> list[OperatingPoint]:
    """Nominal settings of the wish's amplitudes over the device's band."""
    amplitude = np.abs(trial.wish.amplitude[0]) * trial.wish.full_scale
    if not np.all(amplitude > 0):
        return []
    found = []
    for omega in np.linspace(device.omega.min, device.omega.max, OMEGAS):
        lam = links_for(trial.chain, amplitude, float(omega))
        if np.all(np.isfinite(lam)):
            found.append(
                OperatingPoint(float(drive_for(trial.chain, amplitude[:1], float(omega))[0]), lam, float(omega))
            )
    return found


def accuracy_needed(device: Device, trial: Trial, nominal: OperatingPoint, *, share: float) -> Accuracy:
    """The largest part of the spread under which `share` of the draws make the pattern, by bisection.

    Each part of the spread has its own least expected error, searched for from `nominal` at its frequency.
    """
    for factor in (1.0, 0.0):
        found = _best(device, trial, factor, nominal)
        if (found.report.yield_ >= share) == (factor == 1.0):
            return Accuracy(factor, trial.spread.scaled(factor), found)
    good, bad = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (good + bad) / 2
        row = _best(device, trial, middle, nominal)
        if row.report.yield_ >= share:
            good, found = middle, row
        else:
            bad = middle
    return Accuracy(good, trial.spread.scaled(good), found)


def _best(device: Device, trial: Trial, factor: float, nominal: OperatingPoint) -> TradeRow:
    """Of `nominal` and the setting with the least expected error near it, the one with the greater yield."""
    search = RobustSearch(device, trial, trial.spread.scaled(factor))
    rows = [search.row(nominal), search.row(search.least(nominal, free_omega=False))]
    return max(rows, key=lambda row: row.report.yield_)
