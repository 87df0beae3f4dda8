"""How actuators differ from the profile: what was measured (``actuators``) and what is not known (``spread``)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["Actuator", "ActuatorSpread", "PlusMinus", "far_off", "misplaced"]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
# Of a natural frequency from the profile's, up and down.
FARTHEST = 1000.0
Place = Annotated[int, Field(ge=0, le=1023)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)


class PlusMinus(_Part):
    """Half widths of 95 % confidence intervals, each in the unit of the number it belongs to."""

    f0_hz: NotNegative | None = None
    delta: NotNegative | None = None
    beta: NotNegative | None = None
    lam: NotNegative | None = None
    epsilon_per_volt: NotNegative | None = None


class Actuator(_Part):
    """What was measured of one actuator; what is left out is as the profile says.

    Attributes
    ----------
    row, col : its place in the grid, from 0.
    f0_hz : its natural frequency in hertz.
    delta, beta, lam, epsilon_per_volt : dimensionless in units of the *profile's* f0_hz, as all of the profile is.
        `lam` is the link from its left neighbour; the first of a chain has `epsilon_per_volt` instead.
    lam_set : what that link was set to when `lam` was measured.
    plus_minus : 95 % confidence.
    """

    row: Place
    col: Place
    f0_hz: Positive | None = None
    delta: Annotated[float, Field(gt=0, lt=1)] | None = None
    beta: Finite | None = None
    lam: NotNegative | None = None
    lam_set: Positive | None = None
    epsilon_per_volt: Positive | None = None
    plus_minus: PlusMinus = PlusMinus()


class ActuatorSpread(_Part):
    """How far actuators lie from the numbers that are known of them: standard deviations, each relative to its number.

    Those are the measured numbers of ``actuators``, else the profile's. Independent from actuator to actuator, normal.

    Attributes
    ----------
    frequency : of natural frequencies (0.01 is 1 %).
    damping : of delta.
    beta : of the cubic term.
    lam : of what a link makes of the lam it is set to.
    """

    frequency: Share = 0.0
    damping: Share = 0.0
    beta: Share = 0.0
    lam: Share = 0.0


def far_off(actuators: Iterable[Actuator], f0_hz: float) -> str:
    """Which natural frequency cannot be one of a device whose profile says `f0_hz`, or ""."""
    for index, one in enumerate(actuators):
        if one.f0_hz is not None and not f0_hz / FARTHEST <= one.f0_hz <= f0_hz * FARTHEST:
            wanted = f"expected within {FARTHEST:g} times the profile's {f0_hz:g}"
            return f"actuators.{index}.f0_hz: {wanted}, got {one.f0_hz:g}"
    return ""


def misplaced(actuators: Iterable[Actuator], rows: int, cols: int, chain_length: int) -> str:
    """What is wrong with where actuators are said to be in a grid, or ""."""
    seen: set[tuple[int, int]] = set()
    for index, one in enumerate(actuators):
        place = f"actuators.{index}: row {one.row}, col {one.col}"
        if one.row >= rows or one.col >= cols:
            return f"{place} is outside the grid of {rows} x {cols}"
        if (one.row, one.col) in seen:
            return f"{place} is given twice; keep one"
        first = one.col % chain_length == 0
        if first and one.lam is not None:
            return f"{place} is the first of its chain and has no lam; remove it"
        if not first and one.epsilon_per_volt is not None:
            return f"{place} is not driven and has no epsilon_per_volt; remove it"
        seen.add((one.row, one.col))
    return ""
