"""What every term of the model does to the frames of a scene, and what it would cost to model it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Surroundings

from ..operating_point import OperatingPoint
from ..plan import FramePlan
from .effects import Linearisation, pattern_error

__all__ = ["TERMS", "SceneEffects"]

Complexes = NDArray[np.complex128]
Floats = NDArray[np.float64]

TERMS = (
    "nonlinearity", "third harmonic", "transients", "preload", "hysteresis", "creep", "higher modes", "2-D coupling",
    "amplifier dynamics", "spread",
)  # fmt: skip
"""The terms, in the order of the table."""

# First-order estimates know a small effect to a few parts in ten; twice it covers the rest.
SAFETY = 2.0

# Work, in evaluations of one oscillator's equation.
NEWTON, HARMONICS, DRAWS = 8, 64, 1000
# An integration: e-folds of settling per oscillator of a chain, steps per unit of tau, stages of a step.
EFOLDS, STEPS, STAGES = 4, 10, 4
INTEGRATED = frozenset({"hysteresis", "creep", "higher modes", "amplifier dynamics"})
# Terms that the known motion has in it already, or that only say when it stands.
PART_OF_THE_MOTION = frozenset({"nonlinearity", "third harmonic", "transients"})
# Chains of which what each term does is remembered.
MOST_KEPT = 4096


@dataclass
class SceneEffects:
    """Largest effects over the frames so far, and what the scene is made of.

    Attributes
    ----------
    effects : term -> how far the pattern would be off without it, relative to the frame's largest amplitude.
    frames : how many.
    ramp_share : largest part of a frame that its way in takes.
    end_s : length of the scene.
    """

    device: Device
    around: Surroundings
    effects: dict[str, float] = field(default_factory=lambda: dict.fromkeys(TERMS, 0.0))
    frames: int = 0
    ramp_share: float = 0.0
    end_s: float = 0.0
    _before: tuple[OperatingPoint, ...] = ()
    _ramp_tau: float = 0.0
    _standing: dict[bytes, Linearisation] = field(default_factory=dict)
    _alone: dict[tuple[bytes, float], dict[str, list[Complexes]]] = field(default_factory=dict)

    @property
    def moving(self) -> bool:
        """Whether anything vibrates."""
        return any(chain.moving for chain in self._standing.values())

    @property
    def largest(self) -> float:
        """Largest amplitude or deflection, dimensionless."""
        return max((chain.scale for chain in self._standing.values()), default=0.0)

    def add(self, plan: FramePlan) -> None:
        """Take one frame in."""
        self.end_s = plan.end_s
        keys = [_key(state) for state in plan.states]
        for key, state in zip(keys, plan.states, strict=True):
            self._standing.setdefault(key, Linearisation(self.device.chain, state))
        chains = [self._standing[key] for key in keys]
        scale = max(chain.scale for chain in chains)
        self._transient(plan, scale)
        self._before = plan.states
        self.frames += plan.frame is not None
        if scale > 0 and np.isfinite(scale):
            self._steady(plan, keys, chains, scale)

    def _steady(self, plan: FramePlan, keys: list[bytes], chains: list[Linearisation], scale: float) -> None:
        changes = [self._changes(key, state, plan.end_s) for key, state in zip(keys, plan.states, strict=True)]
        beside = self.device.chains_per_row
        for at, chain in enumerate(chains):
            changes[at]["2-D coupling"] = (
                chain.pulled(self.around.row_lam, chains[at - beside])
                if at >= beside and self.around.row_lam
                else chain.without_down()
            )
        for name in changes[0]:
            off = pattern_error(plan.states, chains, [each[name] for each in changes])
            self._note(name, off / scale, 1.0 if name == "nonlinearity" else SAFETY)
        for chain, state in zip(chains, plan.states, strict=True):
            phased = np.zeros(chain.chain.n, np.bool_) if state.phase is None else np.isfinite(state.phase)
            self._note("spread", float(chain.scattered(self.around.spread, phased).max()) / scale, SAFETY)

    def _note(self, name: str, effect: float, safety: float) -> None:
        effect = safety * effect if math.isfinite(effect) else math.inf
        self.effects[name] = max(self.effects[name], effect)

    def _changes(self, key: bytes, state: OperatingPoint, end_s: float) -> dict[str, list[Complexes]]:
        """How the lines of one chain change for each term; creep of a deflection grows with time."""
        known = key, 0.0 if state.moving else end_s
        if known not in self._alone:
            chain, around, device = self._standing[key], self.around, self.device
            bandwidth = around.bandwidth / device.f0_hz
            self._alone[known] = {
                "nonlinearity": chain.without_cubic(),
                "third harmonic": chain.without_third(),
                "preload": chain.pressed(around),
                "hysteresis": chain.with_hysteresis(around),
                "creep": chain.creeping(around, device.tau_per_s, end_s),
                "higher modes": chain.with_modes(around.modes),
                "amplifier dynamics": chain.through_amplifier(bandwidth, state.margins.slew),
            }
            self._alone = self._alone if len(self._alone) <= MOST_KEPT else {known: self._alone[known]}
        return dict(self._alone[known])

    def _transient(self, plan: FramePlan, scale: float) -> None:
        """Mean over the frame of what the pattern lacks on the way to it: half a smooth way, on average."""
        silence = np.zeros(self.device.chain_length)
        before = [_felt(state) for state in self._before] or [silence] * len(plan.states)
        for old, state, ramp in zip(before, plan.states, plan.ramps, strict=True):
            if ramp is None or scale == 0 or plan.frame is None:
                continue
            share = ramp.duration_s / (plan.end_s - plan.start_s)
            self.ramp_share = max(self.ramp_share, share)
            if state.moving:
                self._ramp_tau += ramp.duration_s * self.device.tau_per_s
            self._note("transients", 0.5 * share * float(np.abs(_felt(state) - old).max()) / scale, SAFETY)

    def matters(self) -> dict[str, float]:
        """The effects, each on a motion that the other terms have changed by as much as they can.

        A force grows with the motion, the cubic term with its third power; and a constant force changes a vibration
        through the cubic term alone.
        """
        others = sum(effect for name, effect in self.effects.items() if name not in PART_OF_THE_MOTION)
        growth = 1 + others / SAFETY
        found = {name: growth * effect for name, effect in self.effects.items()}
        for name in ("nonlinearity", "third harmonic"):
            found[name] *= growth**2
        found["nonlinearity"] += found["preload"]
        return found

    def work(self, included: Iterable[str]) -> int:
        """Evaluations of one oscillator's equation for the distinct chains of the scene."""
        wanted = set(included)
        n = self.device.chain_length
        resting = sum(chain.scale == 0 for chain in self._standing.values())
        moving = n * sum(chain.moving for chain in self._standing.values())
        solved = n * (len(self._standing) - resting)
        work = float(solved)
        if "nonlinearity" in wanted:
            work += NEWTON * solved
        if wanted & {"third harmonic", "preload"}:
            work += HARMONICS * moving
        if "2-D coupling" in wanted:
            work += NEWTON * max(self.device.rows * self.device.cols - solved, 0)
        if "spread" in wanted:
            work += DRAWS * NEWTON * solved
        if "transients" in wanted:
            work += STAGES * n * self._ramp_tau
        if wanted & INTEGRATED:
            # Closed forms for what stands still.
            work += self._integration(wanted) * moving + solved - moving
        return round(work)

    def _integration(self, wanted: set[str]) -> float:
        """Evaluations to integrate one oscillator until its chain has settled; fast terms need short steps."""
        rate = float(STEPS)
        if "higher modes" in wanted:
            rate = max([rate, *(mode.omega for mode in self.around.modes)])
        if "amplifier dynamics" in wanted and math.isfinite(self.around.bandwidth):
            rate = max(rate, self.around.bandwidth / self.device.f0_hz)
        return STAGES * rate * EFOLDS * (1 + self.device.chain_length) / self.device.delta


def _felt(state: OperatingPoint) -> Floats:
    """Amplitudes or deflections, the lines of a beat in step."""
    tones = [np.abs(tone.phasor) for tone in state.tones]
    return np.asarray(np.sum([np.abs(state.phasor + state.mean), *tones], axis=0))


def _key(state: OperatingPoint) -> bytes:
    numbers = [state.phasor.view(np.float64), state.mean, state.lam, state.bias, [state.omega]]
    numbers += [one.phasor.view(np.float64) for one in state.tones]
    return np.concatenate([np.asarray(part, dtype=np.float64).ravel() for part in numbers]).tobytes()
