"""How all chains of a device go from one pattern to the next: together where something is common to all of them."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import NamedTuple

import numpy as np

from chainsim import Outcome
from encoders import Frame, TargetPattern

from .memory import Ends, Memory
from .operating_point import OperatingPoint
from .plan import Ramp
from .targets import AmplitudeTarget, ChainTarget, DotGoal, targets_of

__all__ = ["USUAL", "ChainSteps", "Change", "Pace", "change_to", "moves_between", "usual"]

# All of 64 x 64 of a chain of six, which may be held in two ways, would fit.
MOST_STEPS = 1 << 14
# Chains of frames that are read ahead: 64 frames of six.
MOST_AHEAD = 384


class Pace(NamedTuple):
    """How chains go to a pattern.

    Attributes
    ----------
    length_s : how long all of their ways last, None: as short as is safe.
    awake : no chain rests from then on that can change amplitudes, so that what follows can change all of them.
    """

    length_s: float | None = None
    awake: bool = False


USUAL = Pace()


def usual(frame: Frame) -> Pace:
    """The pace of a frame of which nothing else is asked."""
    return USUAL


@dataclass(frozen=True)
class Change:
    """What every chain holds after a change, and its way there; row by row, chain by chain.

    Attributes
    ----------
    longest_s : seconds that the longest way takes; 0 where every chain stands.
    held : whether every chain can hold what it is to hold.
    lacking : one clause on what is lacking for the first way that cannot be gone, empty when all can.
    rings : whether it is known that a way leaves something that rings on.
    """

    targets: list[ChainTarget]
    states: tuple[OperatingPoint, ...]
    ramps: tuple[Ramp | None, ...]
    longest_s: float
    held: bool
    lacking: str
    rings: bool

    @classmethod
    def of(
        cls, targets: list[ChainTarget], states: tuple[OperatingPoint, ...], ramps: tuple[Ramp | None, ...]
    ) -> Change:
        """The change of these chains."""
        ways = [ramp for ramp in ramps if ramp is not None]
        return cls(
            targets, states, ramps,
            longest_s=max((way.duration_s for way in ways), default=0.0),
            held=all(state.outcome is Outcome.OK for state in states),
            lacking=next((way.lacking for way in ways if way.lacking), ""),
            rings=any(way.residue is not None for way in ways),
        )  # fmt: skip

    @property
    def made(self) -> bool:
        """Whether every chain can hold what it is to hold, and get there."""
        return self.held and not self.lacking


def change_to(
    memory: Memory, before: list[ChainTarget], after: list[ChainTarget], length_s: float | None = None
) -> Change:
    """The change from what chains hold to what they are to hold; `length_s` as in `Pace`."""
    device = memory.device
    if device.coupling.scope == "device" and device.chain_length > 1:
        after = _one_lam(memory, after)
    states = memory.states(after)
    if device.drive == "device":
        states = _one_drive(states)
    if any(state.outcome is not Outcome.OK for state in states):
        # What cannot be held is not played: no ways are looked for.
        return Change.of(after, tuple(states), (None,) * len(states))
    moves = moves_between(memory, before, after)
    # Where lam is common, all waves begin to rise together.
    common = device.coupling.scope == "device" and any(map(_wave, after))
    wait_s = memory.leaving_s(before, moves) if common and before != after else 0.0
    ramps = memory.ramps(before, after, moves, wait_s, length_s)
    if device.coupling.scope == "device" and device.chain_length > 1:
        return _all_alike(memory, before, Change.of(after, tuple(states), tuple(ramps)), moves)
    return Change.of(after, tuple(states), tuple(ramps))


def moves_between(memory: Memory, before: list[ChainTarget], after: list[ChainTarget]) -> bool:
    """Whether lam may differ on the way from what it is at the ends: one lam for all only if all go one way."""
    scope = memory.device.coupling.scope
    if scope != "device":
        return scope in ("chain", "link")
    ends = zip(map(_wave, before), map(_wave, after), strict=True)
    return len({way for way in ends if way != (None, None)}) <= 1


def _wave(target: ChainTarget) -> ChainTarget | None:
    """What moves under one lam, but for its turn; None for amplitudes at will."""
    return None if isinstance(target, AmplitudeTarget) else target.unturned


def _one_lam(memory: Memory, after: list[ChainTarget]) -> list[ChainTarget]:
    """Targets planned again under the lam of the first chain that is driven, where theirs differ."""
    driven = [state.lam[0] for state in memory.states(after) if state.moving]
    if len(set(driven)) < 2:
        return after
    return memory.under(after, float(driven[0]))


def _one_drive(states: list[OperatingPoint]) -> list[OperatingPoint]:
    """States as they are when all chains are driven like most of those that are driven."""
    driven = [(state.epsilon, state.omega) for state in states if state.moving]
    if not driven or (len(driven) == len(states) and len(set(driven)) == 1):
        return states
    ((common, _),) = Counter(driven).most_common(1)
    model = next(state for state in states if (state.epsilon, state.omega) == common)
    return [_driven_like(state, model) for state in states]


def _driven_like(state: OperatingPoint, model: OperatingPoint) -> OperatingPoint:
    scale = float(np.abs(model.phasor).max()) / max(float(model.target.max()), 1e-12)
    reached = np.abs(model.phasor) / scale
    away = np.abs(reached - state.target)
    if state.phase is not None:
        there = state.target * np.exp(1j * np.nan_to_num(state.phase))
        away = np.where(np.isnan(state.phase), away, np.abs(model.phasor / scale - there))
    return replace(
        model, target=state.target, phase=state.phase, error=float(away.max()), outcome=Outcome.UNREACHABLE,
        lacking="one drive is common to all chains, so they move alike; it lacks a drive per chain",
    )  # fmt: skip


def _all_alike(memory: Memory, before: list[ChainTarget], change: Change, moves: bool) -> Change:
    """Every chain under the one lam, resting ones too, on the way and after it."""
    old = memory.states(before)
    moving = [state for state in change.states if state.moving]
    still = [state for state in change.states if np.any(state.bias)]
    lams = {float(state.lam[0]) for state in (*moving, *still)}
    if len(lams) > 1:
        lacking = "one lam is common to all chains, and these take different ones; it lacks a lam per chain"
        states = tuple(
            replace(state, outcome=Outcome.UNREACHABLE, lacking=state.lacking or lacking) for state in change.states
        )
        return Change.of(change.targets, states, change.ramps)
    states = change.states
    if lams:
        lam = np.full(memory.device.chain_length - 1, lams.pop())
        idle = [not state.moving and not np.any(state.bias) for state in states]
        states = tuple(replace(state, lam=lam) if rests else state for state, rests in zip(states, idle, strict=True))
    changed = {float(state.lam[0]) for state in old if state.moving or np.any(state.bias)} | {
        float(state.lam[0]) for state in states if state.moving or np.any(state.bias)
    }
    ramps = change.ramps
    if not moves and len(changed) > 1:
        lacking = "one lam is common to all chains, and they go different ways; it lacks a lam per chain"
        ramps = tuple(None if ramp is None else replace(ramp, lacking=ramp.lacking or lacking) for ramp in ramps)
    model = next((ramp for ramp in ramps if ramp is not None and ramp.lam is not None), None)
    if model is not None and moves:
        along = Ramp(t_s=model.t_s, lam_t_s=model.lam_t_s, lam=model.lam)
        ramps = tuple(along if ramp is None else ramp for ramp in ramps)
    return Change.of(change.targets, states, ramps)


@dataclass(frozen=True, eq=False, slots=True)
class _Held:
    """What a chain of a kind holds; one object for each, so that it is found by what it is."""

    kind: int
    target: ChainTarget


class _Step(NamedTuple):
    """What one chain holds after a change, and its way there."""

    held: _Held
    state: OperatingPoint
    ramp: Ramp | None
    duration_s: float
    rings: bool


class ChainSteps:
    """In front of a memory: changes of patterns, put together from what every chain did before where it did.

    A book brings the same ones again.

    Only changes that could be made are remembered, and only where no lam and no drive is common to all chains: there
    what a chain does depends on the others.
    """

    def __init__(self, memory: Memory) -> None:
        device = memory.device
        self._memory = memory
        self._kinds = memory.kinds_at
        self._apart = device.coupling.scope != "device" and device.drive != "device"
        self._chains: dict[tuple[int, ChainTarget], _Held] = {}
        self._known: dict[Pace, dict[tuple[_Held, ChainTarget | bytes], _Step]] = {}

    def change(
        self, before: list[ChainTarget], pattern: TargetPattern, dots: DotGoal | None = None, pace: Pace = USUAL
    ) -> Change:
        """The change from what chains hold to a pattern; `dots` as in `targets_of`."""
        steps = self._steps(self._held(before), pattern, dots, pace)
        return self._made(before, pattern, dots, pace) if steps is None else _joined(steps)

    def through(
        self, frames: Iterable[Frame], pace_of: Callable[[Frame], Pace] = usual
    ) -> Iterator[tuple[Frame, Change]]:
        """Frames one after another, from rest, and the change to each; what some of them bring is planned at once.

        What cannot be held is not played, and the frame after it begins at rest.
        """
        held = self._held(self._memory.at_rest)
        left, size = iter(frames), 1
        while some := [(frame, pace_of(frame)) for frame in islice(left, size)]:
            planned = False
            for place, (frame, pace) in enumerate(some):
                steps = self._steps(held, frame.pattern, None, pace)
                if steps is not None:
                    held = [step.held for step in steps]
                    yield frame, _joined(steps)
                    continue
                if not planned:
                    self._plan(held, some[place:])
                    planned = True
                change = self._made([chain.target for chain in held], frame.pattern, None, pace)
                yield frame, change
                held = self._held(change.targets if change.held else self._memory.at_rest)
            # The first frames are not waited for long.
            size = min(2 * size, max(1, MOST_AHEAD // len(self._kinds)))

    def _held(self, targets: Iterable[ChainTarget]) -> list[_Held]:
        chains = self._chains
        if max(len(chains), sum(map(len, self._known.values()))) >= MOST_STEPS:
            chains.clear()
            self._known.clear()
        return [
            chains.get(chain) or chains.setdefault(chain, _Held(*chain))
            for chain in zip(self._kinds, targets, strict=True)
        ]

    def _steps(
        self, held: Sequence[_Held], pattern: TargetPattern, dots: DotGoal | None, pace: Pace
    ) -> list[_Step] | None:
        """What every chain did before for a pattern; None where one has yet to do it."""
        known = self._known.setdefault(pace, {})
        try:
            return [known[step] for step in zip(held, self._wishes(pattern, dots), strict=True)]
        except KeyError:
            return None

    def _wishes(self, pattern: TargetPattern, dots: DotGoal | None) -> Sequence[ChainTarget | bytes]:
        """What tells one wish for a chain from another: of plain patterns their bytes, which is quicker."""
        if dots is not None or not pattern.plain:
            return targets_of(pattern, self._memory.device, dots)
        raw = pattern.amplitude.tobytes()
        size = len(raw) // len(self._kinds)
        return [raw[at : at + size] for at in range(0, len(raw), size)]

    def _plan(self, held: Sequence[_Held], frames: Sequence[tuple[Frame, Pace]]) -> None:
        """Plan the ways that frames one after another bring and that are new."""
        if not self._apart:
            return
        memory, new = self._memory, defaultdict[float | None, list[Ends]](list)
        for frame, pace in frames:
            steps = self._steps(held, frame.pattern, None, pace)
            if steps is not None:
                held = [step.held for step in steps]
                continue
            before = [chain.target for chain in held]
            after = memory.hold(frame.pattern, before, awake=pace.awake)
            new[pace.length_s].append((before, after))
            held = self._held(after)
        for length_s, changes in new.items():
            memory.prepare_ways(changes, moves_between(memory, [], []), length_s)

    def _made(self, before: list[ChainTarget], pattern: TargetPattern, dots: DotGoal | None, pace: Pace) -> Change:
        """The change worked out."""
        after = self._memory.hold(pattern, before, dots, pace.awake)
        change = change_to(self._memory, before, after, pace.length_s)
        if self._apart and change.made:
            ends = zip(self._held(before), self._wishes(pattern, dots), strict=True)
            chains = zip(ends, self._held(change.targets), change.states, change.ramps, strict=True)
            known = self._known.setdefault(pace, {})
            for ask, held, state, ramp in chains:
                duration_s, rings = (0.0, False) if ramp is None else (ramp.duration_s, ramp.residue is not None)
                known[ask] = _Step(held, state, ramp, duration_s, rings)
        return change


def _joined(steps: Sequence[_Step]) -> Change:
    """The change that chains make together."""
    held, states, ramps, durations_s, rings = zip(*steps, strict=True)
    return Change([chain.target for chain in held], states, ramps, max(durations_s), True, "", any(rings))
