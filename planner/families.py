"""The families of patterns, and which of them makes a target on a device."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import NamedTuple

from chainsim import Closure, Device
from encoders import TargetPattern

from .family import PatternFamily
from .targets import AmplitudeTarget, ChainTarget, UnlockedTarget, WalkingTarget, WaveTarget, targets_of

__all__ = ["FAMILIES", "Row", "family_of", "made_at_will", "row_of"]


class Row(NamedTuple):
    """A family: its name, the targets it makes on devices that `fits` says, and where its class is (loaded late).

    `at_will` says on which of them it makes about any target of the first kind, as far as volts go.
    """

    name: str
    targets: tuple[type[ChainTarget], ...]
    fits: Callable[[Device], bool]
    at_will: Callable[[Device], bool]
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


def _two_ways(device: Device) -> bool:
    """Whether actuators are coupled in two dimensions."""
    return device.grid


def _linked_rows(device: Device) -> bool:
    """Whether they are, and each row could be a chain of its own: a drive for every row and a lam per link."""
    return device.grid and device.coupling.scope == "link" and device.coupling.drives != "corner"


def _linked_corner(device: Device) -> bool:
    """Whether they are, with a lam per link and one drive for them all."""
    return device.grid and device.coupling.scope == "link" and device.coupling.drives == "corner"


def _joint(device: Device) -> bool:
    """Whether links act both ways, or rings have a lam on every link."""
    coupling = device.coupling
    return coupling.closure is Closure.BIDIRECTIONAL or (
        coupling.closure is Closure.RING and coupling.scope == "link" and not _single(device)
    )


def _tuned(device: Device) -> bool:
    """Whether each chain has a lam of its own that can be set, or none and needs none."""
    return _single(device) or (device.coupling.scope in ("chain", "link") and device.coupling.closure is Closure.OPEN)


def _bordered(device: Device) -> bool:
    """Whether all of the first row and column of a grid are driven."""
    return device.coupling.drives == "border"


def _ring(device: Device) -> bool:
    """Whether chains are rings."""
    return device.coupling.closure is Closure.RING


def _none(device: Device) -> bool:
    return False


def _any(device: Device) -> bool:
    return True


# Of those that make a target the first.
FAMILIES = (
    Row("modulated", (AmplitudeTarget,), _modulated, _linked, ".modulation.modulated", "Modulated"),
    Row("grid amplitude", (AmplitudeTarget,), _linked_rows, _any, ".grids.rows", "GridRows"),
    Row("grid tree", (AmplitudeTarget,), _linked_corner, _none, ".grids.tree", "GridTree"),
    Row("grid wave", (WaveTarget, AmplitudeTarget, WalkingTarget), _two_ways, _bordered, ".grids.waves", "GridWaves"),
    Row("deflection", (AmplitudeTarget,), _biased, _any, ".amplitudes.deflection", "Deflection"),
    Row("amplitude", (AmplitudeTarget,), _linked, _any, ".amplitudes.vibration", "Vibration"),
    Row("joint", (AmplitudeTarget, WaveTarget), _joint, _none, ".waves.joint", "Joint"),
    Row("single", (WalkingTarget,), _single, _any, ".waves.single", "SingleWalk"),
    Row("walking", (WalkingTarget,), _any, _tuned, ".waves.walking", "Walks"),
    Row("unlocked", (UnlockedTarget,), _any, _ring, ".waves.unlocked", "Unlocked"),
    Row("wave", (WaveTarget, AmplitudeTarget), _any, _tuned, ".waves.wave_state", "Waves"),
)


def row_of(kind: type[ChainTarget], device: Device) -> Row:
    """The family that makes targets of a kind on a device."""
    return next(row for row in FAMILIES if kind in row.targets and row.fits(device))


def made_at_will(pattern: TargetPattern, device: Device) -> bool:
    """Whether a device makes about any pattern of such a kind, by its families alone: nothing is planned."""
    if pattern.amplitude.shape != (device.rows, device.cols):
        return False
    kinds = {type(target) for target in targets_of(pattern, device) if not target.resting}
    rows = [row_of(kind, device) for kind in kinds]
    return all(kind is row.targets[0] and row.at_will(device) for kind, row in zip(kinds, rows, strict=True))


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
