"""How fast two tones under one lam carry bars along a chain, and what to say where dots are to travel instead."""

from __future__ import annotations

from typing import NamedTuple

from chainsim import Device, Outcome

from ..targets import WalkingTarget
from .walking import walking_rate_hz, walking_state

__all__ = ["WalkingSpeeds", "cannot_travel", "walking_speeds"]

# Widths of bars that are tried, in actuators: the narrowest that are made, and wider ones.
WIDTHS = (1.2, 1.35, 1.5, 1.7, 1.9, 2.1, 2.4, 2.7, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 12.0)


class WalkingSpeeds(NamedTuple):
    """Columns that bars pass in a second."""

    slowest: float
    quickest: float


def walking_speeds(device: Device) -> WalkingSpeeds | None:
    """How fast bars of full scale can walk under one lam; None where none can.

    Bars of a width w come 2 w actuators apart, ``f0 delta tan(pi / 2 w)`` times a second where beta is small
    (theory.md section 2.5); each width is tried as it is planned. Where waves do not run one way along a
    chain that ends (rings, links both ways, grids) none come to stand.
    """
    n = device.chain_length
    speeds = []
    for width in WIDTHS if n > 1 and device.chain.law.in_line else ():
        state = walking_state(device, WalkingTarget((1.0,) * n, (1.0,) * n, width))
        if state.outcome is Outcome.OK:
            speeds.append(2 * width * walking_rate_hz(device, state))
    return WalkingSpeeds(min(speeds), max(speeds)) if speeds else None


def cannot_travel(device: Device) -> str:
    """Why dots do not travel on a device, what is nearest, and how fast that is."""
    lacks = "no bias on every actuator and no lam on every link"
    if device.coupling.scope == "link":
        lacks = "to rest between two patterns of dots"
    why = f"{device.name} cannot let dots travel: it has {lacks}"
    speeds = walking_speeds(device)
    if speeds is None:
        return f"{why}."
    ends = dict.fromkeys(f"{speed:.3g}" for speed in speeds)
    return f"{why}; the nearest are bars that walk (texture walking_bars), by {' to '.join(ends)} columns a second."
