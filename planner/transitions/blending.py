"""Changes between amplitude profiles whose moduli follow a blend: links and drive in Taylor jets, ways alike once.

From the last actuator up, ``A_{m-1} = A_m + mu G_m`` with ``|G|^2 mu^2 + 2 Re(A conj(G)) mu + |A|^2 - r_{m-1}^2 = 0``,
mu = 1/lam_m(tau) (theory.md section 4.3). What happens at an actuator depends on those behind it alone, so that ways
with the same ends there share the work.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

from ..closed_forms.links import stages
from . import jets
from .jets import Jet

__all__ = ["Blended", "blended"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Places = NDArray[np.intp]


@dataclass(frozen=True)
class Blended:
    """P ways at the nodes of a blend.

    Attributes
    ----------
    drive : float64, shape (P, nodes, 4), real and imaginary part of the envelope, then of its derivative in tau.
    lam, slope : float64, shape (P, nodes, n-1).
    possible : bool, shape (P,); where False the rest means nothing.
    """

    drive: Floats
    lam: Floats
    slope: Floats
    possible: Bools


class _Kinds(NamedTuple):
    """Ways that differ from some actuator on: `first` of each kind, and the kind of each way."""

    first: Places
    kind: Places


def _kinds(before: Floats, after: Floats) -> list[_Kinds]:
    """For every actuator the ways that differ at it or behind it."""
    count, n = before.shape
    ends = before + 1j * after
    codes = np.unique(ends, return_inverse=True)[1].reshape(count, n)
    kind: Places = np.zeros(count, dtype=np.intp)
    found = []
    for m in range(n - 1, -1, -1):
        _, first, kind = np.unique(kind * (count * n) + codes[:, m], return_index=True, return_inverse=True)
        found.append(_Kinds(first, kind))
    return found[::-1]


def _taken(jet: Jet, index: Places) -> Jet:
    """Kinds of a jet; the last axis but one counts them."""
    same = len(index) == jet.shape[-2] and bool(np.all(index == np.arange(len(index))))
    return jet if same else jet[..., index, :]


def blended(chain: Chain, before: Floats, after: Floats, omega: float, blend: Jet) -> Blended:
    """Changes from profiles to others.

    Parameters
    ----------
    before, after : float64, shape (P, n), dimensionless, > 0 (or n = 1, where 0 is allowed).
    blend : float64, shape (2 n + 2, nodes), jet in tau of what leads from 0 to 1.
    """
    count, n = before.shape
    nodes, squared = blend.shape[1], jets.square(blend)
    kinds = _kinds(before, after)
    lam, slope = np.empty((count, nodes, n - 1)), np.empty((count, nodes, n - 1))
    possible = np.ones(count, dtype=np.bool_)
    moduli = list(_moduli(before, after, blend, squared, kinds))
    modulus = _modulus(before[:, -1], after[:, -1], kinds[-1], blend)
    # Real and imaginary part on axis 1: products of real jets are quick.
    envelope = np.stack([modulus, np.zeros_like(modulus)], axis=1)
    # Ways that cannot be gone may run into any numbers.
    with np.errstate(all="ignore"):
        for m in range(n - 1, 0, -1):
            force = _force(chain, m, omega, envelope, moduli[m])
            child = kinds[m].kind[kinds[m - 1].first]
            mu, feasible = _link(envelope, force, moduli[m], moduli[m - 1], child)
            here = kinds[m - 1].kind
            possible &= feasible[here]
            lam[:, :, m - 1] = (1 / mu[0])[here]
            slope[:, :, m - 1] = (-mu[1] / mu[0] ** 2)[here]
            envelope = _taken(envelope[: len(force)], child) + jets.multiply(mu[:, None], _taken(force, child))
        force = _force(chain, 0, omega, envelope, moduli[0])
    drive = np.stack([force[0, 0], force[0, 1], force[1, 0], force[1, 1]], axis=-1)[kinds[0].kind]
    possible &= np.isfinite(drive).all(axis=(1, 2)) & np.isfinite(lam).all(axis=(1, 2))
    possible &= np.isfinite(slope).all(axis=(1, 2))
    drive[~possible], lam[~possible], slope[~possible] = 0.0, 1.0, 0.0
    return Blended(drive, lam, slope, possible)


def _modulus(before: Floats, after: Floats, kinds: _Kinds, blend: Jet) -> Jet:
    """A modulus that follows the blend, for each kind; float64, shape (K, kinds, nodes)."""
    one, other = before[kinds.first], after[kinds.first]
    out: Jet = (other - one)[None, :, None] * blend[:, None, :]
    out[0] += one[:, None]
    return out


def _moduli(before: Floats, after: Floats, blend: Jet, squared: Jet, kinds: list[_Kinds]) -> Iterator[Jet]:
    """Their squares, ``r0^2 + 2 r0 d s + d^2 s^2``, from the first actuator on, as long as they are asked for."""
    for m, kind in enumerate(kinds):
        length = 2 * m + 4
        one, step = before[kind.first, m], (after - before)[kind.first, m]
        out: Jet = (2 * one * step)[None, :, None] * blend[:length, None, :]
        out += (step**2)[None, :, None] * squared[:length, None, :]
        out[0] += (one**2)[:, None]
        yield out


def _force(chain: Chain, m: int, omega: float, envelope: Jet, modulus2: Jet) -> Jet:
    """G_m, two orders shorter than the envelope."""
    length, own = len(envelope) - 2, stages(chain, m)
    bend = 0.75 * own.beta * modulus2[:length]
    bend[0] += own.stiffness - omega**2
    first = jets.derivative(envelope)
    force = jets.multiply(bend[:, None], envelope[:length]) + jets.derivative(first)
    force += own.delta * first[:length]
    # i omega (delta A + 2 A').
    turned = omega * (own.delta * envelope[:length] + 2 * first[:length])
    force[:, 0] -= turned[:, 1]
    force[:, 1] += turned[:, 0]
    return np.asarray(force)


def _link(envelope: Jet, force: Jet, modulus2: Jet, before2: Jet, child: Places) -> tuple[Jet, Bools]:
    """mu = 1/lam as a jet (the root that joins the steady links at both ends), and where it exists.

    `child` : for each kind of the actuator before, the kind of this one.
    """
    length = len(force)
    size = jets.square(force).sum(axis=1)
    along = jets.multiply(envelope[:length], force).sum(axis=1)
    inside = _taken(jets.square(along), child)
    size, along = _taken(size, child), _taken(along, child)
    gap = _taken(modulus2[:length], child) - before2[:length]
    inside = inside - jets.multiply(size, gap)
    feasible = np.all(inside[0] > 0, axis=1)
    inside[:, ~feasible] = 0.0
    inside[0, ~feasible] = 1.0
    return jets.divide(jets.square_root(inside) - along, size), feasible
