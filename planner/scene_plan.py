"""A scene on a device: frames planned one after another, with memory that does not grow with their number."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome
from encoders import Frame, Scene

from .cache import PlanCache
from .errors import DwellTooShort, SceneDoesNotFit
from .plan import ChainState, FramePlan, Plan, Ramp
from .strategy import Strategy, strategy_for

__all__ = ["DEFAULT_CONTRAST_DB", "plan_scene"]

Floats = NDArray[np.float64]

DEFAULT_CONTRAST_DB = 20.0
# Ramps kept in memory: all 64 x 64 of a chain of six would fit.
MOST_RAMPS = 4096


def plan_scene(scene: Scene, device: Device, *, contrast_db: float = DEFAULT_CONTRAST_DB) -> Plan:
    """Plan `scene` on `device`; the work is done as `Plan.frames` is read.

    Parameters
    ----------
    contrast_db : how far an unraised dot of a vibrating chain stays below a raised one.

    Raises
    ------
    SceneDoesNotFit
        When the scene was laid out for another grid.
    """
    shape = (scene.shape.rows, scene.shape.cols)
    if shape != (device.rows, device.cols):
        raise SceneDoesNotFit(
            f"the scene is laid out for {shape[0]} x {shape[1]} actuators, "
            f"{device.name} has {device.rows} x {device.cols}"
        )
    return Plan(device, _Frames(scene, device, contrast_db), scene.encoding)


class _Frames:
    """The planned frames of a scene, as often as they are asked for."""

    def __init__(self, scene: Scene, device: Device, contrast_db: float) -> None:
        self._scene = scene
        self._chains = _Chains(strategy_for(device, contrast_db), PlanCache(device, contrast_db))
        self._device = device

    def __iter__(self) -> Iterator[FramePlan]:
        device, chains = self._device, self._chains
        rate = device.amplifier.rate_hz
        keys = [bytes(8 * device.chain_length)] * (device.rows * device.chains_per_row)
        position = 0
        for frame in self._scene.frames:
            wishes = np.abs(frame.pattern.amplitude).reshape(-1, device.chain_length)
            before, keys = keys, chains.held(wishes, keys)
            ramps = chains.ramps(before, keys)
            samples = max(1, round(frame.dwell_s * rate))
            yield self._frame(frame, position, samples, keys, ramps)
            position += samples
        silence = [bytes(8 * device.chain_length)] * len(keys)
        ramps = chains.ramps(keys, silence)
        if any(ramp is not None for ramp in ramps):
            yield self._frame(None, position, int(chains.strategy.ramp_s * rate) + 2, silence, ramps)

    def _frame(
        self, frame: Frame | None, position: int, samples: int, keys: list[bytes], ramps: list[Ramp | None]
    ) -> FramePlan:
        rate = self._device.amplifier.rate_hz
        longest = max((ramp.duration_s for ramp in ramps if ramp is not None), default=0.0)
        start_s, end_s = position / rate, (position + samples) / rate
        if longest >= end_s - start_s:
            raise DwellTooShort(
                f"a frame of {end_s - start_s:.3g} s is shorter than the {longest:.3g} s that {self._device.name} "
                f"takes to change a pattern; show frames for {1.5 * longest:.2g} s or more (--dwell)"
            )
        states = tuple(self._chains.state(key) for key in keys)
        whole = FramePlan(frame, start_s, start_s + longest, end_s, states, tuple(ramps))
        return self._judged(whole)

    def _judged(self, plan: FramePlan) -> FramePlan:
        for state in plan.states:
            if state.outcome is not Outcome.OK:
                unreachable = state.outcome is Outcome.UNREACHABLE
                note = self._chains.strategy.note() if unreachable else state.outcome.sentence
                return replace(plan, outcome=state.outcome, note=note)
        for ramp in plan.ramps:
            if ramp is not None and ramp.lacking:
                note = f"{self._device.name} cannot change to this pattern: {ramp.lacking}."
                return replace(plan, outcome=Outcome.UNREACHABLE, note=note)
        return plan


class _Chains:
    """States and ramps by target, each planned once: in this run, and from the cache in any run."""

    def __init__(self, strategy: Strategy, cache: PlanCache) -> None:
        self.strategy = strategy
        self._cache = cache
        self._states: dict[bytes, ChainState] = {}
        self._ramps: dict[tuple[bytes, bytes], Ramp | None] = {}
        self._held: dict[tuple[bytes, bool], bytes] = {}

    def held(self, wishes: Floats, before: list[bytes]) -> list[bytes]:
        """The targets (as bytes) that chains hold for wishes of shape (chains, n), given what they held."""
        keys = []
        for wish, previous in zip(wishes, before, strict=True):
            ask = (wish.tobytes(), any(previous))
            if ask not in self._held:
                held = self.strategy.held(wish, ask[1])
                self._held[ask] = np.ascontiguousarray(held, dtype=np.float64).tobytes()
            keys.append(self._held[ask])
        self._plan([key for key in dict.fromkeys(keys) if key not in self._states])
        return keys

    def state(self, key: bytes) -> ChainState:
        """The state for a target."""
        if key not in self._states:
            self._plan([key])
        return self._states[key]

    def _plan(self, keys: list[bytes]) -> None:
        found = self._cache.find([b"state" + key for key in keys]) if keys else []
        missing = [key for key, state in zip(keys, found, strict=True) if state is None]
        self._states.update((key, state) for key, state in zip(keys, found, strict=True) if state is not None)
        if missing:
            targets = np.array([np.frombuffer(key) for key in missing])
            made = dict(zip(missing, self.strategy.states(targets), strict=True))
            self._states.update(made)
            self._cache.keep((b"state" + key, state) for key, state in made.items())

    def ramps(self, before: list[bytes], after: list[bytes]) -> list[Ramp | None]:
        """The ramps between targets, chain by chain."""
        pairs = list(zip(before, after, strict=True))
        missing = [pair for pair in dict.fromkeys(pairs) if pair[0] != pair[1] and pair not in self._ramps]
        if len(self._ramps) + len(missing) > MOST_RAMPS:
            self._ramps.clear()
            missing = [pair for pair in dict.fromkeys(pairs) if pair[0] != pair[1]]
        if missing:
            found = self._cache.find([b"ramp" + one + other for one, other in missing])
            self._ramps.update((pair, ramp) for pair, ramp in zip(missing, found, strict=True) if ramp is not None)
            new = [pair for pair, ramp in zip(missing, found, strict=True) if ramp is None]
            self._make(new)
        return [self._ramps.get(pair) for pair in pairs]

    def _make(self, pairs: list[tuple[bytes, bytes]]) -> None:
        if not pairs:
            return
        made = self.strategy.ramps([self.state(one) for one, _ in pairs], [self.state(other) for _, other in pairs])
        new = dict(zip(pairs, made, strict=True))
        self._ramps.update(new)
        self._cache.keep((b"ramp" + one + other, ramp) for (one, other), ramp in new.items() if ramp is not None)
