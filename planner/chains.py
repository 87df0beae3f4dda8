"""States and ramps of chains by what is wanted of them, each planned once: in this run, and from the cache in any."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from chainsim import Closure, Device, Outcome
from encoders import TargetPattern

from .cache import PlanCache
from .families import strategy_for
from .operating_point import Margins, OperatingPoint
from .plan import Ramp
from .strategy import Strategy
from .targets import AmplitudeTarget, ChainTarget, WalkingTarget, WaveTarget, targets_of
from .transitions.joining import as_tone, joined, rest_for, turned_ramp, turned_state

__all__ = ["Chains"]

# Kept in memory of each: all 64 x 64 ramps of a chain of six would fit.
MOST_RAMPS = MOST_STATES = 4096


@dataclass(frozen=True)
class _Pair:
    """From one target to another, neither of them turned; `moves` where lam may differ on the way from both ends."""

    before: ChainTarget
    after: ChainTarget
    moves: bool

    @property
    def plain(self) -> bool:
        """Whether it leads between amplitudes at will."""
        return isinstance(self.before, AmplitudeTarget) and isinstance(self.after, AmplitudeTarget)

    @property
    def item(self) -> bytes:
        return b"ramp%d" % self.moves + self.before.key + b" to " + self.after.key


class Chains:
    """What the chains of a device do for patterns; in lists of targets, states and ramps they go row by row."""

    def __init__(self, device: Device, contrast_db: float, whole: Chains | None = None) -> None:
        """`whole` : the chains of the device that `device` is one chain of."""
        self.device = device
        self._contrast_db, self._whole = contrast_db, whole
        self._cache: PlanCache = PlanCache(device, contrast_db, None if whole is None else whole._cache)
        self._states: dict[ChainTarget, OperatingPoint] = {}
        self._turned: dict[ChainTarget, OperatingPoint] = {}
        self._ramps: dict[_Pair, Ramp | None] = {}
        self._turned_ramps: dict[tuple[ChainTarget, ChainTarget, bool, float], Ramp | None] = {}
        self._targets: dict[tuple[AmplitudeTarget, bool], ChainTarget] = {}

    @cached_property
    def strategy(self) -> Strategy | None:
        """The way to make amplitudes at will; None where the device has none."""
        whole = None if self._whole is None else self._whole.strategy
        return strategy_for(self.device, self._contrast_db, whole=whole)

    @cached_property
    def rest(self) -> ChainTarget:
        """What a chain holds that has nothing to do."""
        return AmplitudeTarget((0.0,) * self.device.chain_length)

    @property
    def at_rest(self) -> list[ChainTarget]:
        """All chains of the device at rest."""
        return [self.rest] * (self.device.rows * self.device.chains_per_row)

    def hold(self, pattern: TargetPattern, before: Sequence[ChainTarget]) -> list[ChainTarget]:
        """What chains hold for a pattern, given what they held."""
        targets = list(map(self.held, targets_of(pattern, self.device), before))
        self.prepare(targets)
        return targets

    def held(self, target: ChainTarget, before: ChainTarget) -> ChainTarget:
        """What a chain holds for a target, given what it held."""
        if not isinstance(target, AmplitudeTarget):
            return target
        ask = (target.unturned, isinstance(before, AmplitudeTarget) and not before.resting)
        if ask not in self._targets:
            if len(self._targets) >= MOST_STATES:
                self._targets.clear()
            self._targets[ask] = self._held(*ask)
        return self._targets[ask].turned(target.turn)

    def _held(self, target: AmplitudeTarget, started: bool) -> ChainTarget:
        if self.strategy is not None:
            return AmplitudeTarget.of(self.strategy.held(target.levels, started))
        n = len(target.amplitude)
        return target if target.resting else WaveTarget(target.amplitude, phase=(None,) * n, weight=(1.0,) * n)

    def states(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        """The states for what chains hold."""
        return list(map(self.state, targets))

    def state(self, target: ChainTarget) -> OperatingPoint:
        """The state for what a chain holds."""
        if target not in self._turned:
            if len(self._turned) >= MOST_STATES:
                self._turned.clear()
            self.prepare([target])
            self._turned[target] = turned_state(self._states[target.unturned], target.turn)
        return self._turned[target]

    def under(self, targets: Sequence[ChainTarget], lam: float) -> list[ChainTarget]:
        """What chains hold, with their links given."""
        return [target.under(lam) for target in targets]

    def prepare(self, targets: Iterable[ChainTarget]) -> None:
        """Plan what chains hold for many targets at once, which is quicker than one by one."""
        wanted = list(dict.fromkeys(target.unturned for target in targets))
        targets = [target for target in wanted if target not in self._states]
        if targets and len(self._states) + len(targets) > MOST_STATES:
            self._states.clear()
            targets = wanted
        known = self._cache.find([b"state" + target.key for target in targets]) if targets else []
        self._states.update((target, state) for target, state in zip(targets, known, strict=True) if state is not None)
        missing = [target for target, state in zip(targets, known, strict=True) if state is None]
        if missing:
            made = self._made(missing)
            self._states.update(made)
            self._cache.keep((b"state" + target.key, state) for target, state in made.items())

    def _made(self, targets: list[ChainTarget]) -> dict[ChainTarget, OperatingPoint]:
        plain = [target for target in targets if isinstance(target, AmplitudeTarget)]
        made: dict[ChainTarget, OperatingPoint] = {}
        if plain and self.strategy is not None:
            levels = np.array([target.amplitude for target in plain])
            made.update(zip(plain, self.strategy.states(levels), strict=True))
        elif plain:
            made.update((target, _resting(self.device, target)) for target in plain)
        for target in targets:
            if target not in made:
                made[target] = self._wave(target)
        return made

    def _wave(self, target: ChainTarget) -> OperatingPoint:
        from .waves.walking import walking_state
        from .waves.wave_state import wave_state

        if isinstance(target, WalkingTarget):
            return walking_state(self.device, target)
        assert isinstance(target, WaveTarget)
        return wave_state(self.device, target)

    def ramps(
        self, before: Sequence[ChainTarget], after: Sequence[ChainTarget], moves: bool, wait_s: float
    ) -> list[Ramp | None]:
        """The ways from one to the other; None where a chain already stands.

        `wait_s` : how many seconds after the start a wave begins to rise at the earliest.
        """
        pairs = list(zip(before, after, strict=True))
        self.prepare_ramps(pairs, moves)
        return [self.ramp(one, other, moves, wait_s) for one, other in pairs]

    def ramp(self, before: ChainTarget, after: ChainTarget, moves: bool, wait_s: float = 0.0) -> Ramp | None:
        """The way of one chain, as in `ramps`."""
        ask = (before, after, moves, wait_s)
        if before == after:
            return None
        if ask not in self._turned_ramps:
            if len(self._turned_ramps) >= MOST_RAMPS:
                self._turned_ramps.clear()
            self._turned_ramps[ask] = self._way(before, after, moves, wait_s)
        return self._turned_ramps[ask]

    def leaving_s(self, targets: Sequence[ChainTarget], moves: bool) -> float:
        """Seconds until all these chains have come to rest."""
        ramps = (self.ramp(target, self.rest, moves) for target in targets)
        return max((ramp.duration_s for ramp in ramps if ramp is not None), default=0.0)

    def _way(self, before: ChainTarget, after: ChainTarget, moves: bool, wait_s: float) -> Ramp | None:
        rest = self.rest
        pair = _Pair(before.unturned, after.unturned, moves)
        direct = before.turn == after.turn or rest in (before, after)
        if (pair.plain and direct) or after == rest or (before == rest and not wait_s):
            self._go([pair])
            ramp = self._ramps[pair]
            return None if ramp is None else turned_ramp(ramp, before.turn if after == rest else after.turn)
        ends = self.state(before), self.state(after)
        still = Ramp(t_s=np.zeros(1))
        out = still if before == rest else self._way(before, rest, moves, 0.0)
        back = self._way(rest, after, moves, 0.0)
        if out is None or back is None:
            return out or back
        out = as_tone(out, ends[0].omega)
        out = rest_for(out, wait_s - out.duration_s)

        def whole(rest_s: float) -> Ramp:
            return joined(rest_for(out, rest_s), back, *ends)

        one_tone = not (ends[0].tones or ends[1].tones) and bool(ends[0].epsilon) and bool(ends[1].epsilon)
        if one_tone and self.device.chain_length > 1 and self.device.coupling.closure is Closure.OPEN:
            from .transitions.rest_between import rested

            return rested(self.device, *ends, whole)
        return whole(0.0)

    def prepare_ramps(self, pairs: Iterable[tuple[ChainTarget, ChainTarget]], moves: bool) -> None:
        """Plan many ways between amplitudes at once, which is quicker than one by one."""
        if self.strategy is None:
            return
        wanted = (
            _Pair(one.unturned, other.unturned, moves)
            for one, other in pairs
            if one.turn == other.turn and one != other
        )
        self._go([pair for pair in dict.fromkeys(wanted) if pair.plain])

    def _go(self, pairs: list[_Pair]) -> None:
        missing = [pair for pair in pairs if pair not in self._ramps]
        if not missing:
            return
        if len(self._ramps) + len(missing) > MOST_RAMPS:
            self._ramps.clear()
            missing = pairs
        known = self._cache.find([pair.item for pair in missing])
        self._ramps.update((pair, ramp) for pair, ramp in zip(missing, known, strict=True) if ramp is not None)
        new = [pair for pair, ramp in zip(missing, known, strict=True) if ramp is None]
        if new:
            made = dict(zip(new, self._ways(new), strict=True))
            self._ramps.update(made)
            self._cache.keep((pair.item, ramp) for pair, ramp in made.items() if ramp is not None)

    def _ways(self, pairs: list[_Pair]) -> list[Ramp | None]:
        if all(pair.plain for pair in pairs) and self.strategy is not None:
            before = [self.state(pair.before) for pair in pairs]
            return self.strategy.ramps(before, [self.state(pair.after) for pair in pairs])
        return [self._wave_way(pair) for pair in pairs]

    def _wave_way(self, pair: _Pair) -> Ramp | None:
        from .transitions.waves import enter_wave, leave_wave

        enters = pair.before == self.rest
        state = self.state(pair.after if enters else pair.before)
        # What cannot be held is not played.
        if state.outcome is not Outcome.OK or not state.epsilon:
            return None
        return (enter_wave if enters else leave_wave)(self.device, state, pair.moves)


def _resting(device: Device, target: ChainTarget) -> OperatingPoint:
    n = device.chain_length
    silence = np.zeros(n, dtype=np.complex128)
    return OperatingPoint(
        target=target.levels, epsilon=0j, lam=np.full(n - 1, device.coupling.lam.min), bias=np.zeros(n), omega=1.0,
        phasor=silence, mean=np.zeros(n), error=0.0, margins=Margins(0.0, 0.0), outcome=Outcome.OK,
    )  # fmt: skip
