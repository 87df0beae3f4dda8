"""Which settings make the scene on the device."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .errors import ContrastError, DwellTooShort, PlanError, SceneDoesNotFit
from .plan import ChainState, FramePlan, Margins, Plan, Ramp, Tone, ToneRamp
from .scene_plan import DEFAULT_CONTRAST_DB, plan_scene

if TYPE_CHECKING:
    from .calibration import ChainFit, Sweep, SweepError, fit_chain
    from .robust import Accuracy, Held, RobustError, RobustPlan, TradeRow, Trial, accuracy_needed, hold, robust_plan
    from .spread import Spread, SpreadError, SpreadReport, Wish, spread_of, wish_of

__all__ = [
    "DEFAULT_CONTRAST_DB",
    "Accuracy",
    "ChainFit",
    "ChainState",
    "ContrastError",
    "DwellTooShort",
    "FramePlan",
    "Held",
    "Margins",
    "Plan",
    "PlanError",
    "Ramp",
    "RobustError",
    "RobustPlan",
    "SceneDoesNotFit",
    "Spread",
    "SpreadError",
    "SpreadReport",
    "Sweep",
    "SweepError",
    "Tone",
    "ToneRamp",
    "TradeRow",
    "Trial",
    "Wish",
    "accuracy_needed",
    "fit_chain",
    "hold",
    "plan_scene",
    "robust_plan",
    "spread_of",
    "wish_of",
]

_LATE = {
    "Accuracy": "robust",
    "ChainFit": "calibration",
    "Held": "robust",
    "RobustError": "robust",
    "RobustPlan": "robust",
    "Spread": "spread",
    "SpreadError": "spread",
    "SpreadReport": "spread",
    "Sweep": "calibration",
    "SweepError": "calibration",
    "TradeRow": "robust",
    "Trial": "robust",
    "Wish": "spread",
    "accuracy_needed": "robust",
    "fit_chain": "calibration",
    "hold": "robust",
    "robust_plan": "robust",
    "spread_of": "spread",
    "wish_of": "spread",
}


def __getattr__(name: str) -> object:
    if name in _LATE:
        return getattr(import_module(f".{_LATE[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
