"""Which settings make the scene on the device."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .drive import DriveTone, FirstOrderHold, curve, links_at, tones_of
from .errors import ContrastError, DwellTooShort, PlanError, SceneDoesNotFit
from .operating_point import Margins, OperatingPoint, PointTone
from .plan import FramePlan, Plan, Ramp, ToneRamp
from .scene_plan import DEFAULT_CONTRAST_DB, plan_scene

if TYPE_CHECKING:
    from .analysis.climbing import climb
    from .analysis.pareto import ParetoError, ParetoFront, ParetoPoint, front_of, pareto_of
    from .analysis.questions import Question, TradeoffError, questions_of, seconds_words
    from .analysis.requirement import Requirement, RequirementError, Term, require
    from .analysis.tradeoff import Tradeoff, TradeoffChoice, TradeoffRow, trade_off
    from .identification.calibration import ChainFit, Sweep, SweepError, fit_chain
    from .outlook import FrameSpread, TradePoint
    from .robustness.robust import (
        Accuracy,
        RobustError,
        RobustPlan,
        TradeRow,
        Trial,
        accuracy_needed,
        robust_plan,
    )
    from .robustness.spread import FrameTarget, RelativeSpread, SpreadError, SpreadReport, frame_target, spread_of
    from .surroundings import HigherMode, Surroundings, assumed
    from .waves.walking import walking_rate_hz

__all__ = [
    "DEFAULT_CONTRAST_DB",
    "Accuracy",
    "ChainFit",
    "ContrastError",
    "DriveTone",
    "DwellTooShort",
    "FirstOrderHold",
    "FramePlan",
    "FrameSpread",
    "FrameTarget",
    "HigherMode",
    "Margins",
    "OperatingPoint",
    "ParetoError",
    "ParetoFront",
    "ParetoPoint",
    "Plan",
    "PlanError",
    "PointTone",
    "Question",
    "Ramp",
    "RelativeSpread",
    "Requirement",
    "RequirementError",
    "RobustError",
    "RobustPlan",
    "SceneDoesNotFit",
    "SpreadError",
    "SpreadReport",
    "Surroundings",
    "Sweep",
    "SweepError",
    "Term",
    "ToneRamp",
    "TradePoint",
    "TradeRow",
    "Tradeoff",
    "TradeoffChoice",
    "TradeoffError",
    "TradeoffRow",
    "Trial",
    "accuracy_needed",
    "assumed",
    "climb",
    "curve",
    "fit_chain",
    "frame_target",
    "front_of",
    "links_at",
    "pareto_of",
    "plan_scene",
    "questions_of",
    "require",
    "robust_plan",
    "seconds_words",
    "spread_of",
    "tones_of",
    "trade_off",
    "walking_rate_hz",
]

_LATE = {
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
    "TradeoffChoice": "analysis.tradeoff",
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
    "RobustError": "robustness.robust",
    "RobustPlan": "robustness.robust",
    "RelativeSpread": "robustness.spread",
    "SpreadError": "robustness.spread",
    "SpreadReport": "robustness.spread",
    "Sweep": "identification.calibration",
    "SweepError": "identification.calibration",
    "TradeRow": "robustness.robust",
    "Trial": "robustness.robust",
    "FrameTarget": "robustness.spread",
    "accuracy_needed": "robustness.robust",
    "fit_chain": "identification.calibration",
    "robust_plan": "robustness.robust",
    "spread_of": "robustness.spread",
    "frame_target": "robustness.spread",
}


def __getattr__(name: str) -> object:
    if name in _LATE:
        return getattr(import_module(f".{_LATE[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
