"""Exact derivatives of the steady phasors, by the implicit function theorem along the chain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis, basis_for
from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..model.response import Response
from ..rung import RungError
from .balance import Oscillator, linearise
from .march import oscillator

__all__ = ["Gradient", "gradient"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True)
class Gradient:
    """Derivatives of the first harmonics. Real parameters, so d phasor = d re + i d im is one complex number.

    Attributes
    ----------
    epsilon : complex128, shape (N, n), d phasor_m / d epsilon.
    lam : complex128, shape (N, n, n-1), ``lam[:, m, j]`` = d phasor_m / d lam_{j+1}: link j joins oscillators j and
        j + 1, as in the list `Setting.of` takes. Zero for j >= m.
    omega : complex128, shape (N, n), d phasor_m / d omega.

    NaN where the response has no answer.
    """

    epsilon: Complexes
    lam: Complexes
    omega: Complexes


def gradient(chain: Chain, setting: Setting, response: Response) -> Gradient:
    """Derivatives of `response`, an answer of a steady rung for `setting`, with every harmonic following along.

    With R_m(x_m, x_{m-1}, p) = 0 the balance of oscillator m, ``J_m dx_m = lam_m dx_{m-1} - dR_m/dp``: the Jacobian is
    exact, so the derivative is that of the rung's own equations. About as dear as one Newton step.

    Raises
    ------
    RungError
        For a ring, a bidirectional chain or a grid.
    """
    if not chain.law.in_line:
        raise RungError("gradient: open chains only; a ring, bidirectional chain or grid has no sequential form")
    scaled = ScaledChain.of(chain, setting)
    if response.rung == "linear":
        scaled = replace(scaled, sign=np.zeros((1, 1)))
    basis, x = _series(scaled, response)
    with np.errstate(all="ignore"):
        table = _along(scaled, basis, x, np.exp(1j * setting.phase))
    # The drive column is per scaled epsilon = epsilon * length, and phasors are x / length: the length cancels.
    table[:, :, 1:] /= scaled.length
    table.flags.writeable = False
    n = scaled.n
    return Gradient(table[:, :, 0], table[:, :, 1:n], table[:, :, n])


def _along(scaled: ScaledChain, basis: Basis, x: Floats, turn: Complexes) -> Complexes:
    """d phasor of every oscillator by scaled epsilon, the links 1..n-1 and omega; shape (N, n, n + 1)."""
    n, size = scaled.n, len(scaled)
    change = np.zeros((size, basis.size, n + 1))
    table = np.empty((size, n, n + 1), dtype=np.complex128)
    for m in range(n):
        osc = oscillator(scaled, m)
        jacobian = linearise(basis, osc.coefficients(basis), osc.sign, x[m])[0].transpose(2, 0, 1)
        change = scaled.lam[m][:, None, None] * change
        if m == 0:
            change[:, 0, 0], change[:, 1, 0] = turn.real, turn.imag
        else:
            change[:, :, m] = (x[m - 1] - scaled.law.back * x[m]).T
        change[:, :, n] -= _by_omega(osc, basis, x[m])
        change = _solve(jacobian, change)
        table[:, m] = change[:, 0] + 1j * change[:, 1]
    return table


def _series(scaled: ScaledChain, response: Response) -> tuple[Basis, Floats]:
    order = response.harmonics.shape[1]
    even = bool(np.nan_to_num(response.harmonics[:, 1::2]).any() or np.nan_to_num(response.mean).any())
    basis = basis_for(order, even or scaled.has_mean)
    harmonics = response.harmonics.transpose(1, 2, 0) * scaled.length
    x = basis.coordinates(harmonics, response.mean.T * scaled.length)
    return basis, np.ascontiguousarray(x.transpose(1, 0, 2))


def _by_omega(osc: Oscillator, basis: Basis, x: Floats) -> Floats:
    """d R / d omega = (-2 h^2 omega + i h delta) x, shape (N, d)."""
    slope = np.zeros_like(x)
    for row, h in enumerate(basis.harmonics):
        re, im = x[2 * row], x[2 * row + 1]
        inertia, damping = -2 * h * h * osc.omega, h * osc.delta
        slope[2 * row] = inertia * re - damping * im
        slope[2 * row + 1] = inertia * im + damping * re
    return slope.T


def _solve(jacobian: Floats, right: Floats) -> Floats:
    bad = ~np.isfinite(jacobian).all(axis=(1, 2)) | (np.abs(np.linalg.det(np.nan_to_num(jacobian))) == 0)
    if bad.any():
        jacobian = np.where(bad[:, None, None], np.eye(jacobian.shape[1]), jacobian)
        right = np.where(bad[:, None, None], np.nan, right)
    return np.asarray(np.linalg.solve(jacobian, right), dtype=np.float64)
