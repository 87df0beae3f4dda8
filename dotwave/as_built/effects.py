"""Which effects surround a device, and a device with one of them alone."""

from __future__ import annotations

from chainsim import Surroundings

__all__ = ["AS_PLANNED", "EFFECTS", "VARYING", "alone", "present"]

# Effect, as `explain` calls it -> the values of the surroundings that are it.
EFFECTS: dict[str, tuple[str, ...]] = {
    "spread": ("spread",),
    "hysteresis": ("hysteresis", "saturation"),
    "creep": ("creep_per_decade", "creep_first_s"),
    "higher modes": ("modes",),
    "2-D coupling": ("row_lam",),
    "amplifier dynamics": ("bandwidth_hz",),
    "amplifier noise": ("amplifier_noise",),
    "rounding": ("converter_bits",),
    "preload": ("preload", "touch_stiffness", "touch_damping"),
}
# They say how an effect goes, not that it is there.
_SHAPES = {"saturation", "creep_first_s"}

VARYING = frozenset({"spread", "amplifier noise"})
"""Those that differ from device to device; under each other one all devices are the same."""

AS_PLANNED = "none"
"""What a device with no effect at all is called beside those with one."""


def present(around: Surroundings) -> tuple[str, ...]:
    """The effects that are there."""
    nothing = Surroundings()
    there = {name for name in Surroundings.model_fields if getattr(around, name) != getattr(nothing, name)}
    return tuple(effect for effect, names in EFFECTS.items() if there.intersection(names) - _SHAPES)


def alone(around: Surroundings, effect: str) -> Surroundings:
    """The surroundings with nothing but one effect; with nothing at all for `AS_PLANNED`."""
    kept = EFFECTS.get(effect, ())
    return Surroundings(**{name: getattr(around, name) for name in kept})
