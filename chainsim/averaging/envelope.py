"""The envelope: transients and frame changes in complex amplitudes, about one step per cycle or fewer."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..equations.chain import Chain, Setting
from ..errors import ChainError
from ..model.response import Outcome, Stats
from .flow import SlowFlow
from .steps import Steps

__all__ = ["EnvelopeError", "Trace", "follow", "hilltop", "slow_refusal"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Phase of the fastest slow rate in one step of the first try; steps are halved from there.
FIRST_STEP = 0.5
HALVINGS = 10
MOST_STEPS = 1 << 20  # Of one pass; what needs more is out of budget.
# The method is of order 4: halving the steps removes 15/16 of the error.
GAIN = 15.0


class EnvelopeError(ChainError, ValueError):
    """The envelope was asked for what it cannot follow.

    Examples: a damping that is not small; times that do not increase; a drive of another shape; links that change under
    a bias.
    """


@dataclass(frozen=True)
class Trace:
    """How the amplitudes went, z_m = Re(phasor_m e^{i omega tau}), about the equilibrium under constant forces.

    Attributes
    ----------
    tau : float64, shape (K,), the asked instants.
    phasor : complex128, shape (K, N, n), dimensionless.
    outcome : object array of `Outcome`, shape (N,): ok, escaped (an amplitude passed the hilltop, from where on the
        trace means nothing) or out_of_budget (the steps could not be made short enough).
    error_estimate : float64, shape (N,), of the integration, relative to each setting's largest amplitude. What the
        slow flow itself leaves out is O(delta, lam, detuning, beta a^2) of the amplitude in order 1, and the square of
        that in order 2; beside an equilibrium z0 also O(beta z0 a).
    stats : `rhs_evals` counts evaluations of the slow flow of one oscillator.
    """

    tau: Floats
    phasor: Complexes
    outcome: NDArray[np.object_]
    error_estimate: Floats
    stats: Stats


def follow(
    chain: Chain,
    setting: Setting,
    tau: ArrayLike,
    *,
    tol: float,
    epsilon: ArrayLike | None = None,
    lam: ArrayLike | None = None,
    start: ArrayLike | None = None,
    order: int = 2,
) -> Trace:
    """Follow the amplitudes of N settings through the instants `tau`.

    Parameters
    ----------
    tau : float64, shape (K,), increasing; what changes in time is linear between them.
    tol : wanted accuracy of the integration, relative to each setting's largest amplitude.
    epsilon : complex128, shape (K,) or (K, N), drive phasor in place of epsilon e^{i psi} of the setting.
    lam : float64, shape (K, n) or (K, N, n), links in place of those of the setting; ``lam[..., 0]`` closes a ring and
        is 0 in an open chain.
    start : complex128, shape (n,) or (N, n), amplitudes of a motion that follows its drive; None is rest, z = z' = 0,
        and a drive that sets in at ``tau[0]``.
    order : 1 or 2, the order of the slow flow.

    Raises
    ------
    EnvelopeError
        With the field and its value.
    """
    began = time.perf_counter()
    refusal = slow_refusal(chain, setting)
    if refusal:
        raise EnvelopeError(refusal)
    if order not in (1, 2):
        raise EnvelopeError(f"order: expected 1 or 2, got {order}")
    if not tol > 0:
        raise EnvelopeError(f"tol: expected a number > 0, got {tol}")
    plan = _Course.of(chain, setting, tau, epsilon, lam)
    with np.errstate(all="ignore"):
        changes = np.ptp(plan.lam, axis=0).any()
        # A mean of equal numbers may differ from them in its last bit.
        flow = SlowFlow.of(chain, setting, plan.lam.mean(axis=0) if changes else plan.lam[0], order)
        if flow.lean is not None and changes:
            raise EnvelopeError("lam: links cannot change under a bias or preload; use rung ode")
        begin = _begin(flow, plan, start)
        return _halved(hilltop(chain, setting, plan.lam).min(axis=0), flow, plan, begin, tol, began)


def slow_refusal(chain: Chain, setting: Setting) -> str:
    """Why the slow flow is not true of this system, in one sentence that names the cure; "" when it can be."""
    if not chain.deltas.max() < 1:
        return f"delta {chain.deltas.max()} is no small damping, so nothing is slow; use rung ode"
    if bool((chain.law.stiffness(chain.stiffness, setting.lam, setting.lam_y) <= 0.3).any()):
        return "an oscillator has a stiffness of 0.3 or less, so nothing is slow; use rung ode"
    return ""


def hilltop(chain: Chain, setting: Setting, lam: Floats) -> Floats:
    """The amplitude beyond which an oscillator has left its well, sqrt(k/-beta), k = 1 + lam; inf unless beta < 0.

    lam : float64, shape (..., n), links in place of those of the setting.
    """
    stiffness = chain.law.stiffness(chain.stiffness, lam, setting.lam_y)
    soft = chain.betas < 0
    return np.where(soft, np.sqrt(np.maximum(stiffness, 0) / np.where(soft, -chain.betas, 1.0)), np.inf)


@dataclass(frozen=True)
class _Course:
    """Drive (K, N) and links (K, N, n) at the instants tau (K,)."""

    tau: Floats
    drive: Complexes
    lam: Floats

    @classmethod
    def of(
        cls, chain: Chain, setting: Setting, tau: ArrayLike, epsilon: ArrayLike | None, lam: ArrayLike | None
    ) -> _Course:
        times = np.asarray(tau, dtype=np.float64)
        if times.ndim != 1 or len(times) < 2 or not (np.isfinite(times).all() and (np.diff(times) > 0).all()):
            raise EnvelopeError("tau: expected two or more finite instants, each later than the one before")
        count, size, n = len(times), len(setting), setting.n
        steady = setting.epsilon * np.exp(1j * setting.phase)
        drive = np.asarray(steady if epsilon is None else epsilon, dtype=np.complex128)
        if epsilon is not None and drive.shape not in ((count,), (count, size)):
            raise EnvelopeError(f"epsilon: expected shape {(count,)} or {(count, size)}, got {drive.shape}")
        drive = drive[:, None] if drive.ndim == 1 and epsilon is not None else drive
        links = np.asarray(setting.lam if lam is None else lam, dtype=np.float64)
        if lam is not None and links.shape not in ((count, n), (count, size, n)):
            raise EnvelopeError(f"lam: expected shape {(count, n)} or {(count, size, n)}, got {links.shape}")
        links = links[:, None] if links.ndim == 2 and lam is not None else links
        if not (np.isfinite(drive).all() and np.isfinite(links).all()):
            raise EnvelopeError("epsilon, lam: expected finite numbers")
        if lam is not None and not chain.law.closed and links[..., 0].any():
            raise EnvelopeError("lam: the first oscillator of an open chain has no link; set lam[..., 0] to 0")
        return cls(times, np.broadcast_to(drive, (count, size)), np.broadcast_to(links, (count, size, n)))


def _begin(flow: SlowFlow, plan: _Course, start: ArrayLike | None) -> Complexes:
    if start is None:
        return flow.at_rest(plan.drive[0], plan.lam[0])
    amplitude = np.asarray(start, dtype=np.complex128)
    shape = flow.lam.shape
    if amplitude.shape not in (shape[1:], shape) or not np.isfinite(amplitude).all():
        raise EnvelopeError(f"start: expected finite amplitudes of shape {shape}, got {amplitude.shape}")
    return flow.slow_part(np.broadcast_to(amplitude, shape), plan.drive[0], plan.lam[0])


def _halved(top: Floats, flow: SlowFlow, plan: _Course, begin: Complexes, tol: float, began: float) -> Trace:
    """Integrate with steps halved until halving them changes less than `tol`; `top` is the hilltop, (N, n)."""
    changing = np.ptp(plan.lam, axis=0).max() * np.abs(flow.weight).max()
    fastest = float(np.abs(flow.rate).sum(axis=2).max() + changing)
    if not np.isfinite(fastest) or (flow.lean is not None and not np.isfinite(flow.lean.place).all()):
        return _nothing(plan, began)
    needed = np.maximum(np.ceil(np.diff(plan.tau) * fastest / FIRST_STEP), 1)
    if 2 * needed.sum() > MOST_STEPS:
        return _nothing(plan, began)
    cuts = needed.astype(np.int64)
    phasor, evals = _integrate(flow, plan, begin, cuts), 4 * int(cuts.sum())
    for _ in range(HALVINGS):
        cuts = 2 * cuts
        coarse, phasor = phasor, _integrate(flow, plan, begin, cuts)
        evals += 4 * int(cuts.sum())
        escaped = ~(np.abs(phasor) <= top).all(axis=(0, 2))
        size = np.maximum(np.abs(phasor).max(axis=(0, 2)), 1e-300)
        error = np.abs(phasor - coarse).max(axis=(0, 2)) / size / GAIN
        good = (error <= tol) | escaped
        if good.all() or 2 * cuts.sum() > MOST_STEPS:
            break
    outcome = np.empty(len(good), dtype=object)
    outcome.fill(Outcome.OK)
    outcome[~good], outcome[escaped] = Outcome.OUT_OF_BUDGET, Outcome.ESCAPED
    stats = Stats(rhs_evals=evals * flow.lam.size, seconds=time.perf_counter() - began)
    for array in (phasor, outcome, error):
        array.flags.writeable = False
    return Trace(plan.tau, phasor, outcome, np.where(escaped, np.inf, error), stats)


def _nothing(plan: _Course, began: float) -> Trace:
    """What is said where the slow flow has no numbers: out of budget."""
    size = plan.drive.shape[1]
    outcome = np.empty(size, dtype=object)
    outcome.fill(Outcome.OUT_OF_BUDGET)
    phasor, error = np.full(plan.lam.shape, np.nan, dtype=np.complex128), np.full(size, np.inf)
    for array in (phasor, outcome, error):
        array.flags.writeable = False
    return Trace(plan.tau, phasor, outcome, error, Stats(seconds=time.perf_counter() - began))


def _integrate(flow: SlowFlow, plan: _Course, slow: Complexes, cuts: NDArray[np.int64]) -> Complexes:
    """Amplitudes (K, N, n) with ``cuts[k]`` steps between instants k and k + 1."""
    found = np.empty((len(plan.tau), *slow.shape), dtype=np.complex128)
    found[0] = flow.amplitude(slow, plan.drive[0], plan.lam[0])
    made: dict[float, Steps] = {}
    for k, count in enumerate(cuts):
        h = float(plan.tau[k + 1] - plan.tau[k]) / int(count)
        # Instants of a regular lattice differ by rounding only; one set of coefficients serves them all.
        key = float(f"{h:.12g}")
        if key not in made:
            made[key] = Steps.of(flow.rate, key)
        steps, still = made[key], np.array_equal(plan.lam[k], plan.lam[k + 1])
        fixed = flow.lam if still and np.array_equal(plan.lam[k], flow.lam) else plan.lam[k]
        for j in range(int(count)):
            u, v = j / int(count), (j + 1) / int(count)
            drive = (
                plan.drive[k] + u * (plan.drive[k + 1] - plan.drive[k]),
                (plan.drive[k] + v * (plan.drive[k + 1] - plan.drive[k])),
            )
            lam = (fixed, fixed)
            if not still:
                change = plan.lam[k + 1] - plan.lam[k]
                lam = plan.lam[k] + u * change, plan.lam[k] + v * change
            slow = steps.take(flow, slow, drive, lam)
        found[k + 1] = flow.amplitude(slow, plan.drive[k + 1], plan.lam[k + 1])
    return found
