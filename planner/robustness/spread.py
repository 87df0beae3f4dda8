"""What manufacturing spread makes of a pattern: error, quantiles and yield over many draws of the actuators."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Closure, Device

from ..errors import PlanError
from ..operating_point import OperatingPoint
from .batch_march import BatchMotion, BatchParts, march

__all__ = [
    "THRESHOLD",
    "TOLERANCE",
    "Draws",
    "FrameTarget",
    "RelativeSpread",
    "SpreadError",
    "SpreadReport",
    "centre_of",
    "draw",
    "drawn_in",
    "frame_target",
    "judge",
    "known_spread",
    "motion_of",
    "spread_of",
]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


# Largest error that counts as made, and the level that parts dots from no dots, in units of full scale.
TOLERANCE, THRESHOLD = 0.2, 0.5


class SpreadError(PlanError, ValueError):
    """Spread cannot be evaluated as asked.

    Examples: a negative standard deviation; a chain that is a ring or a grid; a state that is driven and biased, or
    has several tones.
    """


@dataclass(frozen=True)
class RelativeSpread:
    """Standard deviations from actuator to actuator, each relative to the nominal value; independent and normal.

    f0 : natural frequency. delta : damping. beta : cubic term. lam : what a link makes of the lam it is set to.

    Raises
    ------
    SpreadError
        When one is negative or not finite.
    """

    f0: float = 0.0
    delta: float = 0.0
    beta: float = 0.0
    lam: float = 0.0

    def __post_init__(self) -> None:
        for name in ("f0", "delta", "beta", "lam"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise SpreadError(f"spread.{name}: expected a relative standard deviation >= 0, got {value}")

    def scaled(self, factor: float) -> RelativeSpread:
        """All four times `factor`."""
        return RelativeSpread(self.f0 * factor, self.delta * factor, self.beta * factor, self.lam * factor)


def known_spread(device: Device) -> RelativeSpread:
    """What the profile says of its actuators' spread; none where it says nothing."""
    told = device.spread
    return RelativeSpread() if told is None else RelativeSpread(told.frequency, told.damping, told.beta, told.lam)


@dataclass(frozen=True)
class Draws:
    """Standard normal numbers, one for each actuator and what it differs in; the same draws serve every spread.

    normal : float64, shape (4, n, chains, count): f0, delta, beta, lam.
    """

    normal: Floats

    def parts(self, chain: Chain, spread: RelativeSpread, gain: Floats | None = None) -> BatchParts:
        """The chains drawn, around the numbers of `chain`: arrays of shape (n, chains, count).

        `gain` : float64, shape (n-1,), what links make of the lam they are set to, where that is known.

        A factor of f0, delta or lam is ``1 + sigma x``; one that would be below a hundredth of the nominal value
        counts as that hundredth, so that no draw changes sign.

        Raises
        ------
        SpreadError
                For a grid, or links that act both ways: their spread is not judged.
        """
        if chain.closure is Closure.BIDIRECTIONAL or chain.rows > 1:
            raise SpreadError(f"spread: not judged in {chain.law.name}s; leave spread out of the device")
        f0, delta, beta, lam = self.normal
        return BatchParts(
            stiffness=_column(chain.stiffness) * _positive(1 + spread.f0 * f0) ** 2,
            delta=_column(chain.deltas) * _positive(1 + spread.delta * delta),
            beta=_column(chain.betas) * (1 + spread.beta * beta),
            lam_gain=_positive(1 + spread.lam * lam) * _column(np.append(1.0, [] if gain is None else gain)),
        )


def _column(values: Floats) -> Floats:
    return values[:, None, None]


def _positive(factor: Floats) -> Floats:
    return np.maximum(factor, 0.01)


def draw(n: int, *, count: int, seed: int | Sequence[int], chains: int = 1) -> Draws:
    """`count` draws of `chains` chains of n actuators; the same for the same seed."""
    return Draws(_normal(n, count, seed if isinstance(seed, int) else tuple(seed), chains))


# A frame's chains in their places, as drawn for every part of the spread that is tried.
@lru_cache(maxsize=64)
def _normal(n: int, count: int, seed: int | tuple[int, ...], chains: int) -> Floats:
    normal = np.random.default_rng(seed).standard_normal((4, n, chains, count))
    normal.flags.writeable = False
    return normal


@dataclass(frozen=True)
class FrameTarget:
    """What the chains of a frame are to make felt.

    Attributes
    ----------
    amplitude : complex128, shape (chains, n), in units of full scale.
    full_scale : dimensionless amplitude of 1.
    phase_matters : whether the arguments of `amplitude` are part of the wish; bool, or of shape (chains, n).
    weight : float64, shape (chains, n), of each deviation; 0 = don't care. None: 1 everywhere.
    group : int, shape (chains,); a phase that chains of one number have in common makes no difference. None: all are
        of one group.
    """

    amplitude: Complexes
    full_scale: float
    phase_matters: bool | NDArray[np.bool_] = False
    weight: Floats | None = None
    group: NDArray[np.intp] | None = None

    def weights(self) -> Floats:
        """Weights as an array, float64, shape (n, chains, 1)."""
        weight = np.ones(self.amplitude.shape) if self.weight is None else self.weight
        return np.asarray(weight.T[:, :, None])

    def deviation(self, phasor: Complexes) -> Floats:
        """How far motions are off, in units of full scale; signed (too strong is > 0) where phase does not matter.

        Parameters
        ----------
        phasor : complex128, shape (n, chains, count), dimensionless.
        """
        wanted, felt = self._turned(phasor), phasor / self.full_scale
        return self.weights() * np.where(self._cares(), np.abs(felt - wanted), np.abs(felt) - np.abs(wanted))

    def slope(self, phasor: Complexes, change: Complexes) -> Floats:
        """Derivatives of `deviation` when the motions change; float64, shape (n, D, chains, count).

        Parameters
        ----------
        change : complex128, shape (n, D, chains, count), derivatives of the phasors in D directions.
        """
        wanted, felt, cares = self._turned(phasor), phasor / self.full_scale, self._cares()
        rate = change / self.full_scale
        along = cares * self.weights() * np.conj(wanted)
        common, turning = self._shared(along * felt), self._shared(along[:, None] * rate)
        with np.errstate(invalid="ignore", divide="ignore"):
            turn = np.where(common == 0, 0.0, np.imag(turning / common))
            off = np.where(cares, felt - wanted, felt)
            direction = np.where(off == 0, 1.0, off / np.abs(off))
        rate = rate - 1j * (cares * wanted)[:, None] * turn
        return self.weights()[:, None] * np.real(np.conj(direction)[:, None] * rate)

    def _cares(self) -> NDArray[np.bool_]:
        """Where phase matters; bool, shape (n, chains, 1)."""
        return np.broadcast_to(self.phase_matters, self.amplitude.shape).T[:, :, None]

    def _shared(self, values: Complexes) -> Complexes:
        """Sums over the actuators of each chain's group; from shape (n, ..., chains, count) to (..., chains, count)."""
        chains = len(self.amplitude)
        group = np.zeros(chains, dtype=np.intp) if self.group is None else self.group
        return np.asarray((group[:, None] == group).astype(np.complex128) @ values.sum(axis=0))

    def _turned(self, phasor: Complexes) -> Complexes:
        """What is wanted, turned by the phase it shares with the motion; complex128, shape (n, chains, count)."""
        wanted: Complexes = self.amplitude.T[:, :, None]
        common = self._shared(self._cares() * self.weights() * np.conj(wanted) * phasor)
        return np.asarray(wanted * np.exp(1j * np.angle(common)))


@dataclass(frozen=True)
class SpreadReport:
    """What a frame becomes over the draws.

    Attributes
    ----------
    error : float64, shape (count,), worst weighted deviation of an actuator in units of full scale.
    right : bool, shape (count,), every actuator that matters is on its side of the dot threshold, and none escapes.
    tolerance : the largest error that counts as made.
    """

    error: Floats
    right: NDArray[np.bool_]
    tolerance: float

    @property
    def expected(self) -> float:
        """Mean error."""
        return float(self.error.mean())

    @property
    def median(self) -> float:
        """Median error."""
        return self.quantile(0.5)

    @property
    def yield_(self) -> float:
        """Share of draws that have every dot right and an error within the tolerance."""
        return float(np.mean(self.right & (self.error <= self.tolerance)))

    def quantile(self, share: float) -> float:
        """The error that this share of the draws does not exceed."""
        return float(np.quantile(self.error, share))


def judge(wish: FrameTarget, motion: BatchMotion, *, tolerance: float, threshold: float) -> SpreadReport:
    """Compare motions of shape (n, chains, count) with a wish; `threshold` parts dots from no dots."""
    deviation = wish.deviation(motion.phasor)
    wanted = np.abs(wish.amplitude.T[:, :, None]) >= threshold
    present = np.abs(motion.phasor) / wish.full_scale >= threshold
    # A level wanted near the threshold may be felt on either side of it.
    fine = (wanted == present) | (wish.weights() == 0) | (np.abs(deviation) <= tolerance)
    right = np.all(fine, axis=(0, 1)) & ~np.any(motion.escaped, axis=0)
    error = np.abs(deviation).max(axis=(0, 1))
    error.flags.writeable = right.flags.writeable = False
    return SpreadReport(error, right, tolerance)


def frame_target(device: Device, states: Sequence[OperatingPoint]) -> FrameTarget:
    """What planned states were planned for; chains at one frequency share their phase."""
    target = np.array([state.target for state in states])
    phase = np.array([np.full(len(state.target), np.nan) if state.phase is None else state.phase for state in states])
    matters = np.isfinite(phase)
    _, group = np.unique([state.omega for state in states], return_inverse=True)
    return FrameTarget(target * np.exp(1j * np.where(matters, phase, 0.0)), device.full_scale, matters, group=group)


def motion_of(states: Sequence[OperatingPoint], parts: BatchParts, ring: BatchParts | None = None) -> BatchMotion:
    """What chains do when each holds its state: `parts` of shape (n, chains, count).

    `ring` : where they are rings, the ones they are drawn around, of shape (n, chains, 1).

    Raises
    ------
    SpreadError
        When a state has a drive and a bias at once, or states held by a drive stand beside states held by a bias, or
        a state has several tones, or a ring with links is held by a bias.
    """
    if any(state.tones for state in states):
        raise SpreadError("spread: expected states of one tone, got more; judge the tones apart")
    bias = np.array([state.bias for state in states]).T[:, :, None]
    epsilon = np.array([[state.epsilon] for state in states])
    first = [state.lam[:1] if ring is not None and len(state.lam) else np.zeros(1) for state in states]
    lam = np.array([np.concatenate([one, state.lam]) for one, state in zip(first, states, strict=True)]).T[:, :, None]
    if np.any(bias) and np.any(epsilon):
        raise SpreadError("spread: expected states held by a drive or by biases, got both in one frame")
    force = bias.astype(np.complex128)
    if not np.any(bias):
        force[0] = epsilon
    omega = np.array([[state.omega] for state in states]) * float(not np.any(bias))
    if ring is None or not np.any(lam):
        return march(parts, force, lam, omega)
    if np.any(bias):
        raise SpreadError("spread: a deflection of coupled rings is not judged; set coupling.lam.min to 0")
    from .ring_march import march_ring

    near = np.array([state.phasor for state in states]).T[:, :, None]
    return march_ring(parts, ring, force, lam, omega, near)


def centre_of(device: Device, places: Sequence[int]) -> BatchParts:
    """Chains as they are known, without what spread makes of them; arrays of shape (n, places, 1)."""
    return drawn_in(device, RelativeSpread(), places, count=1, seed=0)


def drawn_in(device: Device, spread: RelativeSpread, places: Sequence[int], *, count: int, seed: int) -> BatchParts:
    """Chains drawn in their places, row by row, chain by chain; arrays of shape (n, places, count).

    A place has its own stream of the seed, so that its draws do not depend on the other places asked for.
    """
    found = []
    for i in places:
        place = divmod(i, device.chains_per_row)
        draws = draw(device.chain_length, count=count, seed=(seed, i))
        found.append(draws.parts(device.chain_at(*place), spread, device.lam_gain(*place)))
    return BatchParts(
        *(np.concatenate([getattr(one, field.name) for one in found], axis=1) for field in fields(BatchParts))
    )


def spread_of(
    device: Device,
    states: Sequence[OperatingPoint],
    spread: RelativeSpread,
    *,
    tolerance: float,
    threshold: float,
    count: int = 1000,
    seed: int = 0,
) -> SpreadReport:
    """The error and the yield of one frame, all its chains together.

    Parameters
    ----------
    states : what each chain holds, as in `FramePlan.states`; their `target` and `phase` are what is wanted.
    tolerance : largest error that counts as made, in units of full scale.
    threshold : the level that parts dots from no dots, in the same units.

    Raises
    ------
    SpreadError
        For states as in `motion_of`.
    """
    wish = frame_target(device, states)
    parts = draw(device.chain_length, count=count, seed=seed, chains=len(states)).parts(device.chain, spread)
    ring = (
        None
        if device.chain.feed_forward
        else draw(device.chain_length, count=1, seed=0).parts(device.chain, RelativeSpread())
    )
    return judge(wish, motion_of(states, parts, ring), tolerance=tolerance, threshold=threshold)
