"""What a scene requires to be modelled: every term the simulator offers, its effect here, in or out, and its price."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import DEFLECTION, RUNGS, TERMS as STEADY_TERMS, VIBRATION, Device, Surroundings, load_rung

from ..errors import PlanError
from ..plan import FramePlan
from .scene_effects import TERMS, SceneEffects

__all__ = ["TERMS", "Requirement", "RequirementError", "Term", "require"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class RequirementError(PlanError, ValueError):
    """What a scene requires cannot be said.

    Examples: a tolerance that is not above 0; a scene without frames.
    """


@dataclass(frozen=True)
class Term:
    """One term of the model.

    Attributes
    ----------
    effect : how far the pattern would be off without it, at most, relative to the frame's largest amplitude.
    included : whether it has to be modelled.
    why : one sentence.
    cost : evaluations of one oscillator's equation that it adds to a linear model, alone.
    """

    name: str
    effect: float
    included: bool
    why: str
    cost: int


@dataclass(frozen=True)
class Requirement:
    """What one scene on one device requires.

    Attributes
    ----------
    tol : what everything left out may amount to together, relative.
    terms : in the order of `TERMS`.
    left_out : how much everything left out could matter together, at most.
    moving : whether anything vibrates.
    work, work_of_all : evaluations of one oscillator's equation, with what is included and with everything.
    """

    device: str
    tol: float
    terms: tuple[Term, ...]
    left_out: float
    moving: bool
    work: int
    work_of_all: int

    def __getitem__(self, name: str) -> Term:
        return {term.name: term for term in self.terms}[name]

    @property
    def included(self) -> frozenset[str]:
        """Names of what has to be modelled."""
        return frozenset(term.name for term in self.terms if term.included)

    @property
    def rung(self) -> str:
        """The cheapest steady rung that has every steady term which is required."""
        kind, required = VIBRATION if self.moving else DEFLECTION, self.included & STEADY_TERMS
        rungs = (load_rung(name) for name in RUNGS)
        return next(rung.name for rung in rungs if kind in rung.answers and required <= rung.models)

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        return {
            "device": self.device, "tol": self.tol, "rung": self.rung, "left_out": self.left_out, "work": self.work,
            "work_of_all": self.work_of_all, "terms": [vars(term) for term in self.terms],
        }  # fmt: skip

    def as_text(self) -> str:
        """A line for each term: name, effect, in or out, cost, why."""
        lines = [f"{'term':19} {'effect':>7}  {'':3} {'cost':>8}  why", *(_line(term) for term in self.terms)]
        saved = 1 - self.work / self.work_of_all if self.work_of_all else 0.0
        lines.append(
            f"For a tolerance of {self.tol:g} the rung {self.rung} will do; what is left out matters less than "
            f"{self.left_out:.1e} together and would have cost {_count(self.work_of_all - self.work)} of "
            f"{_count(self.work_of_all)} evaluations ({100 * saved:.0f} %)."
        )
        return "\n".join(lines)


def _line(term: Term) -> str:
    effect = f"{term.effect:.1e}" if term.effect < 1 else "over 1"
    included = "in" if term.included else "out"
    return f"{term.name:19} {effect:>7}  {included:3} {_count(term.cost):>8}  {term.why}"


def _count(number: int) -> str:
    for size, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if number >= size:
            return f"{number / size:.1f} {letter}"
    return str(number)


def require(frames: Iterable[FramePlan], device: Device, around: Surroundings, *, tol: float) -> Requirement:
    """Which terms of the model matter for planned frames, each by a closed form; nothing is solved or integrated.

    The terms with the least effect are left out as long as all of them together stay within `tol`.

    Parameters
    ----------
    frames : as in `Plan.frames`.
    around : what acts beside the profile; `assumed` has values.
    tol : relative to each frame's largest amplitude.

    Raises
    ------
    RequirementError
        When `tol` is not above 0 or there are no frames.
    """
    if not (math.isfinite(tol) and tol > 0):
        raise RequirementError(f"tol: expected a number > 0, got {tol}")
    seen = SceneEffects(device, around)
    for frame in frames:
        seen.add(frame)
    if not seen.frames:
        raise RequirementError("scene: expected at least one frame, got none")
    matters = seen.matters()
    included: set[str] = set(TERMS)
    left_out = 0.0
    for name in sorted(TERMS, key=lambda one: matters[one]):
        if left_out + matters[name] > tol:
            break
        left_out += matters[name]
        included.discard(name)
    # A harmonic of a cubic term that is not there.
    if "third harmonic" in included and "nonlinearity" not in included:
        included.add("nonlinearity")
    terms = tuple(
        Term(
            name,
            seen.effects[name],
            name in included,
            _why(name, seen),
            seen.work({name}) - seen.work(()),
        )
        for name in TERMS
    )
    return Requirement(device.name, tol, terms, left_out, seen.moving, seen.work(included), seen.work(set(TERMS)))


def _why(name: str, seen: SceneEffects) -> str:
    """One sentence."""
    around, device = seen.around, seen.device
    moving, largest = seen.moving, seen.largest
    share = 0.75 * abs(device.beta) * largest**2
    if name == "nonlinearity":
        return f"the largest amplitude {largest:.3g} changes the stiffness by {100 * share:.2g} %."
    if name == "third harmonic":
        return f"it is about {share / 24:.1e} of the first, and acts back by less." if moving else "nothing vibrates."
    if name == "transients":
        way = "a closed form, nothing is integrated" if not moving else "followed by its envelope"
        return f"the way in takes up to {100 * seen.ramp_share:.0f} % of a frame; {way}."
    if name == "preload":
        return _fingertip(around)
    if name == "hysteresis":
        return f"the piezo's loop takes up to {100 * around.hysteresis:.2g} % of every force; calibration absorbs most."
    if name == "creep":
        return (
            f"{100 * around.creep_per_decade:g} % a decade"
            + (" of a constant force, held for" if not moving else ", far slower than the vibration, over")
            + f" {seen.end_s:.3g} s."
        )
    if name == "higher modes":
        listed = ", ".join(f"{mode.omega * device.f0_hz:.0f} Hz" for mode in around.modes)
        return f"the tips also bend in {listed}." if listed else "none are given."
    if name == "2-D coupling":
        if device.grid:
            return "links downwards are the device's own, in every equation."
        return f"rows are coupled by {around.row_lam:g}." if around.row_lam else "no link joins two rows."
    if name == "amplifier dynamics":
        return f"{around.bandwidth:.3g} Hz of bandwidth for a drive near {device.f0_hz:.3g} Hz." if moving else (
            "a constant voltage passes any bandwidth."
        )  # fmt: skip
    return f"natural frequencies differ by {100 * around.spread.frequency:.2g} % (1 sigma), a resonance is " + (
        f"{100 * device.delta:.2g} % wide."
    )


def _fingertip(around: Surroundings) -> str:
    if not (around.preload or around.touch_stiffness or around.touch_damping):
        return "no fingertip presses."
    more = f"{around.touch_stiffness:g} more stiffness and {around.touch_damping:g} more damping on every actuator"
    return f"a constant force of {around.preload:g}" + (
        f", {more}." if around.touch_stiffness or around.touch_damping else "."
    )
