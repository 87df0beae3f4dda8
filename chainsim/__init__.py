"""What the hardware does: devices, coupled-chain systems and the ladder of solvers."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .chain import Chain, Closure, Setting
from .device import Amplifier, Coupling, Device, Note, Span, device_names, load_device
from .errors import ChainError, ProfileError
from .response import Branch, Outcome, Response, Stats
from .rung import RUNGS, Rung, RungError, Start, load_rung

if TYPE_CHECKING:
    from .harmonic_balance import balance_near
    from .integrate import Escape, GridError, GridIntegrator
    from .ladder import solve
    from .ode import Reached, reached_from_rest, steady_from_rest
    from .sensitivity import Gradient, gradient
    from .simulate_io import Simulation, parse_simulation, read_simulation, simulate

__all__ = [
    "RUNGS",
    "Amplifier",
    "Branch",
    "Chain",
    "ChainError",
    "Closure",
    "Coupling",
    "Device",
    "Escape",
    "Gradient",
    "GridError",
    "GridIntegrator",
    "Note",
    "Outcome",
    "ProfileError",
    "Reached",
    "Response",
    "Rung",
    "RungError",
    "Setting",
    "Simulation",
    "Span",
    "Start",
    "Stats",
    "balance_near",
    "device_names",
    "gradient",
    "load_device",
    "load_rung",
    "parse_simulation",
    "reached_from_rest",
    "read_simulation",
    "simulate",
    "solve",
    "steady_from_rest",
]

_LATE = {
    "Escape": "integrate",
    "Gradient": "sensitivity",
    "GridError": "integrate",
    "GridIntegrator": "integrate",
    "Reached": "ode",
    "Simulation": "simulate_io",
    "balance_near": "harmonic_balance",
    "gradient": "sensitivity",
    "parse_simulation": "simulate_io",
    "reached_from_rest": "ode",
    "read_simulation": "simulate_io",
    "simulate": "simulate_io",
    "solve": "ladder",
    "steady_from_rest": "ode",
}


def __getattr__(name: str) -> object:
    if name in _LATE:
        return getattr(import_module(f".{_LATE[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
