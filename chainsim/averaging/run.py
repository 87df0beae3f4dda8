"""The slow flow of a batch under drives that stand or are ramped, each setting with as many steps as it needs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..equations.chain import Chain, Setting
from ..rung import Start
from .envelope import EnvelopeError, hilltop
from .flow import SlowFlow
from .linear import exponential, inverse, times
from .steps import Course, SlowStretch, advance

__all__ = ["COARSE", "FINE", "LOOK", "ORDER", "Run"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Lanes = NDArray[np.int64]

ORDER = 2
LOOK = 2.0  # Time between two looks, in units of 1/delta: one e-fold.
RAMP = 100.0  # Length of the ramp, in units of 1/delta.
# A step h errs by about nu (sigma + nu)^4 h^5 times a number near 1/500, with sigma and nu the rates of the linear part
# and of the cubic term. This is what nu (sigma + nu)^4 h^5 may be where a fixed point is to be hit (to about 3e-5),
FINE = 10.0
COARSE = 30.0  # and where steps only have to find the basin.
MOST_STEPS = 8192  # Steps between two looks; a setting that needs more is out of budget at once.
FIRST_GUESS = 0.2  # Of the hilltop, for the amplitude the first steps are made for, where the linear one is larger.
SOFTEST = 0.3  # Stiffness about the equilibrium below which nothing is slow.


class Run:
    """N settings on their way; arrays have the leading axis N.

    Attributes
    ----------
    flow, drive : what moves them.
    slow : complex128, shape (N, n), slow parts.
    top : float64, shape (N, n), hilltops.
    peak : float64, shape (N, n), the largest amplitude seen.
    payable : the settings that can be followed.
    spent : bool, shape (N,), where the longest budget of steps did not do.
    steps : int64, shape (N,), steps taken between two looks.
    look : tau between two looks.
    evals : work done.
    """

    def __init__(self, chain: Chain, setting: Setting, care: float, load: Floats | float = 1.0) -> None:
        size, n = len(setting), setting.n
        self._beta = np.abs(chain.betas)
        self.flow = SlowFlow.of(chain, setting, setting.lam, ORDER)
        self.drive: Complexes = load * setting.epsilon * np.exp(1j * setting.phase)
        self.top = hilltop(chain, setting, setting.lam)
        if self.flow.lean is not None:
            self.top = self.top - np.abs(self.flow.lean.place)
        self.look = LOOK / float(chain.deltas.min())
        self.slow = np.zeros((size, n), dtype=np.complex128)
        self.peak = np.zeros((size, n))
        self.evals = 0
        self._back = inverse(self.flow.rate)
        self._loaded = -times(self._back @ self.flow.weight, np.eye(n)[0] * self.drive[:, None])
        self._follows = self._loaded.copy()
        self._lags = times(self._back, self._loaded)
        self._half = np.empty_like(self._back)
        self._made = np.zeros(size, dtype=np.int64)
        self._linear = np.abs(self.flow.rate).sum(axis=2).max(axis=1)
        self._held = np.zeros_like(self.slow)
        self._bend, self._care = _bend(self.flow), care
        guess = np.minimum(np.abs(self._follows), FIRST_GUESS * self.top)
        self.steps = np.minimum(self._needed(np.arange(size), np.nan_to_num(guess**2)), MOST_STEPS)
        self.spent = np.zeros(size, dtype=bool)
        known = np.isfinite(self._follows).all(axis=1) & np.isfinite(self._linear) & (self.flow.firm > SOFTEST)
        self.payable: Lanes = np.flatnonzero(known)

    def begin(self, start: Start | ArrayLike) -> None:
        """Set the state at the first look: at rest, after a ramp, or at given amplitudes.

        Raises
        ------
        EnvelopeError
            When `start` is none of these.
        """
        if isinstance(start, str):
            if Start(start) is Start.ALL:
                raise EnvelopeError("start: expected rest, ramp or amplitudes, got all; use rung harmonic_balance")
            if Start(start) is Start.REST:
                self.slow = self.flow.at_rest(self.drive, self.flow.lam)
            else:
                looks = int(RAMP / LOOK)
                for k in range(looks):
                    self.advance(self.payable, k / looks, (k + 1) / looks)
            return
        amplitude = np.asarray(start, dtype=np.complex128)
        if amplitude.shape not in (self.slow.shape, self.slow.shape[1:]) or not np.isfinite(amplitude).all():
            raise EnvelopeError(f"start: expected finite amplitudes of shape {self.slow.shape}, got {amplitude.shape}")
        self.slow = self.flow.slow_part(np.broadcast_to(amplitude, self.slow.shape), self.drive, self.flow.lam)

    def hold(self, lanes: Lanes, amplitude: Complexes, calm: NDArray[np.bool_]) -> None:
        """Follow `lanes` from now on with the cubic terms of their oscillators that are `calm` held at `amplitude`.

        Steps integrate only what the cubic terms differ from that, so they rest where the flow does, whatever their
        length. Else each change of the steps, made for a chain's end, would move its settled head by its own error, and
        the chain would magnify that into the next change.

        Parameters
        ----------
        amplitude : complex128, shape (len, n).
        calm : bool, shape (len, n).
        """
        flow = self.flow.pick(lanes)
        self._held[lanes] = times(flow.weight, np.where(calm, flow.cubic(amplitude), 0.0))
        self._follows[lanes] = self._loaded[lanes] + times(self._back[lanes], self._held[lanes])

    def amplitude(self, lanes: Lanes) -> Complexes:
        """Amplitudes of `lanes`, shape (len, n)."""
        flow = self.flow.pick(lanes)
        return flow.amplitude(self.slow[lanes], self.drive[lanes], flow.lam)

    def strength(self, lanes: Lanes) -> Floats:
        """Largest |beta| a^2 that `lanes` have seen; float64, shape (len,)."""
        strength: Floats = (self._beta * self.peak[lanes] ** 2).max(axis=1)
        return np.where(self._beta.any(), np.nan_to_num(strength, nan=np.inf), 0.0)

    def skew(self, lanes: Lanes) -> Floats:
        """Largest 3 |beta z0| a that `lanes` have seen beside their equilibria; float64, shape (len,)."""
        if self.flow.lean is None:
            return np.zeros(len(lanes))
        skew: Floats = (np.abs(self.flow.lean.kappa[lanes]) * self.peak[lanes]).max(axis=1)
        return skew

    def advance(self, lanes: Lanes, start: float = 1.0, end: float = 1.0, most: int | None = None) -> None:
        """Move `lanes` to their next look while the drive goes from `start` to `end` of its value.

        A motion that turned out to need more steps than it got is taken again, with at most `most` (or `MOST_STEPS`).
        """
        most = MOST_STEPS if most is None else most
        self.steps[lanes] = np.minimum(self.steps[lanes], most)
        while len(lanes):
            counts, again = self.steps[lanes], []
            for count in np.unique(counts):
                again.append(self._stretch(lanes[counts == count], int(count), (start, end), most))
            lanes = np.concatenate(again)

    def samples(self, lanes: Lanes, looks: int) -> Complexes:
        """Amplitudes on the way over some looks, shape (K, len, n); all of `lanes` must take the same `steps`."""
        kept: list[Complexes] = []
        for _ in range(looks):
            count = int(self.steps[lanes[0]])
            found = self._go(lanes, count, (1.0, 1.0), keep=True)
            self.slow[lanes] = found.slow
            kept += found.kept
        return np.stack(kept)

    def _stretch(self, lanes: Lanes, count: int, share: tuple[float, float], most: int) -> Lanes:
        """One look of `lanes` by `count` steps; returns those for which they were too few."""
        found = self._go(lanes, count, share, keep=False)
        # NaN is larger than everything.
        square = np.nan_to_num(found.peak, nan=np.inf)
        needed = self._needed(lanes, square)
        good = (needed <= count) | (count >= most)
        self.spent[lanes] = good & (needed > count)
        self.slow[lanes[good]] = found.slow[good]
        self.peak[lanes[good]] = np.maximum(self.peak[lanes[good]], np.sqrt(square[good]))
        # Steps that were far too long exaggerate what is needed.
        self.steps[lanes] = np.minimum(needed, np.where(good, most, min(8 * count, most)))
        return lanes[~good]

    def _go(self, lanes: Lanes, count: int, share: tuple[float, float], keep: bool) -> SlowStretch:
        h = self.look / count
        stale = lanes[self._made[lanes] != count]
        if len(stale):
            self._half[stale] = exponential(self.flow.rate[stale] * (0.5 * h))
            self._made[stale] = count
        pace = (share[1] - share[0]) / self.look
        lags = self._lags[lanes] if pace else None
        course = Course(self._follows[lanes], self._held[lanes], lags, share[0], pace)
        self.evals += 4 * count * self.slow[lanes].size
        flow = self.flow.pick(lanes)
        return advance(flow, self.slow[lanes], self.drive[lanes], course, self._half[lanes], h, count, keep)

    def _needed(self, lanes: Lanes, square: Floats) -> Lanes:
        """Steps to the next look for motions that reach |A|^2 = `square`, a power of two."""
        bend = (self._bend[lanes] * square).max(axis=1)
        rate = np.where(bend > 0, (bend * (self._linear[lanes] + bend) ** 4 / self._care) ** 0.2, 0.0)
        count = np.nan_to_num(self.look * rate, nan=np.inf)
        return np.exp2(np.ceil(np.log2(np.clip(count, 1.0, 2.0 * MOST_STEPS)))).astype(np.int64)


def _bend(flow: SlowFlow) -> Floats:
    """Largest rate of the cubic term over |A|^2; float64, shape (N, n)."""
    each = np.arange(flow.lam.shape[1])
    strength = np.broadcast_to(2.25 * np.abs(flow.beta), flow.lam.shape)
    if flow.lean is not None:
        slaved = np.abs(flow.lean.mean).sum(axis=2) + np.abs(flow.lean.second).sum(axis=2)
        strength = strength + 1.5 * flow.lean.kappa**2 * slaved
    bend: Floats = np.abs(flow.weight[:, each, each]) * strength
    return bend
