"""Any coupled oscillators in time: the composition of `splitting` for chains whose oscillators or links differ in kind.

``z_m'' + delta_m z_m' + k_m z_m`` is solved exactly; ``-beta_m z_m^3``, the inputs ``lam_m z_{m-1} + other_m
z_{m+stride}`` and every force are kicks at frozen positions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..equations.composition import FLOWS, KICKS
from ..equations.views import Network
from .splitting import flow

__all__ = ["advance_network", "flows_of"]

Floats = NDArray[np.float64]
Lanes = NDArray[np.int64]


@compiled
def flows_of(delta: float, stiffness: float, h: float) -> Floats:
    """Coefficients of the eight flows of one step of length `h`, shape (8, 3)."""
    found = np.empty((8, 3))
    for k in range(8):
        found[k, 0], found[k, 1], found[k, 2] = flow(delta, stiffness, FLOWS[k] * h)
    return found


@compiled
def _pull(q: Floats, network: Network, i: int, edge: int, force: Floats) -> None:
    """Write what setting `i` does to every oscillator besides its flow; `q` has `edge` numbers more at both ends."""
    n = len(force)
    if network.ring:
        q[edge - 1] = q[edge + n - 1]
    for m in range(n):
        x = q[edge + m]
        force[m] = (
            network.constant[i, m] + network.lam[i, m] * q[edge + m - 1]
            + network.other[i, m] * q[edge + m + network.stride] - network.beta[m] * x * x * x
        )  # fmt: skip


@compiled
def advance_network(
    state: Floats, lanes: Lanes, network: Network, table: Floats, first: int, count: int, peak: Floats
) -> None:
    """Advance the settings `lanes` by `count` steps from step `first` of the drive period, in place.

    Parameters
    ----------
    state : float64, shape (N, 2n), all q then all p (p = v + delta/2 z); changed in place.
    table : `forcing_table` of the steps per period.
    peak : float64, shape (N,), raised to the largest z^2 + p^2 of any oscillator at every eighth step.
    """
    n, edge = network.lam.shape[1], max(1, abs(network.stride))
    q, p, force, flows = np.zeros(n + 2 * edge), np.empty(n), np.empty(n), np.empty((8, 3, n))
    for j in range(len(lanes)):
        i = lanes[j]
        h = network.period[i] / table.shape[0]
        for m in range(n):
            q[edge + m], p[m] = state[i, m], state[i, n + m]
            flows[:, :, m] = flows_of(network.delta[m], network.stiffness[i, m], h)
        for step in range(first, first + count):
            phases = table[step % table.shape[0]]
            for k in range(8):
                for m in range(n):
                    x, y = q[edge + m], p[m]
                    q[edge + m] = flows[k, 0, m] * x + flows[k, 1, m] * y
                    p[m] = flows[k, 0, m] * y - flows[k, 2, m] * x
                if k < 7:
                    _pull(q, network, i, edge, force)
                    force[0] += network.drive[i, 0] * phases[k, 0] + network.drive[i, 1] * phases[k, 1]
                    for m in range(n):
                        p[m] += KICKS[k] * h * force[m]
            if step % 8 == 7:
                for m in range(n):
                    square = q[edge + m] * q[edge + m] + p[m] * p[m]
                    # NaN counts as larger than everything.
                    peak[i] = peak[i] if square <= peak[i] else square
        for m in range(n):
            state[i, m], state[i, n + m] = q[edge + m], p[m]
