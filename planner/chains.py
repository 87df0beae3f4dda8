"""States and ramps of chains by what is wished of them, each planned once: in this run, and from the cache in any."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chainsim import Closure, Device, Outcome
from encoders import TargetPattern

from .cache import PlanCache
from .families import strategy_for
from .held import Held
from .plan import ChainState, Margins, Ramp
from .strategy import Strategy
from .transitions.joining import as_tone, joined, rest_for, turned_ramp, turned_state
from .wish import ChainWish, Turned, wishes_of

__all__ = ["Chains", "Held"]

Floats = NDArray[np.float64]

# Kept in memory of each: all 64 x 64 ramps of a chain of six would fit.
MOST_RAMPS = MOST_STATES = 4096


@dataclass(frozen=True)
class _Pair:
    """A way from one wish to another; `moves` where lam may differ on it from both ends."""

    before: bytes
    after: bytes
    moves: bool

    @property
    def item(self) -> bytes:
        return b"ramp%d" % self.moves + len(self.before).to_bytes(4, "little") + self.before + self.after


class Chains:
    """What the chains of a device do for patterns."""

    def __init__(self, device: Device, contrast_db: float, whole: Chains | None = None, kind: int = 0) -> None:
        """`whole` : the chains of the device that `device` is one chain of, of this `kind`."""
        self.device = device
        self._contrast_db, self._whole, self._kind = contrast_db, whole, kind
        self._cache: PlanCache = PlanCache(device, contrast_db, None if whole is None else whole._cache)
        self._states: dict[bytes, ChainState] = {}
        self._turned: dict[Held, ChainState] = {}
        self._ramps: dict[_Pair, Ramp | None] = {}
        self._turned_ramps: dict[tuple[Held, Held, bool, float], Ramp | None] = {}
        self._wishes: dict[tuple[bytes, bool], bytes] = {}

    @cached_property
    def strategy(self) -> Strategy | None:
        """The way to make amplitudes at will; None where the device has none."""
        whole = None if self._whole is None else self._whole.strategy
        return strategy_for(self.device, self._contrast_db, whole=whole)

    @property
    def rest(self) -> Held:
        """What a chain holds that has nothing to do."""
        return Held(bytes(8 * self.device.chain_length), kind=self._kind)

    @property
    def at_rest(self) -> list[Held]:
        """All chains of the device at rest."""
        return [self.rest] * (self.device.rows * self.device.chains_per_row)

    def hold(self, pattern: TargetPattern, before: list[Held]) -> list[Held]:
        """What chains hold for a pattern, given what they held."""
        wishes = wishes_of(pattern, self.device)
        held = [self._hold(wish, one) for wish, one in zip(wishes, before, strict=True)]
        self._plan([one.key for one in held])
        return held

    def _hold(self, wish: Turned, before: Held) -> Held:
        if isinstance(wish.wish, ChainWish):
            return Held(wish.wish.key, wish.turn, self._kind)
        started = ChainWish.of_key(before.key) is None and any(before.key)
        ask = (wish.wish.tobytes(), started)
        if ask not in self._wishes:
            if len(self._wishes) >= MOST_STATES:
                self._wishes.clear()
            self._wishes[ask] = self._wished(wish.wish, started)
        key = self._wishes[ask]
        return Held(key, wish.turn if any(key) else 0.0, self._kind)

    def _wished(self, amplitude: Floats, started: bool) -> bytes:
        if self.strategy is not None:
            return np.ascontiguousarray(self.strategy.held(amplitude, started), dtype=np.float64).tobytes()
        if not np.any(amplitude):
            return amplitude.tobytes()
        n = len(amplitude)
        return ChainWish(amplitude, np.full(n, np.nan), np.ones(n)).key

    def state(self, held: Held) -> ChainState:
        """The state for what is held."""
        if held not in self._turned:
            if len(self._turned) >= MOST_STATES:
                self._turned.clear()
            self._plan([held.key])
            self._turned[held] = turned_state(self._states[held.key], held.turn)
        return self._turned[held]

    @staticmethod
    def waving(held: Held) -> bytes:
        """The key of a wave; empty for amplitudes made otherwise."""
        return b"" if ChainWish.of_key(held.key) is None else held.key

    def under(self, held: Held, lam: float) -> Held:
        """What is held, with its links given."""
        wish = ChainWish.of_key(held.key)
        return held if wish is None else held._replace(key=replace(wish, lam=lam).key)

    def _plan(self, keys: list[bytes]) -> None:
        wanted = list(dict.fromkeys(keys))
        keys = [key for key in wanted if key not in self._states]
        if keys and len(self._states) + len(keys) > MOST_STATES:
            self._states.clear()
            keys = wanted
        found = self._cache.find([b"state" + key for key in keys]) if keys else []
        self._states.update((key, state) for key, state in zip(keys, found, strict=True) if state is not None)
        missing = [key for key, state in zip(keys, found, strict=True) if state is None]
        if missing:
            made = self._made(missing)
            self._states.update(made)
            self._cache.keep((b"state" + key, state) for key, state in made.items())

    def _made(self, keys: list[bytes]) -> dict[bytes, ChainState]:
        plain = [key for key in keys if len(key) == 8 * self.device.chain_length]
        made: dict[bytes, ChainState] = {}
        if plain and self.strategy is not None:
            targets = np.array([np.frombuffer(key) for key in plain])
            made.update(zip(plain, self.strategy.states(targets), strict=True))
        elif plain:
            made.update((key, _resting(self.device, np.frombuffer(key))) for key in plain)
        for key in keys:
            if key not in made:
                made[key] = self._wave(key)
        return made

    def _wave(self, key: bytes) -> ChainState:
        from .waves.walking import walking_state
        from .waves.wave_state import wave_state

        wish = ChainWish.of_key(key)
        assert wish is not None
        return walking_state(self.device, wish) if wish.width else wave_state(self.device, wish)

    def ramp(self, before: Held, after: Held, moves: bool, wait_s: float = 0.0) -> Ramp | None:
        """The way from one to the other; None where a chain already stands.

        `wait_s` : how many seconds after the start a wave begins to rise at the earliest.
        """
        ask = (before, after, moves, wait_s)
        if before == after:
            return None
        if ask not in self._turned_ramps:
            if len(self._turned_ramps) >= MOST_RAMPS:
                self._turned_ramps.clear()
            self._turned_ramps[ask] = self._way(before, after, moves, wait_s)
        return self._turned_ramps[ask]

    def leaving_s(self, before: Held, moves: bool) -> float:
        """Seconds that a chain takes to come to rest."""
        ramp = self.ramp(before, self.rest, moves)
        return 0.0 if ramp is None else ramp.duration_s

    def _way(self, before: Held, after: Held, moves: bool, wait_s: float) -> Ramp | None:
        rest = self.rest.key
        direct = before.turn == after.turn or rest in (before.key, after.key)
        plain = ChainWish.of_key(before.key) is None and ChainWish.of_key(after.key) is None
        if (plain and direct) or after.key == rest or (before.key == rest and not wait_s):
            pair = _Pair(before.key, after.key, moves)
            self._go([pair])
            ramp = self._ramps[pair]
            return None if ramp is None else turned_ramp(ramp, before.turn if after.key == rest else after.turn)
        ends = self.state(before), self.state(after)
        still = Ramp(t_s=np.zeros(1))
        out = still if before.key == rest else self._way(before, self.rest, moves, 0.0)
        back = self._way(self.rest, after, moves, 0.0)
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

    def prepare(self, pairs: list[tuple[Held, Held]], moves: bool) -> None:
        """Plan many ways between amplitudes at once, which is quicker than one by one."""
        if self.strategy is None:
            return
        size = 8 * self.device.chain_length
        wanted = (
            _Pair(one.key, other.key, moves)
            for one, other in pairs
            if one.key != other.key and len(one.key) == len(other.key) == size and one.turn == other.turn
        )
        self._go(list(dict.fromkeys(wanted)))

    def _go(self, pairs: list[_Pair]) -> None:
        missing = [pair for pair in pairs if pair not in self._ramps]
        if not missing:
            return
        if len(self._ramps) + len(missing) > MOST_RAMPS:
            self._ramps.clear()
            missing = pairs
        found = self._cache.find([pair.item for pair in missing])
        self._ramps.update((pair, ramp) for pair, ramp in zip(missing, found, strict=True) if ramp is not None)
        new = [pair for pair, ramp in zip(missing, found, strict=True) if ramp is None]
        if new:
            made = dict(zip(new, self._ways(new), strict=True))
            self._ramps.update(made)
            self._cache.keep((pair.item, ramp) for pair, ramp in made.items() if ramp is not None)

    def _ways(self, pairs: list[_Pair]) -> list[Ramp | None]:
        size = 8 * self.device.chain_length
        plain = [len(pair.before) == len(pair.after) == size for pair in pairs]
        if all(plain) and self.strategy is not None:
            before = [self.state(Held(pair.before)) for pair in pairs]
            return self.strategy.ramps(before, [self.state(Held(pair.after)) for pair in pairs])
        return [self._wave_way(pair) for pair in pairs]

    def _wave_way(self, pair: _Pair) -> Ramp | None:
        from .transitions.waves import enter_wave, leave_wave

        enters = pair.before == self.rest.key
        state = self.state(Held(pair.after if enters else pair.before))
        # What cannot be held is not played.
        if state.outcome is not Outcome.OK or not state.epsilon:
            return None
        return (enter_wave if enters else leave_wave)(self.device, state, pair.moves)


def _resting(device: Device, target: Floats) -> ChainState:
    n = device.chain_length
    silence = np.zeros(n, dtype=np.complex128)
    return ChainState(
        target=target, epsilon=0j, lam=np.full(n - 1, device.coupling.lam.min), bias=np.zeros(n), omega=1.0,
        phasor=silence, mean=np.zeros(n), error=0.0, margins=Margins(0.0, 0.0), outcome=Outcome.OK,
    )  # fmt: skip
