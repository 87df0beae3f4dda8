"""A batch of devices under one effect or all of them: the piece of work that a core or a worker takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from chainsim import Surroundings, surroundings_of
from drivers import read_waveform

from .effects import alone
from .motion import felt_levels
from .verdict import Verdict, verdict_of

__all__ = ["Batch", "verdict_on"]


@dataclass(frozen=True)
class Batch:
    """Devices `first` to ``first + count`` of a seed under one effect; None is all effects together."""

    effect: str | None
    first: int
    count: int
    seed: int

    def around(self, all_of_it: Surroundings) -> Surroundings:
        """What surrounds these devices."""
        return all_of_it if self.effect is None else alone(all_of_it, self.effect)


def verdict_on(path: Path, batch: Batch, told: Callable[[int], None]) -> Verdict:
    """What the devices of a batch make of the waveform at `path`, which has been checked."""
    manifest, reader = read_waveform(path)
    around = batch.around(surroundings_of(manifest.device))
    felt = felt_levels(
        manifest, reader, around, first=batch.first, count=batch.count, seed=batch.seed,
        told=lambda samples: told(samples * batch.count),
    )  # fmt: skip
    return verdict_of(manifest.frames, felt)
