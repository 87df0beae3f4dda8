"""Harmonic balance with the terms that act linearly on the force: creep, higher modes, an amplifier's bandwidth.

At the frequency h omega a creep multiplies the force by C = 1 + sum_i g/(1 + i h omega T_i), the modes add Q f to the
tip, Q = sum_j g_j/(Omega_j^2 - (h omega)^2 + i delta_j h omega), and the amplifier multiplies the drive by
1/(1 + i h omega/bandwidth). With f = K z + sign z^3 - preload and the tips w = z + Q f the equations are

    f/C = drive + bias + sum of lam (w_before - w),      solved for all oscillators at once by Newton's method.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis, basis_for, resize
from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..model.response import Outcome, Stats
from .effects import Terms
from .lines import Lines
from .steady import Steady

__all__ = ["balance_refusal", "balance_with_terms"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

ORDERS = (3, 5, 9, 17)
MOST = 32  # Oscillators: the matrix of all of them is factored whole.
LOADS = (0.25, 0.5, 0.75, 1.0)
NEWTON_STEPS = 25
CLOSE = 1e-11
ROUNDING = 4e-15  # Times the sharpness 1/(delta omega) it is the floor of any estimate.


def balance_refusal(chain: Chain, terms: Terms) -> str:
    """What of the terms it does not carry, or ""."""
    if terms.hysteresis is not None:
        return "hysteresis"
    amplifier = terms.amplifier
    if amplifier is not None and math.isfinite(min(amplifier.slew, amplifier.limit)):
        return "an amplifier that slews or cuts off"
    return f"more than {MOST} oscillators" if chain.n > MOST else ""


def balance_with_terms(chain: Chain, setting: Setting, terms: Terms, *, tol: float, guide: Steady | None) -> Steady:
    """The steady state of one setting under one tone, with ever more harmonics until they change it by less than `tol`.

    Parameters
    ----------
    guide : a motion near the answer; None for the answer that grows from rest as every force is raised.
        Whether the answer is stable is not looked at.
    """
    began = time.perf_counter()
    scaled = ScaledChain.of(chain, setting)
    mean = scaled.has_mean
    old, x, error, work = basis_for(ORDERS[0], mean), None, math.inf, 0
    for order in ORDERS:
        system = _System.of(chain, setting, terms, scaled, basis_for(order, mean))
        if x is not None:
            begin = _resized(x, old, system.basis)
        elif guide is not None:
            begin = system.basis.coordinates(guide.amplitude, guide.mean).T * scaled.length
        else:
            begin = None
        found, steps = system.solve(begin)
        work += steps
        if found is None:
            return _nothing(setting, chain.n, Stats(newton_steps=work, seconds=time.perf_counter() - began))
        if x is not None:
            size = float(np.abs(found).max())
            error = float(np.abs(found - _resized(x, old, system.basis)).max()) / size if size else 0.0
            error += ROUNDING * (1 + 1 / max(float(chain.deltas.min() * setting.omega[0]), 1e-12))
        x, old = found, system.basis
        if error <= tol:
            break
    outcome = Outcome.OK if error <= tol else Outcome.OUT_OF_BUDGET
    stats = Stats(newton_steps=work, oscillators_solved=chain.n, seconds=time.perf_counter() - began)
    assert x is not None
    tip = system.tips(x).T / scaled.length
    amplitude, still = old.phasors(tip), tip[-1] if mean else np.zeros(chain.n)
    return Steady(
        outcome,
        "harmonic_balance",
        _harmonics(setting, len(amplitude)),
        amplitude,
        still,
        error,
        None,
        None,
        None,
        stats,
    )


def _resized(x: Floats, old: Basis, new: Basis) -> Floats:
    resized: Floats = resize(x.T, old, new).T
    return resized


def _harmonics(setting: Setting, count: int) -> Lines:
    each = np.arange(1, count + 1)
    return Lines(each[:, None], each * setting.omega[0])


def _nothing(setting: Setting, n: int, stats: Stats) -> Steady:
    unknown = np.full((1, n), np.nan, dtype=np.complex128)
    lost, lines = Outcome.NO_CONVERGENCE, _harmonics(setting, 1)
    return Steady(lost, "harmonic_balance", lines, unknown, unknown[0].real, math.inf, None, None, None, stats)


@dataclass(frozen=True)
class _System:
    """The equations in scaled coordinates; x has shape (n, d).

    own : float64, shape (n, d, d), from z to the linear part of f. less, tilt : float64, shape (d, d), 1/C and Q.
    sign : float64, shape (n,). links : float64, shape (n, n), with the back terms. force : float64, shape (n, d), drive
    and bias. touch : float64, shape (n, d), preload.
    """

    basis: Basis
    own: Floats
    less: Floats
    tilt: Floats
    sign: Floats
    links: Floats
    force: Floats
    touch: Floats

    @classmethod
    def of(cls, chain: Chain, setting: Setting, terms: Terms, scaled: ScaledChain, basis: Basis) -> _System:
        n, omega = chain.n, float(setting.omega[0])
        deltas, own = scaled.of_each(scaled.delta), np.broadcast_to(chain.stiffness, (n,))
        creep, modes = terms.creep, terms.modes or ()
        times = () if creep is None else creep.times
        share = 0.0 if creep is None else creep.per_decade / creep.each
        bandwidth = math.inf if terms.amplifier is None else terms.amplifier.bandwidth
        links = np.diag(own - scaled.k[:, 0])
        for fed, source, link in scaled.links():
            np.add.at(links, (fed, source), link[:, 0])
        force, touch = np.zeros((2, n, basis.size))
        if basis.order:
            drive = scaled.drive[0] / (1 + 1j * omega / bandwidth)
            force[0, 0], force[0, 1] = drive.real, drive.imag
        if basis.mean:
            force[:, -1] = setting.bias[0] * scaled.length
            touch[0, -1] = setting.preload[0] * scaled.length
        return cls(
            basis,
            np.stack([_factor(basis, _oscillator(k, delta), omega) for k, delta in zip(own, deltas, strict=True)]),
            _factor(basis, lambda s: 1 / (1 + sum(share / (1 + s * time) for time in times)), omega),
            _factor(basis, lambda s: sum(j.gain / (j.omega**2 + s * s + j.delta * s) for j in modes) + 0j, omega),
            scaled.of_each(scaled.sign), links, force, touch,
        )  # fmt: skip

    def solve(self, begin: Floats | None) -> tuple[Floats | None, int]:
        """The answer near `begin`, or the one that grows from rest; None where there is none. And the Newton steps."""
        x, count = np.zeros_like(self.force) if begin is None else begin, 0
        for load in LOADS if begin is None else LOADS[-1:]:
            for step in range(NEWTON_STEPS):
                moved = self._step(x, load)
                count += 1
                change, x = np.abs(moved - x).max(), moved
                if not np.isfinite(x).all() or step == NEWTON_STEPS - 1:
                    return None, count
                if change <= CLOSE * np.abs(x).max():
                    break
        return x, count

    def tips(self, x: Floats) -> Floats:
        """Where the tips are, with what the modes add; float64, shape (n, d)."""
        f = np.einsum("mde,me->md", self.own + self._cubic(x), x) - self.touch
        tips: Floats = x + f @ self.tilt.T
        return tips

    def _cubic(self, x: Floats) -> Floats:
        """The matrix (n, d, d) by which z^3 is a multiple of z; three times that is its slope."""
        square = self.sign[:, None] * (x @ self.basis.values.T) ** 2
        cubic: Floats = np.einsum("ds,ms,se->mde", self.basis.project, square, self.basis.values, optimize=True)
        return cubic

    def _step(self, x: Floats, load: float) -> Floats:
        n, d = x.shape
        cubic = self._cubic(x)
        f = np.einsum("mde,me->md", self.own + cubic, x) - load * self.touch
        slope = self.own + 3 * cubic
        tip, moving = x + f @ self.tilt.T, np.eye(d) + self.tilt @ slope
        left = f @ self.less.T - load * self.force - self.links @ tip
        jacobian = -np.einsum("mj,jde->mdje", self.links, moving)
        each = np.arange(n)
        jacobian[each, :, each] += self.less @ slope
        try:
            return x - np.linalg.solve(jacobian.reshape(n * d, n * d), left.reshape(-1)).reshape(n, d)
        except np.linalg.LinAlgError:
            return np.full_like(x, np.nan)


def _oscillator(stiffness: float, delta: float) -> Callable[[complex], complex]:
    return lambda s: stiffness + s * s + delta * s


def _factor(basis: Basis, response: Callable[[complex], complex], omega: float) -> Floats:
    """The matrix (d, d) that multiplies harmonic h by response(i h omega)."""
    matrix = np.zeros((basis.size, basis.size))
    for row, h in enumerate(basis.harmonics):
        at, value = 2 * row, complex(response(1j * float(h) * omega))
        matrix[at : at + 2, at : at + 2] = [[value.real, -value.imag], [value.imag, value.real]]
    if basis.mean:
        matrix[-1, -1] = complex(response(0j)).real
    return matrix
