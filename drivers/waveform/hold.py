"""What undoes the straight lines an amplifier draws from sample to sample."""

from __future__ import annotations

import math

__all__ = ["hold_inverse"]


def hold_inverse(omega: float, dtau: float) -> tuple[float, float]:
    """How an envelope on a carrier has to be raised before it is sampled, so that a first-order hold gives it back.

    Straight lines between samples pass the carrier with ``H = sinc^2(omega dtau / 2)`` and an envelope E on
    it as ``H E - i H' E'``; so ``E / H + i (H' / H^2) E'`` has to be sampled. The little that is lost
    otherwise (0.04 % at 135 samples a period) a chain of resonators magnifies.

    Parameters
    ----------
    omega : drive frequency over f0. dtau : tau from sample to sample; omega dtau < pi.

    Returns
    -------
    1/H, and H'/H^2 in tau.
    """
    y = omega * dtau / 2
    sinc = math.sin(y) / y
    slope = dtau * sinc * (y * math.cos(y) - math.sin(y)) / y**2
    return 1 / sinc**2, slope / sinc**4
