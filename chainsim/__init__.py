"""What the hardware does: devices, coupled-chain systems and the ladder of solvers."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .calibrated import Actuator
from .chain import Chain, Closure, CouplingKind, Setting, Spread
from .device import Amplifier, Coupling, Device, Note, Span, device_names, load_device
from .errors import ChainError, ProfileError
from .response import Branch, Outcome, Response, Stats
from .rung import RUNGS, Rung, RungError, Start, load_rung
from .yamlfile import parse_model, read_model

if TYPE_CHECKING:
    from .continuation import continue_branch
    from .envelope import follow
    from .harmonic_balance import balance_near
    from .integrate import Escape, GridError, GridIntegrator
    from .ladder import solve
    from .ode import Reached, reached_from_rest, steady_from_rest
    from .sensitivity import Gradient, gradient
    from .simulate_io import Simulation, parse_simulation, read_simulation, simulate
    from .spectrum import (
        critical_lam,
        delta_from_critical_lam,
        gain_per_stage,
        peak_gain,
        rest_eigenvalues,
        spectrum_curve,
    )
    from .sweep_file import SettingSweep, read_sweep
    from .sweeps import SweepResult, sweep, unit_of
    from .terms import Terms, Tone
    from .terms_ode import integrate_terms
    from .terms_tones import two_tones

__all__ = [
    "RUNGS",
    "Actuator",
    "Amplifier",
    "Branch",
    "Chain",
    "ChainError",
    "Closure",
    "Coupling",
    "CouplingKind",
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
    "SettingSweep",
    "Simulation",
    "Span",
    "Spread",
    "Start",
    "Stats",
    "SweepResult",
    "Terms",
    "Tone",
    "balance_near",
    "continue_branch",
    "critical_lam",
    "delta_from_critical_lam",
    "device_names",
    "follow",
    "gain_per_stage",
    "gradient",
    "integrate_terms",
    "load_device",
    "load_rung",
    "parse_model",
    "parse_simulation",
    "peak_gain",
    "reached_from_rest",
    "read_model",
    "read_simulation",
    "read_sweep",
    "rest_eigenvalues",
    "simulate",
    "solve",
    "spectrum_curve",
    "steady_from_rest",
    "sweep",
    "two_tones",
    "unit_of",
]

_LATE = {
    "Tone": "terms",
    "follow": "envelope",
    "two_tones": "terms_tones",
    "integrate_terms": "terms_ode",
    "Terms": "terms",
    "peak_gain": "spectrum",
    "gain_per_stage": "spectrum",
    "rest_eigenvalues": "spectrum",
    "spectrum_curve": "spectrum",
    "delta_from_critical_lam": "spectrum",
    "critical_lam": "spectrum",
    "continue_branch": "continuation",
    "SettingSweep": "sweep_file",
    "read_sweep": "sweep_file",
    "SweepResult": "sweeps",
    "sweep": "sweeps",
    "unit_of": "sweeps",
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
