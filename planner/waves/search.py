"""First guesses where no closed form applies: a seeded sweep of links and frequencies, the best of it kept."""

from __future__ import annotations

import numpy as np

from chainsim import Chain, Setting, solve

from ..closed_forms.links import drive_for
from ..closed_forms.wave_fit import Freedom, MotionTarget
from ..operating_point import OperatingPoint

__all__ = ["search"]

# Settings tried, how many are kept, and the seed: the same answer every time.
BUDGET, KEPT, SEED = 2048, 4, 0
# The weakest link tried, as a part of the strongest.
WEAKEST = 1e-3
TOL = 1e-3


def search(chain: Chain, wanted: MotionTarget, freedom: Freedom) -> list[OperatingPoint]:
    """The settings of a random sweep that come nearest to the wish; links log-uniform, frequencies uniform."""
    rng = np.random.default_rng(SEED)
    low = max(freedom.lam_min, WEAKEST * freedom.lam_max, 1e-6)
    lam = np.exp(rng.uniform(np.log(low), np.log(max(freedom.lam_max, low)), (BUDGET, chain.n - 1)))
    omega = rng.uniform(freedom.omega_min, freedom.omega_max, BUDGET)
    first = abs(wanted.phasor[0]) or wanted.scale
    epsilon = np.array([float(drive_for(chain, np.array([first]), float(one))[0]) for one in omega])
    setting = Setting.of(chain, epsilon=epsilon, lam=lam, omega=omega)
    phasor = solve(chain, setting, tol=TOL, rung="one_harmonic", start="rest").phasor
    turn = np.exp(1j * np.angle(np.sum(np.conj(phasor) * wanted.phasor * wanted.phased, axis=1)))
    merit = np.sum(wanted.residual(phasor * turn[:, None]) ** 2, axis=1)
    best = np.argsort(np.where(np.isfinite(merit), merit, np.inf), kind="stable")[:KEPT]
    return [OperatingPoint(complex(epsilon[i] * turn[i]), lam[i], float(omega[i])) for i in best]
