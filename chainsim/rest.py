"""Whether the lower answer is surely the one a sudden drive from rest reaches, without integrating."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .chain import Chain, Setting
from .march import cubic_of, oscillator
from .response import Response
from .scaling import Stages

__all__ = ["sure_from_rest"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Of the hilltop, for the transient's peak. Below it the restoring force keeps two thirds of its linear value.
WELL = 0.6
# Of the amplitude where the lower branch folds, for the transient's peak: the saddle is beyond the fold.
FOLD = 0.6
# How near, as a ratio of forces squared, the single-harmonic folds may be before "one answer" is doubted.
NEAR = 1.25


def sure_from_rest(chain: Chain, setting: Setting, response: Response) -> Bools:
    """Whether the steady `response` is the one reached from z = z' = 0; bool, shape (N,).

    Sure means: the answer is stable, the peak of the start-up transient (bounded as if linear) stays well inside the
    softening well, and every oscillator with more than one answer keeps well below its fold. A False is no verdict, it
    asks for an integration.
    """
    stages = Stages.of(chain, setting)
    size = np.abs(response.phasor.T) * stages.length
    mean = np.abs(response.mean.T) * stages.length
    with np.errstate(all="ignore"):
        peak = _peaks(stages, size + mean) + size + mean
        top = np.sqrt(np.maximum(stages.k, 0.0)) if stages.sign < 0 else np.ones_like(peak)
        checks = [response.stable, (peak < WELL * top).all(axis=0)]
        checks += [_alone_or_low(stages, response, m, peak[m]) for m in range(stages.n)]
    sure: Bools = np.logical_and.reduce(checks)
    return sure


def _peaks(stages: Stages, size: Floats) -> Floats:
    """Bound of each oscillator's transient part; float64, shape (n, N).

    The transient of oscillator m is -z_m(0) ringing at its own frequency nu_m, plus its answer to the transient of
    m - 1. In resonance a source t^j e^{-delta t/2} becomes lam/(2 nu (j+1)) t^{j+1} e^{-delta t/2}, off resonance
    by D it is multiplied by lam/(nu D). The peak of t^j e^{-delta t/2} is (2 j/(delta e))^j.
    """
    nu = np.sqrt(np.maximum(stages.k - 0.25 * stages.delta**2, 1e-3 * np.abs(stages.k)))
    terms: list[Floats] = []
    peaks = np.empty_like(size)
    for m in range(stages.n):
        own = size[m] * np.maximum(1.0, stages.omega / nu[m])
        if m:
            apart = np.abs(nu[:m] - nu[m]).min(axis=0)
            resonant = apart <= stages.delta
            climb = np.where(resonant, stages.lam[m] / (2 * nu[m]), 0.0)
            pass_on = np.where(resonant, 0.0, stages.lam[m] / (nu[m] * apart))
            grown = [climb * term / (j + 1) for j, term in enumerate(terms)]
            kept = [pass_on * term for term in terms]
            terms = [own + kept[0], *(a + b for a, b in zip(kept[1:], grown, strict=False)), grown[-1]]
        else:
            terms = [own]
        peaks[m] = terms[0] + sum(
            (term * (2 * j / (stages.delta * np.e)) ** j for j, term in enumerate(terms) if j), start=np.zeros(())
        )
    return peaks


def _alone_or_low(stages: Stages, response: Response, m: int, peak: Floats) -> Bools:
    """Oscillator m has one answer under its input, or its transient stays far below the fold of the lower one."""
    force = stages.drive if m == 0 else stages.lam[m] * response.phasor[:, m - 1] * stages.length
    cubic = cubic_of(oscillator(stages, m), force)
    if not stages.has_mean:
        below, above = cubic.c <= NEAR * cubic.value(cubic.peak), cubic.c * NEAR >= cubic.value(cubic.dip)
        several = cubic.folded & below & above
    else:
        # A mean tilts the cubic: wherever it could bend the wrong way, ask for the margin below.
        several = -stages.sign * cubic.kappa + 3 * peak**2 > np.sqrt(3) * cubic.g
    several &= np.abs(stages.drive) > 0
    fold = np.where(cubic.folded, cubic.peak, 0.0)
    return ~several | (0.75 * peak**2 < FOLD**2 * fold)
