"""Steady motions of several tones in many slightly different open chains at once, in the slow flow.

With ``A_m = sum_k c_mk e^{i omega_k tau}``, omega_k equally spaced, each stage asks

    (k_m + lam_m - omega_k^2 + i delta_m omega_k) c_mk + (3/4) beta_m [|A_m|^2 A_m]_k = f_k or lam_m c_{m-1,k},

as `two_tones` does for equal oscillators; combinations that no tone given stands for are left out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..operating_point import OperatingPoint
from .batch_march import BatchParts

__all__ = ["ToneMotion", "march_tones"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Bools = NDArray[np.bool_]

POINTS = 32
# Steps at most, the change that ends them (relative to the largest amplitude), and how far spacings may differ.
STEPS, MET, SAME = 200, 1e-9, 1e-6


class ToneMotion(NamedTuple):
    """What a batch of chains does.

    phasor : complex128, shape (K, n, count), of the tones by frequency. wanted : bool, shape (K,), those that are not
    side tones. lost : bool, shape (count,), no steady motion of these tones was found, or it leaves the well; the
    phasors are 0 then.
    """

    phasor: Complexes
    wanted: Bools
    lost: Bools


def march_tones(state: OperatingPoint, parts: BatchParts) -> ToneMotion:
    """The motion of one chain that holds a state of several tones; `parts` of shape (n, count).

    Raises
    ------
    ValueError
        When the tones are not equally spaced.
    """
    every = sorted([(state.omega, state.epsilon, True), *((t.omega, t.epsilon, not t.side) for t in state.tones)])
    omega = np.array([one[0] for one in every])
    drive = np.array([one[1] for one in every])[:, None]
    spacing = float(np.diff(omega).min())
    orders = np.rint((omega - omega[0]) / spacing)
    if np.abs(omega - omega[0] - orders * spacing).max() > SAME * spacing * max(orders[-1], 1.0):
        raise ValueError(f"tones at {omega.tolist()}: expected equal spacings")
    turns = np.exp(2j * np.pi * np.outer(np.arange(POINTS), orders) / POINTS)
    links = np.append(0.0, state.lam)[:, None] * parts.lam_gain
    count, n = parts.delta.shape[1], len(links)
    phasor = np.zeros((len(omega), n, count), dtype=np.complex128)
    lost = np.zeros(count, dtype=np.bool_)
    push = np.repeat(drive, count, axis=1).astype(np.complex128)
    for m in range(n):
        stiff = parts.stiffness[m] + links[m]
        linear = stiff - omega[:, None] ** 2 + 1j * parts.delta[m] * omega[:, None]
        phasor[:, m], met = _stage(linear, 0.75 * parts.beta[m], push, turns)
        highest = np.abs(phasor[:, m]).sum(axis=0) ** 2
        lost |= ~met | ((parts.beta[m] < 0) & (highest * -parts.beta[m] >= stiff))
        push = links[m + 1] * phasor[:, m] if m + 1 < n else push
    phasor[:, :, lost] = 0.0
    return ToneMotion(phasor, np.array([one[2] for one in every]), lost)


def _stage(linear: Complexes, cubic: Floats, push: Complexes, turns: Complexes) -> tuple[Complexes, Bools]:
    """The tones of one oscillator, complex128, shape (K, count), and where they were found; by corrections.

    What a tone's own amplitude and the others' make of its stiffness is taken to the left side, which leaves little.
    """
    found = push / linear
    busy = np.arange(push.shape[1])
    for _ in range(STEPS):
        here = found[:, busy]
        motion = turns @ here
        shift = 2 * cubic[busy] * np.sum(np.abs(here) ** 2, axis=0)
        bend = cubic[busy] * (turns.conj().T @ (np.abs(motion) ** 2 * motion)) / len(turns)
        after = (push[:, busy] - bend + shift * here) / (linear[:, busy] + shift)
        moving = ~(np.abs(after - here).max(axis=0) <= MET * np.abs(after).max(axis=0))
        found[:, busy] = after
        busy = busy[moving & (np.abs(after).max(axis=0) < 1 / MET)]
        if not len(busy):
            break
    met: Bools = np.asarray(np.abs(found).max(axis=0) < 1 / MET)
    met[busy] = False
    return found, met
