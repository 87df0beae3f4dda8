"""What the other packages define and a user of `dotwave` names."""

from chainsim import Chain, ChainError, Device, Outcome, Setting
from drivers import DriverError
from encoders import EncodeError, Scene
from planner import FramePlan, PlanError

__all__ = [
    "Chain",
    "ChainError",
    "Device",
    "DriverError",
    "EncodeError",
    "FramePlan",
    "Outcome",
    "PlanError",
    "Scene",
    "Setting",
]
