"""What the hardware does: devices, coupled-chain systems and the ladder of solvers."""

from .chain import Chain, Closure, Setting
from .device import Amplifier, Coupling, Device, Note, Span, device_names, load_device
from .errors import ChainError, ProfileError
from .response import Branch, Outcome, Response, Stats

__all__ = [
    "Amplifier",
    "Branch",
    "Chain",
    "ChainError",
    "Closure",
    "Coupling",
    "Device",
    "Note",
    "Outcome",
    "ProfileError",
    "Response",
    "Setting",
    "Span",
    "Stats",
    "device_names",
    "load_device",
]
