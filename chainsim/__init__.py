"""What the hardware does: devices, coupled-chain systems and the ladder of solvers."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .complaints import complaint_of, shown, words_of
from .equations.chain import Chain, Setting, Spread
from .equations.coupling import Closure, CouplingKind
from .errors import ChainError, ProfileError
from .model.calibrated import Actuator, ActuatorSpread
from .model.device import Amplifier, Coupling, Device, Note, Span, device_names, load_device
from .model.response import Branch, Outcome, Response, Stats
from .npy_header import NpyHeader, read_npy_header
from .reading import first_bytes
from .rung import RUNGS, TERMS, Rung, RungError, Start, load_rung
from .yamlfile import Located, parse_model, read_located, read_model

if TYPE_CHECKING:
    from .averaging.decide import Decision, decide
    from .averaging.envelope import follow
    from .batch.sweep import SweepResult, sweep, unit_of
    from .continuation.path import continue_branch
    from .continuation.spectrum import (
        critical_lam,
        delta_from_critical_lam,
        gain_per_stage,
        peak_gain,
        rest_eigenvalues,
        spectrum_curve,
    )
    from .effects.effects import AmplifierDynamics, BoucWen, Creep, Mode, Play, Terms, Tone, bending_modes, modulated
    from .effects.ode import integrate_terms
    from .effects.rungs import solve_with_terms
    from .effects.steady import Steady, steady_with_terms
    from .effects.tones import two_tones
    from .files.simulation import Simulation, parse_simulation, read_simulation, simulate
    from .files.sweep import SettingSweep, read_sweep
    from .harmonic_balance.joint_branches import Branches, joint_branches
    from .harmonic_balance.rung import balance_near
    from .harmonic_balance.sensitivity import Gradient, gradient
    from .npz_file import opened_npz
    from .reach.ladder import solve
    from .time_domain.as_built import AsBuilt
    from .time_domain.integrate import Escape, GridError, GridIntegrator
    from .time_domain.ode import Reached, reached_from_rest, steady_from_ramp, steady_from_rest

__all__ = [
    "RUNGS",
    "TERMS",
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
    "NpyHeader",
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
    "complaint_of",
    "continue_branch",
    "critical_lam",
    "decide",
    "delta_from_critical_lam",
    "device_names",
    "first_bytes",
    "follow",
    "gain_per_stage",
    "gradient",
    "integrate_terms",
    "joint_branches",
    "load_device",
    "load_rung",
    "modulated",
    "opened_npz",
    "parse_model",
    "parse_simulation",
    "peak_gain",
    "reached_from_rest",
    "read_located",
    "read_model",
    "read_npy_header",
    "read_simulation",
    "read_sweep",
    "rest_eigenvalues",
    "shown",
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
    "words_of",
]

_LATE = {
    "steady_from_ramp": "time_domain.ode",
    "decide": "averaging.decide",
    "Decision": "averaging.decide",
    "modulated": "effects.effects",
    "opened_npz": "npz_file",
    "bending_modes": "effects.effects",
    "Play": "effects.effects",
    "Mode": "effects.effects",
    "Creep": "effects.effects",
    "BoucWen": "effects.effects",
    "AmplifierDynamics": "effects.effects",
    "steady_with_terms": "effects.steady",
    "Steady": "effects.steady",
    "solve_with_terms": "effects.rungs",
    "joint_branches": "harmonic_balance.joint_branches",
    "Branches": "harmonic_balance.joint_branches",
    "AsBuilt": "time_domain.as_built",
    "Tone": "effects.effects",
    "follow": "averaging.envelope",
    "two_tones": "effects.tones",
    "integrate_terms": "effects.ode",
    "Terms": "effects.effects",
    "peak_gain": "continuation.spectrum",
    "gain_per_stage": "continuation.spectrum",
    "rest_eigenvalues": "continuation.spectrum",
    "spectrum_curve": "continuation.spectrum",
    "delta_from_critical_lam": "continuation.spectrum",
    "critical_lam": "continuation.spectrum",
    "continue_branch": "continuation.path",
    "SettingSweep": "files.sweep",
    "read_sweep": "files.sweep",
    "SweepResult": "batch.sweep",
    "sweep": "batch.sweep",
    "unit_of": "batch.sweep",
    "Escape": "time_domain.integrate",
    "Gradient": "harmonic_balance.sensitivity",
    "GridError": "time_domain.integrate",
    "GridIntegrator": "time_domain.integrate",
    "Reached": "time_domain.ode",
    "Simulation": "files.simulation",
    "balance_near": "harmonic_balance.rung",
    "gradient": "harmonic_balance.sensitivity",
    "parse_simulation": "files.simulation",
    "reached_from_rest": "time_domain.ode",
    "read_simulation": "files.simulation",
    "simulate": "files.simulation",
    "solve": "reach.ladder",
    "steady_from_rest": "time_domain.ode",
}


def __getattr__(name: str) -> object:
    if name in _LATE:
        return getattr(import_module(f".{_LATE[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
