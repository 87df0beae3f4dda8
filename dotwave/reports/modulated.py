"""What a resonance does to the modulation of its drive, in words."""

from __future__ import annotations

from chainsim import Device, sideband_gain

__all__ = ["modulation_words"]


def modulation_words(device: Device) -> str:
    """One sentence on how a device's carriers swell, and what its resonances let through."""
    beat = device.modulation
    assert beat is not None
    return (
        f"{beat.hz:g} Hz, depth {beat.depth:g}; resonances of Q {1 / device.delta:.0f} are "
        f"{device.delta * device.f0_hz:.0f} Hz wide and leave {sideband_gain(device, beat.hz):.2f} of the depth of a "
        "plain drive at their middle, for which drives make up"
    )
