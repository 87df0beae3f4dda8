"""Errors of the planner, each with the situations in which it is met."""

from __future__ import annotations

__all__ = ["CannotTravel", "ContrastError", "DwellTooShort", "PlanError", "SceneDoesNotFit", "YieldError"]


class PlanError(Exception):
    """Root of everything `planner` raises on purpose.

    Examples
    --------
    >>> from chainsim import load_device
    >>> from encoders import GridShape, Scene
    >>> from planner import PlanError, plan_scene
    >>> try:
    ...     plan_scene(Scene(GridShape(6, 6), ()), load_device("linked-40x96"))
    ... except PlanError as error:
    ...     print(error)
    the scene is laid out for 6 x 6 actuators, linked-40x96 has 40 x 96
    """


class SceneDoesNotFit(PlanError, ValueError):
    """The scene was laid out for another grid than the device has.

    Example: a scene of 6 x 6 planned on a device of 40 x 96.
    """


class DwellTooShort(PlanError, ValueError):
    """A frame is over before its pattern could stand.

    Example: ``--dwell 0.2`` on a device whose frame changes take 0.34 s.
    """


class CannotTravel(PlanError, ValueError):
    """Dots are to travel on a device that cannot change one pattern of them into another.

    Example: ``--presentation scroll`` on a device with one lam per chain and no bias.
    """


class ContrastError(PlanError, ValueError):
    """A contrast between raised and unraised dots that is none.

    Example: ``--contrast 0``.
    """


class YieldError(PlanError, ValueError):
    """A share of devices that is none, or that nothing is known about.

    Example: ``--yield 0.9`` on a device without a spread.
    """
