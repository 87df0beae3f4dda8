"""One chain's settings, judged and improved under spread: the search below `planner.robustness.robust`."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Device

from ..operating_point import OperatingPoint
from .batch_march import BatchMotion, BatchParts, march
from .spread import Draws, FrameTarget, RelativeSpread, SpreadError, SpreadReport, draw, judge

__all__ = ["RobustSearch", "TradeRow", "Trial"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Draws that are minimised over; as many again, with opposite sign, balance them.
FITTED = 128
ITERATIONS = 40
# A change of the expected error, in units of full scale, that is not worth another iteration.
ENOUGH = 1e-4
# Of the first step towards the wish, in logarithms.
AIMING_STEPS, LONGEST_STEP = 12, 0.5
# Links and drives are searched for in logarithms, from this share of their largest value on.
SMALLEST = 1e-6


@dataclass(frozen=True)
class Trial:
    """What a pattern is to be tried for.

    Attributes
    ----------
    chain : the nominal chain: the device's, or what was measured of it.
    wish : of this chain.
    spread : how actuators differ from the nominal ones.
    tolerance : largest error that counts as made;
    threshold : level that parts dots from no dots; units of full scale.
    count : draws that settings are judged by; they are not those that settings are fitted to.
    seed : of all draws.
    """

    chain: Chain
    wish: FrameTarget
    spread: RelativeSpread
    tolerance: float
    threshold: float
    count: int
    seed: int


@dataclass(frozen=True)
class TradeRow:
    """One setting and what it gives.

    Attributes
    ----------
    point : the setting.
    volts : its drive over the amplifier's.
    phasor : complex128, shape (n,), its motion without spread, dimensionless;
    well : largest of it over the hilltop's;
    nominal_error : its error in units of full scale.
    report : under spread.
    """

    point: OperatingPoint
    volts: float
    phasor: Complexes
    well: float
    nominal_error: float
    report: SpreadReport

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        report, point = self.report, self.point
        return {
            "omega": point.omega, "epsilon": abs(point.epsilon), "lam": point.lam.tolist(), "volts": self.volts,
            "well": self.well, "error": self.nominal_error, "expected": report.expected, "median": report.median,
            "quantile_90": report.quantile(0.9), "yield": report.yield_,
        }  # fmt: skip


class RobustSearch:
    """Settings of one chain, judged and improved under one spread.

    `copies` : how many chains such as this one stand side by side; it is the error of the worst that counts.
    """

    def __init__(self, device: Device, trial: Trial, spread: RelativeSpread, copies: int = 1) -> None:
        self.device, self.trial, self.copies, chain = device, trial, copies, trial.chain
        if not chain.feed_forward:
            raise SpreadError(f"robust: settings are searched for in open chains, got {chain.closure}")
        one_sided = draw(chain.n, count=FITTED, seed=trial.seed).normal
        both = Draws(np.concatenate([one_sided, -one_sided], axis=-1))
        self.fitted = both.parts(chain, spread)
        # Another stream of the same seed: what is fitted is not judged by the draws it was fitted to.
        self.judged = draw(chain.n, count=trial.count, seed=trial.seed + 1).parts(chain, spread)
        self.exact = draw(chain.n, count=1, seed=trial.seed).parts(chain, RelativeSpread())
        self.tied = device.coupling.scope in {"fixed", "device", "chain"}
        one = device.chains == 1
        # What each link makes of the lam it is set to; settings here are what links make.
        self.gain = device.lam_gain(0) if one else np.ones(chain.n - 1)

    def fits(self, point: OperatingPoint) -> bool:
        """Whether the device can set it."""
        device, allowed = self.device, self.device.coupling.lam
        in_band = device.omega.min <= point.omega <= device.omega.max
        linked = bool(np.all((point.lam >= allowed.min * self.gain) & (point.lam <= allowed.max * self.gain)))
        return in_band and linked and abs(point.epsilon) <= device.epsilon_max

    def row(self, point: OperatingPoint) -> TradeRow:
        """Judge a setting."""
        trial = self.trial
        exact = self._motion(self.exact, point)
        return TradeRow(
            point=point,
            volts=abs(point.epsilon) / self.device.epsilon_max,
            phasor=exact.phasor[:, 0, 0],
            well=float(np.abs(exact.phasor).max()) / self.device.escape_amplitude,
            nominal_error=float(np.abs(trial.wish.deviation(exact.phasor)).max()),
            report=judge(
                trial.wish, self._motion(self.judged, point), tolerance=trial.tolerance, threshold=trial.threshold
            ),
        )

    def _motion(self, parts: BatchParts, point: OperatingPoint) -> BatchMotion:
        n = self.trial.chain.n
        force = np.zeros((n, 1, 1), dtype=np.complex128)
        force[0] = abs(point.epsilon)
        lam = np.concatenate([[0.0], point.lam])[:, None, None]
        return march(parts, force, lam, point.omega)

    def worst_of(self, error: Floats) -> float:
        """The expected error of the worst of the copies, from errors of one over draws, float64, shape (count,)."""
        return float(self._shares(error) @ error)

    def _shares(self, error: Floats) -> Floats:
        """How likely each draw is that of the worst copy."""
        count = len(error)
        if self.copies == 1:
            return np.full(count, 1 / count)
        shares = np.empty(count)
        shares[np.argsort(error)] = np.diff((np.arange(count + 1) / count) ** self.copies)
        return shares

    def cost(self, row: TradeRow) -> float:
        """What settings are compared by: less is better."""
        return self.worst_of(row.report.error)

    def best(self, start: OperatingPoint) -> OperatingPoint:
        """The setting at the frequency of `start` that costs least near it."""
        return self.least(start, free_omega=False)

    def least(self, start: OperatingPoint, *, free_omega: bool, free_lam: bool = True) -> OperatingPoint:
        """The setting with the least expected error near `start`, within what the device can set."""
        from scipy.optimize import minimize

        low, top = self._bounds(start, free_omega)
        first = np.clip(self._logs(start), low, top)
        if not free_lam:
            low[1:-1] = top[1:-1] = first[1:-1]
        first = min(first, np.clip(self._aimed(first, start), low, top), key=lambda x: self._expected(x, start)[0])
        with warnings.catch_warnings():
            # The search may leave its bounds by a rounding, says so, and goes back.
            warnings.filterwarnings("ignore", message="Values in x were outside bounds", category=RuntimeWarning)
            found = minimize(
                self._expected, first, args=(start,), jac=True, method="SLSQP",
                bounds=list(zip(low, top, strict=True)), options={"maxiter": ITERATIONS, "ftol": ENOUGH},
            )  # fmt: skip
        last = np.clip(found.x, low, top)
        best = self._point(min(first, last, key=lambda x: self._expected(x, start)[0]), start)
        # Logarithms do not give back exactly what they were given.
        return best if free_lam else replace(best, lam=start.lam)

    def _bounds(self, start: OperatingPoint, free_omega: bool) -> tuple[Floats, Floats]:
        """What the device can set: logarithms of drive and links, and the frequency."""
        device, span = self.device, self.device.coupling.lam
        gain = self.gain[: len(self._logs(start)) - 2]
        top = np.log([device.epsilon_max, *(span.max * gain)])
        low = np.log(np.maximum([0.0, *(span.min * gain)], np.exp(top) * SMALLEST))
        band = (device.omega.min, device.omega.max) if free_omega else (start.omega, start.omega)
        return np.append(low, band[0]), np.append(top, band[1])

    def _logs(self, point: OperatingPoint) -> Floats:
        """A setting as the search sees it; where a lam belongs to a whole chain there is one of them."""
        lam = point.lam[: 1 if self.tied else len(point.lam)]
        with np.errstate(divide="ignore"):
            return np.array([*np.log([abs(point.epsilon), *lam]), point.omega])

    def _point(self, x: Floats, like: OperatingPoint) -> OperatingPoint:
        return OperatingPoint(float(np.exp(x[0])), np.exp(np.broadcast_to(x[1:-1], like.lam.shape)), float(x[-1]))

    def _aimed(self, x: Floats, like: OperatingPoint) -> Floats:
        """Drive and links whose motion without spread is nearest to the wish, by Gauss and Newton's method."""
        for _ in range(AIMING_STEPS):
            deviation, slopes = self._judged(self.exact, x, like)
            step = np.linalg.lstsq(slopes[:, :-1, 0, 0], -deviation[:, 0, 0])[0]
            x = x + np.append(np.clip(step, -LONGEST_STEP, LONGEST_STEP), 0.0)
        return x

    def _expected(self, x: Floats, like: OperatingPoint) -> tuple[float, Floats]:
        """Expected error over the fitted draws, and its gradient."""
        deviation, slopes = self._judged(self.fitted, x, like)
        worst = np.argmax(np.abs(deviation), axis=0)[None]
        error = np.take_along_axis(deviation, worst, axis=0)
        at_worst = np.take_along_axis(slopes, worst[:, None], axis=0)[0] * np.sign(error)
        size = np.abs(error).ravel()
        shares = self._shares(size)
        return float(shares @ size), at_worst.reshape(len(at_worst), -1) @ shares

    def _judged(self, parts: BatchParts, x: Floats, like: OperatingPoint) -> tuple[Floats, Floats]:
        """Deviations, shape (n, 1, draws), and their derivatives by `x`, shape (n, D, 1, draws)."""
        point = self._point(x, like)
        motion = self._motion(parts, point)
        slopes = self.trial.wish.slope(motion.phasor, motion.tangent(_own(motion.phasor, parts, point)))
        if self.tied and len(point.lam):
            slopes = np.stack([slopes[:, 0], slopes[:, 1:-1].sum(axis=1), slopes[:, -1]], axis=1)
        return self.trial.wish.deviation(motion.phasor), slopes


def _own(phasor: Complexes, parts: BatchParts, point: OperatingPoint) -> Complexes:
    """Derivative of each oscillator's balance by log epsilon, every log lam, and omega, at fixed phasors."""
    n = len(phasor)
    own = np.zeros((n, n + 1, *phasor.shape[1:]), dtype=np.complex128)
    own[0, 0] = abs(point.epsilon)
    for m in range(1, n):
        own[m, m] = point.lam[m - 1] * parts.lam_gain[m] * (phasor[m - 1] - phasor[m])
    own[:, n] = (2 * point.omega - 1j * parts.delta) * phasor
    return own
