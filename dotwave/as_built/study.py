"""A written waveform on many devices as built: all effects together, then each alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from chainsim import assumed_of, surroundings_of
from drivers import Manifest, read_waveform

from ..errors import AppError
from ..progress import progress
from .batch import Batch, verdict_on
from .effects import AS_PLANNED, EFFECTS, VARYING, present
from .motion import most_at_once
from .remote import verdicts_on_cluster
from .report import AsBuiltReport, EffectAlone
from .verdict import Verdict, joined

__all__ = ["DEVICES", "EFFECT_DEVICES", "AsBuiltStudy", "verify_as_built"]

DEVICES = 1000
EFFECT_DEVICES = 64
"""At most so many devices show an effect that differs from device to device; one shows another."""


@dataclass(frozen=True)
class AsBuiltStudy:
    """What is asked of a study.

    Attributes
    ----------
    devices : how many to draw.
    seed : of the draws and the noise; device k of a seed is the same in every study.
    scheduler : address of a dask.distributed scheduler whose workers do it; None for the cores of this machine.

    Raises
    ------
    AppError
        When a number is out of range.
    """

    devices: int = DEVICES
    seed: int = 0
    scheduler: str | None = None

    def __post_init__(self) -> None:
        if self.devices < 1:
            raise AppError(f"devices: expected 1 or more, got {self.devices}")
        if self.seed < 0:
            raise AppError(f"seed: expected 0 or more, got {self.seed}")


def verify_as_built(path: Path, study: AsBuiltStudy) -> AsBuiltReport:
    """Integrate the full equations, with what the device's profile says surrounds it, on many devices.

    Raises
    ------
    FileError, UnreadableWaveform
        When the files cannot be used, or the samples are not those the manifest was written for.
    AppError
        When the scheduler cannot be used.
    """
    began = time.perf_counter()
    manifest, reader = read_waveform(path)
    manifest.check_digest(reader.path)
    if manifest.device.grid:
        raise AppError(f"--as-built: {manifest.device.name} is coupled in two dimensions, and only chains are drawn")
    around, assumed = surroundings_of(manifest.device), assumed_of(manifest.device)
    tried = {None: study.devices} | {
        effect: min(study.devices, EFFECT_DEVICES) if effect in VARYING else 1
        for effect in (AS_PLANNED, *present(around))
    }
    batches = [batch for effect, count in tried.items() for batch in _batches(effect, count, manifest, study.seed)]
    with progress("devices as built") as update:
        total, done = manifest.samples * sum(batch.count for batch in batches), 0

        def told(samples: int) -> None:
            nonlocal done
            done += samples
            update(done, total)

        found = _verdicts(path, batches, study.scheduler, told)
    of_effect = {
        effect: joined(one for batch, one in zip(batches, found, strict=True) if batch.effect == effect)
        for effect in tried
    }
    return AsBuiltReport(
        path=str(reader.path), device=manifest.device.name, devices=study.devices, seed=study.seed,
        verdict=of_effect[None],
        effects=tuple(
            EffectAlone(effect, tried[effect], bool(set(EFFECTS.get(effect, ())) & set(assumed)), of_effect[effect])
            for effect in (AS_PLANNED, *present(around))
        ),
        assumed=assumed, seconds=time.perf_counter() - began,
    )  # fmt: skip


def _batches(effect: str | None, count: int, manifest: Manifest, seed: int) -> Iterator[Batch]:
    most = most_at_once(manifest)
    for first in range(0, count, most):
        yield Batch(effect, first, min(most, count - first), seed)


def _verdicts(path: Path, batches: list[Batch], scheduler: str | None, told: Callable[[int], None]) -> list[Verdict]:
    if scheduler is None:
        return [verdict_on(path, batch, told) for batch in batches]
    return verdicts_on_cluster(path, batches, scheduler, told)
