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
from .yamlfile import Located, parse_model, read_located, read_model

if TYPE_CHECKING:
    from .ladder import solve
    from .motion.as_built import AsBuilt
    from .motion.integrate import Escape, GridError, GridIntegrator
    from .motion.ode import Reached, reached_from_rest, steady_from_ramp, steady_from_rest
    from .simulate_io import Simulation, parse_simulation, read_simulation, simulate
    from .slow.envelope import follow
    from .slow.envelope_decide import Decision, decide
    from .stability.continuation import continue_branch
    from .stability.spectrum import (
        critical_lam,
        delta_from_critical_lam,
        gain_per_stage,
        peak_gain,
        rest_eigenvalues,
        spectrum_curve,
    )
    from .steady.harmonic_balance import balance_near
    from .steady.joint_branches import Branches, joint_branches
    from .steady.sensitivity import Gradient, gradient
    from .sweeping.sweep_file import SettingSweep, read_sweep
    from .sweeping.sweeps import SweepResult, sweep, unit_of
    from .terms.terms import AmplifierDynamics, BoucWen, Creep, Mode, Play, Terms, Tone, bending_modes, modulated
    from .terms.terms_ode import integrate_terms
    from .terms.terms_rungs import solve_with_terms
    from .terms.terms_steady import Steady, steady_with_terms
    from .terms.terms_tones import two_tones

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
    "Located",
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
    "read_located",
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
    "steady_from_ramp": "motion.ode",
    "decide": "slow.envelope_decide",
    "Decision": "slow.envelope_decide",
    "modulated": "terms.terms",
    "bending_modes": "terms.terms",
    "Play": "terms.terms",
    "Mode": "terms.terms",
    "Creep": "terms.terms",
    "BoucWen": "terms.terms",
    "AmplifierDynamics": "terms.terms",
    "steady_with_terms": "terms.terms_steady",
    "Steady": "terms.terms_steady",
    "solve_with_terms": "terms.terms_rungs",
    "joint_branches": "steady.joint_branches",
    "Branches": "steady.joint_branches",
    "AsBuilt": "motion.as_built",
    "Tone": "terms.terms",
    "follow": "slow.envelope",
    "two_tones": "terms.terms_tones",
    "integrate_terms": "terms.terms_ode",
    "Terms": "terms.terms",
    "peak_gain": "stability.spectrum",
    "gain_per_stage": "stability.spectrum",
    "rest_eigenvalues": "stability.spectrum",
    "spectrum_curve": "stability.spectrum",
    "delta_from_critical_lam": "stability.spectrum",
    "critical_lam": "stability.spectrum",
    "continue_branch": "stability.continuation",
    "SettingSweep": "sweeping.sweep_file",
    "read_sweep": "sweeping.sweep_file",
    "SweepResult": "sweeping.sweeps",
    "sweep": "sweeping.sweeps",
    "unit_of": "sweeping.sweeps",
    "Escape": "motion.integrate",
    "Gradient": "steady.sensitivity",
    "GridError": "motion.integrate",
    "GridIntegrator": "motion.integrate",
    "Reached": "motion.ode",
    "Simulation": "simulate_io",
    "balance_near": "steady.harmonic_balance",
    "gradient": "steady.sensitivity",
    "parse_simulation": "simulate_io",
    "reached_from_rest": "motion.ode",
    "read_simulation": "simulate_io",
    "simulate": "simulate_io",
    "solve": "ladder",
    "steady_from_rest": "motion.ode",
}


def __getattr__(name: str) -> object:
    if name in _LATE:
        return getattr(import_module(f".{_LATE[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
