"""What is taken to act on a device: what its profile says, else what is assumed of one like the paper's."""

from __future__ import annotations

from .calibrated import ActuatorSpread
from .device import Device
from .parts import HigherMode, Surroundings

__all__ = ["assumed_of", "surroundings_of"]

# The paper's finite elements: frequencies of the second and third bending mode over the first.
MODES_HZ, FIRST_HZ = (661.03, 1258.3), 133.13
# Shares of the force of a uniform cantilever bent by a moment along its length (Euler and Bernoulli).
MODE_GAINS = (3.4731, 5.7019)


def surroundings_of(device: Device) -> Surroundings:
    """The profile's section `surroundings`, or what is assumed where it has none; with the profile's own spread.

    Assumed are, for PZT-5A, a loop of 10 % and 2 % creep per decade from 0.1 s on; the paper's higher modes with the
    shares of a uniform beam; an amplifier of half its sample rate; 1 % spread of the natural frequencies. No fingertip,
    no noise, no coupling of rows.
    """
    around = device.surroundings
    if around is None:
        modes = tuple(
            HigherMode(omega=hz / FIRST_HZ, delta=device.delta * hz / FIRST_HZ, gain=gain)
            for hz, gain in zip(MODES_HZ, MODE_GAINS, strict=True)
        )
        around = Surroundings(
            hysteresis=0.1, saturation=0.1 * device.epsilon_max, creep_per_decade=0.02, creep_first_s=0.1, modes=modes,
            bandwidth_hz=device.amplifier.rate_hz / 2, spread=ActuatorSpread(frequency=0.01),
        )  # fmt: skip
    return around if device.spread is None else around.model_copy(update={"spread": device.spread})


def assumed_of(device: Device) -> tuple[str, ...]:
    """Which values of `surroundings_of` are assumed rather than measured: their names."""
    around, nothing = surroundings_of(device), Surroundings()
    notes = {name: note.assumed for name, note in device.notes.items()}
    whole = notes.get("surroundings", device.surroundings is None)
    return tuple(
        name
        for name in Surroundings.model_fields
        if getattr(around, name) != getattr(nothing, name)
        and notes.get(f"surroundings.{name}", whole)
        and not (name == "spread" and device.spread is not None)
    )
