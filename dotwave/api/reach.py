"""What a device can make."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .scenes import USUAL_DEVICE, AnyDevice, device as device_of

if TYPE_CHECKING:
    from ..studies.reach import ReachReport

__all__ = ["reach"]


def reach(device: AnyDevice = USUAL_DEVICE, *, spread: float | None = None) -> ReachReport:
    """Plan a few patterns of every kind on a device: which it makes, how fast, how surely and at what drive.

    Parameters
    ----------
    device : str, path, mapping or Device
        As `dotwave.device` takes it.
    spread : float, optional
        Relative standard deviation of natural frequencies: then the yield of every kind is told, too.

    Returns
    -------
    dotwave.studies.reach.ReachReport
        With `rows`, `waves`, `as_text()` and `as_dict()`.

    Raises
    ------
    dotwave.AppError, chainsim.ChainError
        When there is no such device, or the spread is none.

    Examples
    --------
    >>> import dotwave as dw
    >>> found = dw.reach("independent-6x6")
    >>> found.rows[0].kind, found.rows[0].made
    ('dots', 2)
    """
    from ..studies.reach import reach_of

    return reach_of(device_of(device), spread)
