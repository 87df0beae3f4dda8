"""Which settings make the scene on the device."""

from .plan import ChainState, FramePlan, Margins, Plan, Ramp

__all__ = ["ChainState", "FramePlan", "Margins", "Plan", "Ramp"]
