"""Whether an answer is surely the one a sudden drive from rest reaches: by bounds, else by the envelope."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..averaging.decide import FEW, MOST_DECIDED, decide
from ..equations.chain import Chain, Setting, Spread
from ..equations.scaled_chain import ScaledChain
from ..floquet.monodromy import MOST_JOINT, rest_matrix
from ..harmonic_balance.march import cubic_of, oscillator
from ..model.response import Response
from ..rung import Start

__all__ = ["sure_from_rest"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Of the hilltop, for the transient's peak. Below it the restoring force keeps two thirds of its linear value.
WELL = 0.6
# Of the amplitude where the lower branch folds, for the transient's peak: the saddle is beyond the fold.
FOLD = 0.6
# How near, as a ratio of forces squared, the single-harmonic folds may be before "one answer" is doubted.
NEAR = 1.25
# Distance, relative to each oscillator, within which the slow flow's answer is the one in question.
SAME = 0.05


def sure_from_rest(chain: Chain, setting: Setting, response: Response) -> Bools:
    """Whether the steady `response` is the one reached from z = z' = 0; bool, shape (N,).

    Surely by bounds: the answer is stable, the peak of the start-up transient (bounded as if linear) stays well inside
    the softening well, and every oscillator with more than one answer keeps well below its fold. Else the envelope
    follows the chain as far as that is not so. A False is no verdict, it asks for an integration.
    """
    scaled = ScaledChain.of(chain, setting)
    sure: Bools
    with np.errstate(all="ignore"):
        if not scaled.law.in_line:
            sure = response.stable & _contracting(scaled, response)
            depth = np.where(sure, 0, scaled.n).astype(np.int64)
        else:
            depth = _depth(scaled, response)
            sure = np.asarray(response.stable & (depth == 0), dtype=np.bool_)
    known = response.stable & np.isfinite(response.phasor).all(axis=1) & (np.abs(response.phasor) > 0).all(axis=1)
    asked = ~sure & known & (depth <= MOST_DECIDED)
    if np.count_nonzero(asked) <= FEW:
        # Calls cost more than arithmetic: all are followed together, as far as the deepest.
        depth[asked] = depth[asked].max(initial=0)
    for count in np.unique(depth[asked]):
        lanes = np.flatnonzero(asked & (depth == count))
        sure[lanes] = _followed(chain, setting[lanes], int(count), response.phasor[lanes])
    return sure


def _depth(scaled: ScaledChain, response: Response) -> NDArray[np.int64]:
    """How many oscillators from the head a chain has to the last that no bound decides; int64, shape (N,)."""
    size = np.abs(response.phasor.T) * scaled.length
    mean = np.abs(response.mean.T) * scaled.length
    peak = _peaks(scaled, size + mean) + size + mean
    top = np.sqrt(np.maximum(scaled.k, 0.0) / np.where(scaled.sign < 0, -scaled.sign, 1.0))
    top[np.broadcast_to(scaled.sign >= 0, top.shape)] = 1.0
    depth = np.zeros(len(scaled), dtype=np.int64)
    for m in range(scaled.n):
        sure = (peak[m] < WELL * top[m]) & _alone_or_low(scaled, response, m, peak[m])
        depth[~sure] = m + 1
    return depth


def _followed(chain: Chain, setting: Setting, count: int, phasor: NDArray[np.complex128]) -> Bools:
    """Whether the envelope of the first `count` oscillators surely reaches `phasor`, shape (N, n)."""
    if count < chain.n:
        spread = chain.spread
        if spread is not None:
            spread = Spread(spread.delta[:count], spread.beta[:count], spread.stiffness[:count])
        chain = Chain(count, chain.delta, chain.beta, kind=chain.kind, spread=spread)
        setting = Setting(
            setting.epsilon, setting.lam[:, :count], setting.omega, setting.preload, setting.bias[:, :count],
            setting.phase,
        )  # fmt: skip
    decision = decide(chain, setting, Start.REST)
    wanted = phasor[:, :count]
    here = np.abs(decision.phasor - wanted) <= SAME * np.abs(wanted)
    settled: Bools = np.logical_and.reduce(here, axis=1) & decision.sure
    return settled


def _contracting(scaled: ScaledChain, response: Response) -> Bools:
    """Whether every motion from rest ends in one orbit, the one of `response`; bool, shape (N,).

    With g the largest response of |z| to any force of size 1 without the cubic term, |z| <= R with R = g F + g R^3, and
    two motions within R approach each other while 3 g R^2 < 1.
    """
    sums = _forward_gains(scaled) if not scaled.joint else _joint_gains(scaled)
    load = np.abs(scaled.force)
    load[0] += np.abs(scaled.drive)
    first, gain = (sums * load[None]).sum(axis=1).max(axis=0), sums.sum(axis=1).max(axis=0)
    radius = first
    for _ in range(60):
        radius = first + gain * radius**3
    size = (np.abs(response.harmonics).sum(axis=1) + np.abs(response.mean)).max(axis=1) * scaled.length
    calm: Bools = (3 * gain * radius**2 < 1) & (size <= 1.001 * radius)
    return calm


def _joint_gains(scaled: ScaledChain) -> Floats:
    """Bounds of the integrals of |z_m| after an impulse on oscillator j; float64, shape (n, n, N), inf if unknown."""
    n, size = scaled.n, len(scaled)
    if n > MOST_JOINT:
        return np.full((n, n, size), np.inf)
    exponents, modes = np.linalg.eig(rest_matrix(scaled))
    decay = -exponents.real * scaled.omega[:, None]
    weights = np.abs(np.linalg.pinv(modes))[:, :, n:] / (scaled.omega[:, None, None] * decay[:, :, None])
    gains = np.abs(modes[:, :n]) @ np.where(decay[:, :, None] > 0, weights, np.inf)
    # A nearly defective matrix makes the sum over its modes worthless, which its size shows.
    bounds: Floats = np.nan_to_num(gains, nan=np.inf).transpose(1, 2, 0)
    return bounds


def _forward_gains(scaled: ScaledChain) -> Floats:
    """The same where each oscillator is fed by those before it only: the integrals multiply along the way."""
    n, size = scaled.n, len(scaled)
    if n > MOST_JOINT:
        return np.full((n, n, size), np.inf)
    own = scaled.k - 0.25 * scaled.delta**2
    swing = np.where(own > 0, 1 / np.tanh(np.pi * scaled.delta / (4 * np.sqrt(own))), 1.0) / scaled.k
    gains = np.zeros((n, n, size))
    for m in range(n):
        gains[m, m] = 1.0
        for source, link in scaled.inputs(m):
            gains[m] += np.abs(link) * gains[source]
        gains[m] *= swing[m]
    return np.nan_to_num(gains, nan=np.inf)


def _peaks(scaled: ScaledChain, size: Floats) -> Floats:
    """Bound of each oscillator's transient part; float64, shape (n, N).

    The transient of oscillator m is -z_m(0) ringing at its own frequency nu_m, plus its answer to the transient of
    m - 1. In resonance a source t^j e^{-delta t/2} becomes lam/(2 nu (j+1)) t^{j+1} e^{-delta t/2}, off resonance
    by D it is multiplied by lam/(nu D). The peak of t^j e^{-delta t/2} is (2 j/(delta e))^j.
    """
    nu = np.sqrt(np.maximum(scaled.k - 0.25 * scaled.delta**2, 1e-3 * np.abs(scaled.k)))
    # The slowest decay of any oscillator bounds them all.
    delta = scaled.delta.min()
    terms: list[Floats] = []
    peaks = np.empty_like(size)
    for m in range(scaled.n):
        own = size[m] * np.maximum(1.0, scaled.omega / nu[m])
        if m:
            apart = np.abs(nu[:m] - nu[m]).min(axis=0)
            resonant = apart <= delta
            climb = np.where(resonant, scaled.lam[m] / (2 * nu[m]), 0.0)
            pass_on = np.where(resonant, 0.0, scaled.lam[m] / (nu[m] * apart))
            grown = [climb * term / (j + 1) for j, term in enumerate(terms)]
            kept = [pass_on * term for term in terms]
            terms = [own + kept[0], *(a + b for a, b in zip(kept[1:], grown, strict=False)), grown[-1]]
        else:
            terms = [own]
        peaks[m] = terms[0] + sum(
            (term * (2 * j / (delta * np.e)) ** j for j, term in enumerate(terms) if j), start=np.zeros(())
        )
    return peaks


def _alone_or_low(scaled: ScaledChain, response: Response, m: int, peak: Floats) -> Bools:
    """Oscillator m has one answer under its input, or its transient stays far below the fold of the lower one."""
    force = scaled.drive if m == 0 else scaled.lam[m] * response.phasor[:, m - 1] * scaled.length
    osc = oscillator(scaled, m)
    cubic = cubic_of(osc, force)
    if not scaled.has_mean:
        below, above = cubic.c <= NEAR * cubic.value(cubic.peak), cubic.c * NEAR >= cubic.value(cubic.dip)
        several = cubic.folded & below & above
    else:
        # A mean tilts the cubic: wherever it could bend the wrong way, ask for the margin below.
        several = -cubic.sign * cubic.kappa + 3 * cubic.strength * peak**2 > np.sqrt(3) * cubic.g
    several &= np.abs(scaled.drive) > 0
    fold = np.where(cubic.folded, cubic.peak, 0.0)
    return ~several | (0.75 * cubic.strength * peak**2 < FOLD**2 * fold)
