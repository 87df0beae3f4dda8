"""Which settings make the scene on the device."""

from .errors import DwellTooShort, PlanError, SceneDoesNotFit
from .plan import ChainState, FramePlan, Margins, Plan, Ramp
from .scene_plan import DEFAULT_CONTRAST_DB, plan_scene

__all__ = [
    "DEFAULT_CONTRAST_DB",
    "ChainState",
    "DwellTooShort",
    "FramePlan",
    "Margins",
    "Plan",
    "PlanError",
    "Ramp",
    "SceneDoesNotFit",
    "plan_scene",
]
