"""Which settings make the scene on the device."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .errors import ContrastError, DwellTooShort, PlanError, SceneDoesNotFit
from .plan import ChainState, FramePlan, Margins, Plan, Ramp, Tone, ToneRamp
from .scene_plan import DEFAULT_CONTRAST_DB, plan_scene

if TYPE_CHECKING:
    from .analysis.climbing import climb
    from .analysis.pareto import ParetoError, ParetoFront, ParetoPoint, front_of, pareto_of
    from .analysis.questions import Question, TradeoffError, questions_of, seconds_words
    from .analysis.requirement import Requirement, RequirementError, Term, require
    from .analysis.tradeoff import Choice, Tradeoff, TradeoffRow, trade_off
    from .cache import PLANS_VERSION
    from .identification.calibration import ChainFit, Sweep, SweepError, fit_chain
    from .outlook import FrameSpread, TradePoint
    from .robustness.robust import (
        Accuracy,
        Held,
        RobustError,
        RobustPlan,
        TradeRow,
        Trial,
        accuracy_needed,
        hold,
        robust_plan,
    )
    from .robustness.spread import Spread, SpreadError, SpreadReport, Wish, spread_of, wish_of
    from .surroundings import HigherMode, Surroundings, assumed
    from .waves.walking import walking_rate_hz

__all__ = [
    "DEFAULT_CONTRAST_DB",
    "PLANS_VERSION",
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
    "walking_rate_hz",
    "wish_of",
]

_LATE = {
    "PLANS_VERSION": "cache",
    "walking_rate_hz": "waves.walking",
    "TradePoint": "outlook",
    "FrameSpread": "outlook",
    "pareto_of": "analysis.pareto",
    "front_of": "analysis.pareto",
    "ParetoPoint": "analysis.pareto",
    "ParetoFront": "analysis.pareto",
    "ParetoError": "analysis.pareto",
    "trade_off": "analysis.tradeoff",
    "TradeoffRow": "analysis.tradeoff",
    "Tradeoff": "analysis.tradeoff",
    "Choice": "analysis.tradeoff",
    "climb": "analysis.climbing",
    "seconds_words": "analysis.questions",
    "questions_of": "analysis.questions",
    "TradeoffError": "analysis.questions",
    "Question": "analysis.questions",
    "assumed": "surroundings",
    "Surroundings": "surroundings",
    "HigherMode": "surroundings",
    "require": "analysis.requirement",
    "Term": "analysis.requirement",
    "RequirementError": "analysis.requirement",
    "Requirement": "analysis.requirement",
    "Accuracy": "robustness.robust",
    "ChainFit": "identification.calibration",
    "Held": "robustness.robust",
    "RobustError": "robustness.robust",
    "RobustPlan": "robustness.robust",
    "Spread": "robustness.spread",
    "SpreadError": "robustness.spread",
    "SpreadReport": "robustness.spread",
    "Sweep": "identification.calibration",
    "SweepError": "identification.calibration",
    "TradeRow": "robustness.robust",
    "Trial": "robustness.robust",
    "Wish": "robustness.spread",
    "accuracy_needed": "robustness.robust",
    "fit_chain": "identification.calibration",
    "hold": "robustness.robust",
    "robust_plan": "robustness.robust",
    "spread_of": "robustness.spread",
    "wish_of": "robustness.spread",
}


def __getattr__(name: str) -> object:
    if name in _LATE:
        return getattr(import_module(f".{_LATE[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
