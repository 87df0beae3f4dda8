"""One chain of coupled oscillators: its steady state at a setting, and at many."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chainsim import Chain, Device, Response, Setting, SettingSweep, solve as solve_chain

__all__ = ["solve", "sweep"]

# Dimensions of each field after those of the settings.
DIMENSIONS = {
    "phasor": ("oscillator",), "third": ("oscillator",), "mean": ("oscillator",), "branch": ("oscillator",),
    "answers": ("oscillator",), "phase_step_deg": ("link",), "multipliers": ("multiplier",),
}  # fmt: skip
AXES = ("epsilon", "lam", "omega")


def solve(chain: Chain, setting: Setting, *, tol: float, rung: str = "auto", start: str = "rest") -> Response:
    """The steady state of a chain, by the cheapest solver that meets a tolerance.

    Parameters
    ----------
    chain : Chain
        What was built.
    setting : Setting
        What is chosen: N settings at once.
    tol : float
        Relative to each setting's largest amplitude.
    rung : str
        ``auto``, ``static``, ``linear``, ``one_harmonic``, ``harmonic_balance``, ``envelope`` or ``ode``.
    start : {"rest", "ramp", "all"}
        A sudden drive, a slow ramp, or every branch.

    Returns
    -------
    chainsim.Response
        `outcome` (N,), `phasor` (N, n) complex128 and dimensionless, `stable` (N,), `error_estimate` (N,) and so on.

    Raises
    ------
    ValueError
        When the setting was made for another chain.
    chainsim.RungError
        When the rung cannot answer.

    Examples
    --------
    >>> import dotwave as dw
    >>> chain = dw.Chain(n=6, delta=5.3006e-3, beta=-1.0)
    >>> found = dw.solve(chain, dw.Setting.of(chain, epsilon=1.175e-3, lam=6.131e-3, omega=1.0), tol=1e-6)
    >>> str(found.outcome[0]), found.phasor.shape
    ('ok', (1, 6))
    """
    return solve_chain(chain, setting, tol=tol, rung=rung, start=start)


def sweep(
    chain: Chain,
    *,
    epsilon: ArrayLike,
    lam: ArrayLike = 0.0,
    omega: ArrayLike = 1.0,
    tol: float = 1e-6,
    from_rest: bool = True,
    as_built: Device | str | None = None,
    devices: int = 64,
    seed: int = 0,
    **fixed: Any,
) -> Any:
    """The steady states of a chain at every combination of some settings.

    Parameters
    ----------
    chain : Chain
        What was built.
    epsilon : float or array, shape (a,)
        Amplitudes of the drive, dimensionless.
    lam : float or array, shape (b,)
        Couplings, dimensionless, each of all links; or of shape (b, links) one for each link.
    omega : float or array, shape (c,)
        Frequencies of the drive over the resonance.
    tol : float
        Relative to each setting's largest amplitude.
    from_rest : bool
        What a sudden drive reaches; else the lower branch, which is quicker.
    as_built : Device or str
        Also ask what chains reach that are drawn with what surrounds this device: `yield`, the share with the same
        outcome, `worst`, the actuator that is farthest off (from 0, -1 where none is known), `deviation`, the median of
        how far over the largest amplitude, and `spoiler`, the effect that alone spoils most. Takes seconds a setting.
    devices : int
        How many are drawn.
    seed : int
        From what they are drawn.
    **fixed
        `preload`, `bias`, `phase` and, of a grid, `lam_y`, as `Setting.of` takes them.

    Returns
    -------
    xarray.Dataset, or dict of arrays where xarray is not installed
        The fields of `dotwave sweep` by their names, each of shape (a, b, c, ...): `outcome` (text), `phasor`, `third`
        (complex128), `mean`, `phase_step_deg`, `multipliers`, `branch`, `answers`, `stable`, `locked` and
        `error_estimate`, and the settings themselves.

    Raises
    ------
    ValueError
        When a shape does not fit, or a number is out of range.
    dotwave.AppError
        When chains of its kind are not drawn.

    Examples
    --------
    >>> import dotwave as dw, numpy as np
    >>> chain = dw.Chain(n=6, delta=5.3006e-3, beta=-1.0)
    >>> omega = np.linspace(0.99, 1.01, 5)
    >>> found = dw.sweep(chain, epsilon=1e-4, lam=6.131e-3, omega=omega)
    >>> found["phasor"].shape, bool(found["stable"].all())
    ((1, 1, 5, 6), True)
    """
    from ..studies.sweep import FIELDS, answers

    columns = _column("epsilon", epsilon, 1), _column("lam", lam, 2), _column("omega", omega, 1)
    wanted = tuple(name for name in FIELDS if name not in AXES)
    shape = tuple(len(column) for column in columns)
    many = SettingSweep(chain, tol, from_rest, columns, shape, {"preload": 0.0, "bias": 0.0, "phase": 0.0} | fixed)
    drawn = None
    if as_built is not None:
        from ..as_built.settings import AS_BUILT_FIELDS, AsBuiltSettings
        from .scenes import device as device_of

        drawn = AsBuiltSettings(device_of(as_built), devices, seed)
        wanted += AS_BUILT_FIELDS
    flat = answers(many, 0, len(many), wanted, drawn)
    arrays = {name: values.reshape(*shape, *values.shape[1:]) for name, values in flat.items()}
    return _named(arrays, dict(zip(AXES, columns, strict=True)))


def _column(name: str, values: ArrayLike, most: int) -> NDArray[np.float64]:
    made = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if made.ndim > most or not len(made):
        raise ValueError(f"{name}: expected a number or a list of numbers, got shape {made.shape}")
    return made.reshape(len(made), -1) if most == 2 else made


def _named(arrays: dict[str, NDArray[Any]], axes: dict[str, NDArray[np.float64]]) -> Any:
    settings = dict(axes)
    if axes["lam"].shape[1] == 1:
        settings["lam"] = axes["lam"][:, 0]
    if find_spec("xarray") is None:
        return arrays | settings
    import xarray

    data = {name: ((*AXES, *DIMENSIONS.get(name, ())), values) for name, values in arrays.items()}
    if settings["lam"].ndim == 2:
        # Links that were chosen one by one are no coordinate of one number.
        data["links"] = (("lam", "link_set"), settings.pop("lam"))
    return xarray.Dataset(data, {name: (name, values) for name, values in settings.items()})
