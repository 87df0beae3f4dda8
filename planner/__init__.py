"""Which settings make the scene on the device."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .errors import ContrastError, DwellTooShort, PlanError, SceneDoesNotFit
from .plan import ChainState, FramePlan, Margins, Plan, Ramp, Tone, ToneRamp
from .scene_plan import DEFAULT_CONTRAST_DB, plan_scene

if TYPE_CHECKING:
    from .price.climbing import climb
    from .price.pareto import ParetoError, ParetoFront, ParetoPoint, front_of, pareto_of
    from .price.questions import Question, TradeoffError, questions_of, seconds_words
    from .price.requirement import Requirement, RequirementError, Term, require
    from .price.tradeoff import Choice, Tradeoff, TradeoffRow, trade_off
    from .spreading.calibration import ChainFit, Sweep, SweepError, fit_chain
    from .spreading.outlook import FrameSpread, TradePoint
    from .spreading.robust import (
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
    from .spreading.spread import Spread, SpreadError, SpreadReport, Wish, spread_of, wish_of
    from .surroundings import HigherMode, Surroundings, assumed
    from .waves.walking import walking_rate_hz

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
    "walking_rate_hz",
    "wish_of",
]

_LATE = {
    "walking_rate_hz": "waves.walking",
    "TradePoint": "spreading.outlook",
    "FrameSpread": "spreading.outlook",
    "pareto_of": "price.pareto",
    "front_of": "price.pareto",
    "ParetoPoint": "price.pareto",
    "ParetoFront": "price.pareto",
    "ParetoError": "price.pareto",
    "trade_off": "price.tradeoff",
    "TradeoffRow": "price.tradeoff",
    "Tradeoff": "price.tradeoff",
    "Choice": "price.tradeoff",
    "climb": "price.climbing",
    "seconds_words": "price.questions",
    "questions_of": "price.questions",
    "TradeoffError": "price.questions",
    "Question": "price.questions",
    "assumed": "surroundings",
    "Surroundings": "surroundings",
    "HigherMode": "surroundings",
    "require": "price.requirement",
    "Term": "price.requirement",
    "RequirementError": "price.requirement",
    "Requirement": "price.requirement",
    "Accuracy": "spreading.robust",
    "ChainFit": "spreading.calibration",
    "Held": "spreading.robust",
    "RobustError": "spreading.robust",
    "RobustPlan": "spreading.robust",
    "Spread": "spreading.spread",
    "SpreadError": "spreading.spread",
    "SpreadReport": "spreading.spread",
    "Sweep": "spreading.calibration",
    "SweepError": "spreading.calibration",
    "TradeRow": "spreading.robust",
    "Trial": "spreading.robust",
    "Wish": "spreading.spread",
    "accuracy_needed": "spreading.robust",
    "fit_chain": "spreading.calibration",
    "hold": "spreading.robust",
    "robust_plan": "spreading.robust",
    "spread_of": "spreading.spread",
    "wish_of": "spreading.spread",
}


def __getattr__(name: str) -> object:
    if name in _LATE:
        return getattr(import_module(f".{_LATE[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
