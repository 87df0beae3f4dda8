"""What the hardware does: devices, coupled-chain systems and the ladder of solvers."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .calibrated import Actuator, ActuatorSpread
from .chain import Chain, Closure, CouplingKind, Setting, Spread
from .device import Amplifier, Coupling, Device, Note, Span, device_names, load_device
from .errors import ChainError, ProfileError
from .response import Branch, Outcome, Response, Stats
from .rung import RUNGS, Rung, RungError, Start, load_rung
from .yamlfile import parse_model, read_model

if TYPE_CHECKING:
    from .as_built import AsBuilt
    from .continuation import continue_branch
    from .envelope import follow
    from .envelope_decide import Decision, decide
    from .harmonic_balance import balance_near
    from .integrate import Escape, GridError, GridIntegrator
    from .joint_branches import Branches, joint_branches
    from .ladder import solve
    from .ode import Reached, reached_from_rest, steady_from_ramp, steady_from_rest
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
    from .terms import AmplifierDynamics, BoucWen, Creep, Mode, Play, Terms, Tone, bending_modes, modulated
    from .terms_ode import integrate_terms
    from .terms_rungs import solve_with_terms
    from .terms_steady import Steady, steady_with_terms
    from .terms_tones import two_tones

__all__ = [
    "RUNGS",
    "Actuator",
    "ActuatorSpread",
    "Amplifier",
    "AmplifierDynamics",
    "AsBuilt",
    "BoucWen",
    "Branch",
    "Branches",
    "Chain",
    "ChainError",
    "Closure",
    "Coupling",
    "CouplingKind",
    "Creep",
    "Decision",
    "Device",
    "Escape",
    "Gradient",
    "GridError",
    "GridIntegrator",
    "Mode",
    "Note",
    "Outcome",
    "Play",
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
    "Steady",
    "SweepResult",
    "Terms",
    "Tone",
    "balance_near",
    "bending_modes",
    "continue_branch",
    "critical_lam",
    "decide",
    "delta_from_critical_lam",
    "device_names",
    "follow",
    "gain_per_stage",
    "gradient",
    "integrate_terms",
    "joint_branches",
    "load_device",
    "load_rung",
    "modulated",
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
    "solve_with_terms",
    "spectrum_curve",
    "steady_from_ramp",
    "steady_from_rest",
    "steady_with_terms",
    "sweep",
    "two_tones",
    "unit_of",
]

_LATE = {
    "steady_from_ramp": "ode",
    "decide": "envelope_decide",
    "Decision": "envelope_decide",
    "modulated": "terms",
    "bending_modes": "terms",
    "Play": "terms",
    "Mode": "terms",
    "Creep": "terms",
    "BoucWen": "terms",
    "AmplifierDynamics": "terms",
    "steady_with_terms": "terms_steady",
    "Steady": "terms_steady",
    "solve_with_terms": "terms_rungs",
    "joint_branches": "joint_branches",
    "Branches": "joint_branches",
    "AsBuilt": "as_built",
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
