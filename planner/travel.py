"""How fast patterns can travel on a device."""

from __future__ import annotations

from chainsim import Device

from .families import family_of, row_of
from .family import AmplitudeFamily
from .scene_plan import DEFAULT_CONTRAST_DB
from .targets import AmplitudeTarget

__all__ = ["quickest_travel"]


def quickest_travel(device: Device, *, contrast_db: float | None = None) -> float | None:
    """Most patterns that follow each other in a second where they travel: columns of a text, places of a dot.

    Parameters
    ----------
    contrast_db : between raised and unraised dots, where chains vibrate; None: `DEFAULT_CONTRAST_DB`.

    Returns
    -------
    None where dots cannot travel at all (`CannotTravel`).
    """
    contrast_db = DEFAULT_CONTRAST_DB if contrast_db is None else contrast_db
    family = family_of(row_of(AmplitudeTarget, device), device, contrast_db)
    return 1 / family.shortest_s if isinstance(family, AmplitudeFamily) else None
