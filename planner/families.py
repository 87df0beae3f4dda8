"""The families of patterns, and which of them makes a target on a device."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import NamedTuple

from chainsim import Closure, Device

from .family import PatternFamily
from .targets import AmplitudeTarget, ChainTarget, WalkingTarget, WaveTarget

__all__ = ["FAMILIES", "Row", "family_of", "row_of"]


class Row(NamedTuple):
    """A family: its name, the targets it makes on devices that `fits` says, and where its class is (loaded late)."""

    name: str
    targets: tuple[type[ChainTarget], ...]
    fits: Callable[[Device], bool]
    module: str
    kind: str


def _biased(device: Device) -> bool:
    """Whether any pattern can be held statically."""
    return device.bias == "actuator"


def _single(device: Device) -> bool:
    """Whether actuators are alone."""
    return device.chain_length == 1


def _modulated(device: Device) -> bool:
    """Whether a carrier is felt in how it swells only."""
    return device.modulation is not None


def _linked(device: Device) -> bool:
    """Whether any pattern can be made by vibration: with a lam per link, or without coupling."""
    return _single(device) or (device.coupling.scope == "link" and device.coupling.closure is Closure.OPEN)


def _any(device: Device) -> bool:
    return True


# Of those that make a target the first.
FAMILIES = (
    Row("modulated", (AmplitudeTarget,), _modulated, ".modulation.modulated", "Modulated"),
    Row("deflection", (AmplitudeTarget,), _biased, ".amplitudes.deflection", "Deflection"),
    Row("amplitude", (AmplitudeTarget,), _linked, ".amplitudes.vibration", "Vibration"),
    Row("single", (WalkingTarget,), _single, ".waves.single", "SingleWalk"),
    Row("walking", (WalkingTarget,), _any, ".waves.walking", "Walks"),
    Row("wave", (WaveTarget, AmplitudeTarget), _any, ".waves.wave_state", "Waves"),
)


def row_of(kind: type[ChainTarget], device: Device) -> Row:
    """The family that makes targets of a kind on a device."""
    return next(row for row in FAMILIES if kind in row.targets and row.fits(device))


def family_of(
    row: Row, device: Device, contrast_db: float, kinds: Sequence[Device] = (), whole: PatternFamily | None = None
) -> PatternFamily:
    """A family on a device, ready to be asked.

    Parameters
    ----------
    contrast_db : how far an unraised dot of a vibrating chain stays below a raised one.
    kinds : the chains of a device whose chains have numbers of their own, each as a device.
    whole : the family on such a device when `device` is one of them.
    """
    family: type[PatternFamily] = getattr(import_module(row.module, __package__), row.kind)
    return family.of(device, contrast_db, kinds, whole)
