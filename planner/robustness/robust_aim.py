"""The amplitudes to aim at, so that what spread makes of them is nearest to what is wished."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome, solve

from ..closed_forms.links import drive_for, links_for
from ..margins import WELL_SHARE
from ..operating_point import OperatingPoint, setting_of
from ..targets import AS_WISHED, DotGoal
from .dot_search import DotSearch
from .robust_search import RobustSearch, TradeRow, Trial
from .spread import THRESHOLD, TOLERANCE, FrameTarget, known_spread

__all__ = ["aim_for"]

Floats = NDArray[np.float64]

# Draws that a setting is judged by before it is taken; the frame is judged by others, and more.
JUDGED, SEED = 500, 10
# Of more chains the worst is too rare among the draws that are fitted.
MOST_COPIES = 12
TOL = 1e-10


def aim_for(device: Device, target: Floats, omega: float, chains: int, dots: DotGoal | None = None) -> Floats:
    """Amplitudes whose settings at `omega` have the least expected error from `target`, that of the worst chain.

    They stand for settings within the device's volts, well and range of lam; where lam has bits, for links that can
    be set. Where no such setting is better than the closed form's, `target` itself.

    Parameters
    ----------
    device : with a spread, whose chains are alike (`Device.alone`).
    target : float64, shape (n,), > 0, full scale, for which `links_for` has an answer.
    chains : how many a frame has, each with its own actuators.
    dots : amplitudes are dots, and what is least is the share of devices that do not keep them.

    Returns
    -------
    float64, shape (n,), in units of full scale.
    """
    chain, wanted = device.chain, target * device.full_scale
    wish = FrameTarget(target[None].astype(np.complex128), device.full_scale)
    if dots is not None and dots.loudest <= AS_WISHED:
        return target
    threshold = THRESHOLD if dots is None else dots.threshold
    trial = Trial(chain, wish, known_spread(device), TOLERANCE, threshold, JUDGED, SEED)
    search = (
        RobustSearch(device, trial, trial.spread, min(chains, MOST_COPIES))
        if dots is None
        else DotSearch(device, trial, dots)
    )
    nominal = OperatingPoint(float(drive_for(chain, wanted[:1], omega)[0]), links_for(chain, wanted, omega), omega)
    if not search.fits(nominal):
        return target
    found = [nominal, search.best(nominal)]
    if device.coupling.lam_step and len(nominal.lam):
        found = [search.least(_settable(search, one), free_omega=False, free_lam=False) for one in found]
    best = min(filter(_safe, map(search.row, found)), key=search.cost, default=None)
    if best is None or best.point is nominal:
        return target
    return _standing(device, best.point, target, threshold)


def _safe(row: TradeRow) -> bool:
    return row.well <= WELL_SHARE and row.volts <= 1


def _settable(search: RobustSearch, point: OperatingPoint) -> OperatingPoint:
    """With the nearest links that can be set."""
    coupling, gain = search.device.coupling, search.gain
    steps = np.rint((point.lam / gain - coupling.lam.min) / coupling.lam_step)
    # A link of 0 passes nothing on.
    least = 0 if coupling.lam.min > 0 else 1
    steps = np.clip(steps, least, 2 ** (coupling.bits or 1) - 1)
    return replace(point, lam=(coupling.lam.min + coupling.lam_step * steps) * gain)


def _standing(device: Device, point: OperatingPoint, target: Floats, threshold: float) -> Floats:
    """What settings hold, by harmonic balance; `target` where that is not known, not it, or no way leads there."""
    response = solve(device.chain, setting_of(device.chain, [point]), tol=TOL, rung="harmonic_balance", start="rest")
    if response.outcome[0] is not Outcome.OK or not response.stable[0]:
        return target
    amplitude = np.abs(response.phasor[0])
    # Ways in are planned for the links of the closed form: these must be the same ones.
    again = links_for(device.chain, amplitude, point.omega)
    same = bool(np.all(np.abs(again - point.lam) <= 0.05 * point.lam))
    aim = np.asarray(amplitude / device.full_scale)
    # Where spread is hopeless the least error is that of amplitudes in between, which are no dots any more.
    dots = np.array_equal(aim >= threshold, target >= threshold)
    return aim if same and dots else target
