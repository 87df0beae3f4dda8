"""The balance equations of a whole chain with one free quantity: what continuation walks on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis
from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..floquet.hill import chain_multipliers
from ..floquet.monodromy import joint_multipliers
from ..harmonic_balance.balance import linearise
from ..harmonic_balance.joint import follow_load, newton_joint
from ..harmonic_balance.march import march, oscillator

__all__ = ["BalanceSystem", "Parameter"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class Parameter(StrEnum):
    """The quantity that changes along a branch."""

    EPSILON = "epsilon"
    LAM = "lam"
    OMEGA = "omega"


@dataclass(frozen=True)
class BalanceSystem:
    """R(u) = 0 with u = (x_1 .. x_n, p): n d equations, n d + 1 unknowns. x is scaled by sqrt|beta|.

    `scale` : float64, shape (n d + 1,), lengths by which arclength is measured.
    """

    chain: Chain
    setting: Setting
    parameter: Parameter
    basis: Basis
    scale: Floats | float = 1.0

    @property
    def value(self) -> float:
        """The parameter's value in `setting`."""
        if self.parameter is Parameter.LAM:
            return float(self.setting.lam[0, np.abs(self.setting.lam[0]).argmax()])
        return float(getattr(self.setting, self.parameter)[0])

    @cached_property
    def _ratios(self) -> Floats:
        lam = self.setting.lam
        if self.value:
            return lam / self.value
        some = Setting.of(self.chain, epsilon=0.0, lam=1.0, omega=1.0)
        return np.array(some.lam)

    def at(self, value: float) -> ScaledChain:
        """The scaled chain with the parameter at `value`."""
        if self.parameter is Parameter.LAM:
            return ScaledChain.of(self.chain, replace(self.setting, lam=value * self._ratios))
        return ScaledChain.of(self.chain, replace(self.setting, **{str(self.parameter): np.array([value])}))

    def start(self, phasor: Complexes | None) -> Floats | None:
        """u at `setting`: on the lower branch, or beside `phasor` (n,); None where Newton finds none."""
        scaled = self.at(self.value)
        n, d = self.chain.n, self.basis.size
        if phasor is None:
            found = follow_load(scaled, self.basis) if scaled.joint else march(scaled, self.basis)
        else:
            guide = np.zeros((n, d, 1))
            guide[:, 0, 0], guide[:, 1, 0] = phasor.real * scaled.length, phasor.imag * scaled.length
            found = newton_joint(scaled, self.basis, guide) if scaled.joint else march(scaled, self.basis, guide)
        return np.append(found.x[:, :, 0].ravel(), self.value) if found.ok[0] else None

    def scaled(self, span: float) -> BalanceSystem:
        """The same with lengths: `span` for the parameter, 0.3 for amplitudes (in hilltops of beta = -1)."""
        size = self.chain.n * self.basis.size
        return replace(self, scale=np.append(np.full(size, 0.3), span))

    def linearised(self, u: Floats) -> tuple[Floats, Floats]:
        """R (n d,) and its derivative (n d, n d + 1)."""
        value = float(u[-1])
        residual, matrix = self._balance(u[:-1], value)
        # R is a polynomial of degree 2 in every parameter, so this difference is its exact derivative.
        h = 1e-3 * max(abs(value), 1e-3)
        slope = (self._balance(u[:-1], value + h)[0] - self._balance(u[:-1], value - h)[0]) / (2 * h)
        return residual, np.column_stack([matrix, slope])

    def phasors(self, u: Floats) -> tuple[Complexes, Floats]:
        """First harmonics and means, each shape (K, n), of points u (K, n d + 1), in the chain's own units."""
        length = self.at(self.value).length
        x = u[:, :-1].reshape(len(u), self.chain.n, self.basis.size) / length
        mean = x[..., -1] if self.basis.mean else np.zeros(x.shape[:2])
        return x[..., 0] + 1j * x[..., 1], np.array(mean)

    def stable(self, u: Floats) -> NDArray[np.bool_]:
        """Stability of points u (K, n d + 1); bool, shape (K,)."""
        whole = [self.at(float(value)) for value in u[:, -1]]
        scaled = replace(
            whole[0],
            omega=np.concatenate([each.omega for each in whole]), k=np.concatenate([each.k for each in whole], axis=1),
            lam=np.concatenate([each.lam for each in whole], axis=1),
            drive=np.concatenate([each.drive for each in whole]),
            force=np.concatenate([each.force for each in whole], axis=1),
            other=None if whole[0].other is None else np.concatenate([_other(each) for each in whole], axis=1),
        )  # fmt: skip
        x = u[:, :-1].reshape(len(u), self.chain.n, self.basis.size).transpose(1, 2, 0)
        turn = joint_multipliers if scaled.joint else chain_multipliers
        multipliers = turn(scaled, self.basis, np.ascontiguousarray(x))
        return np.asarray((np.abs(multipliers) < 1).all(axis=(1, 2)), dtype=np.bool_)

    def _balance(self, x: Floats, value: float) -> tuple[Floats, Floats]:
        scaled = self.at(value)
        n, d = self.chain.n, self.basis.size
        rows = x.reshape(n, d, 1)
        residual, matrix = np.empty((n, d)), np.zeros((n * d, n * d))
        for m in range(n):
            osc = oscillator(scaled, m)
            jacobian, twice = linearise(self.basis, osc.coefficients(self.basis), osc.sign, rows[m])
            residual[m] = (jacobian[:, :, 0] @ rows[m] - twice)[:, 0]
            if self.basis.mean:
                residual[m, -1] -= scaled.force[m, 0]
            here = slice(m * d, (m + 1) * d)
            matrix[here, here] = jacobian[:, :, 0]
        residual[0, 0] -= scaled.drive[0].real
        residual[0, 1] -= scaled.drive[0].imag
        for fed, feeds, strength in scaled.links():
            for to, by, link in zip(fed, feeds, strength[:, 0], strict=True):
                residual[to] -= link * rows[by, :, 0]
                matrix[to * d : (to + 1) * d, by * d : (by + 1) * d] -= link * np.eye(d)
        return residual.ravel(), matrix


def _other(scaled: ScaledChain) -> Floats:
    assert scaled.other is not None
    return scaled.other
