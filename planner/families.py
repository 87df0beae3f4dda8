"""Which way of making amplitude patterns a device gets."""

from __future__ import annotations

from collections.abc import Sequence

from chainsim import Closure, Device

from .strategy import Strategy

__all__ = ["strategy_for"]


def strategy_for(
    device: Device, contrast_db: float, kinds: Sequence[Device] = (), whole: Strategy | None = None
) -> Strategy | None:
    """The strategy for amplitude patterns that `device` offers most with; None where it has none for any pattern.

    A bias per actuator makes any pattern statically; a lam per link, or no coupling at all, any pattern by
    vibration; anything else makes only waves.

    Parameters
    ----------
    kinds : the chains of a device whose chains have numbers of their own, each as a device. whole : the strategy of
        such a device when `device` is one of them.
    """
    if device.bias == "actuator":
        from .amplitudes.deflection import Deflection

        return Deflection(device)
    if device.chain_length == 1 or (device.coupling.scope == "link" and device.coupling.closure is Closure.OPEN):
        from .amplitudes.vibration import Vibration

        return Vibration(device, contrast_db, kinds, whole if isinstance(whole, Vibration) else None)
    return None
