"""Which settings make the scene on the device."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .errors import ContrastError, DwellTooShort, PlanError, SceneDoesNotFit
from .plan import ChainState, FramePlan, Margins, Plan, Ramp, Tone, ToneRamp
from .scene_plan import DEFAULT_CONTRAST_DB, plan_scene

if TYPE_CHECKING:
    from .calibration import ChainFit, Sweep, SweepError, fit_chain
    from .climbing import climb
    from .outlook import FrameSpread, TradePoint
    from .pareto import ParetoError, ParetoFront, ParetoPoint, front_of, pareto_of
    from .questions import Question, TradeoffError, questions_of, seconds_words
    from .requirement import Requirement, RequirementError, Term, require
    from .robust import Accuracy, Held, RobustError, RobustPlan, TradeRow, Trial, accuracy_needed, hold, robust_plan
    from .spread import Spread, SpreadError, SpreadReport, Wish, spread_of, wish_of
    from .surroundings import HigherMode, Surroundings, assumed
    from .tradeoff import Choice, Tradeoff, TradeoffRow, trade_off

__all__ = [
    "DEFAULT_CONTRAST_DB",
    "Accuracy",
    "ChainFit",
    "ChainState",
    "Choice",
    "ContrastError",
    "DwellTooShort",
    "FramePlan",
    "FrameSpread",
    "Held",
    "HigherMode",
    "Margins",
    "ParetoError",
    "ParetoFront",
    "ParetoPoint",
    "Plan",
    "PlanError",
    "Question",
    "Ramp",
    "Requirement",
    "RequirementError",
    "RobustError",
    "RobustPlan",
    "SceneDoesNotFit",
    "Spread",
    "SpreadError",
    "SpreadReport",
    "Surroundings",
    "Sweep",
    "SweepError",
    "Term",
    "Tone",
    "ToneRamp",
    "TradePoint",
    "TradeRow",
    "Tradeoff",
    "TradeoffError",
    "TradeoffRow",
    "Trial",
    "Wish",
    "accuracy_needed",
    "assumed",
    "climb",
    "fit_chain",
    "front_of",
    "hold",
    "pareto_of",
    "plan_scene",
    "questions_of",
    "require",
    "robust_plan",
    "seconds_words",
    "spread_of",
    "trade_off",
    "wish_of",
]

_LATE = {
    "TradePoint": "outlook",
    "FrameSpread": "outlook",
    "pareto_of": "pareto",
    "front_of": "pareto",
    "ParetoPoint": "pareto",
    "ParetoFront": "pareto",
    "ParetoError": "pareto",
    "trade_off": "tradeoff",
    "TradeoffRow": "tradeoff",
    "Tradeoff": "tradeoff",
    "Choice": "tradeoff",
    "climb": "climbing",
    "seconds_words": "questions",
    "questions_of": "questions",
    "TradeoffError": "questions",
    "Question": "questions",
    "assumed": "surroundings",
    "Surroundings": "surroundings",
    "HigherMode": "surroundings",
    "require": "requirement",
    "Term": "requirement",
    "RequirementError": "requirement",
    "Requirement": "requirement",
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
