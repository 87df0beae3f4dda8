"""What is done with one icon, in whatever process: encode it, plan its pattern, write its waveform.

Everything that goes in and comes out is plain data, so that a worker on another machine gives the same bytes.
"""

from __future__ import annotations

import base64
import hashlib
import json
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome
from drivers import WAVEFORMS_VERSION, DriverError, Encoding
from encoders import (
    PICTURES_VERSION,
    EncodeError,
    Frame,
    GridShape,
    PictureOptions,
    Scene,
    TargetPattern,
    encode_picture,
)
from planner import PLANS_VERSION, Plan, PlanError, plan_scene

from ..errors import AppError
from ..rendering.render import render
from ..request import Request
from ..scenes import shape_of

__all__ = [
    "Recipe",
    "Record",
    "Task",
    "all_of_batch",
    "encode_icons",
    "icon_plan",
    "plan_patterns",
    "versions",
    "write_waves",
]

Floats = NDArray[np.float64]
Record = dict[str, Any]
Given = TypeVar("Given")

# Digits kept of a similarity, and of a predicted error in units of full scale.
DIGITS = 6


def versions() -> str:
    """What the numbers of an icon hang on beside its recipe: what was made with others is not used."""
    return f"plans {PLANS_VERSION}, pictures {PICTURES_VERSION}, waveforms {WAVEFORMS_VERSION}"


@dataclass(frozen=True, eq=False)
class Recipe:
    """How icons are made; the same recipe and the same picture give the same record.

    Attributes
    ----------
    device : the hardware.
    options : of the encoder, with the number of candidates.
    contrast_db : of the planner.
    encoding : of the samples.
    made_by : `versions` of the one who asks.
    """

    device: Device
    options: PictureOptions
    contrast_db: float | None
    encoding: Encoding
    made_by: str

    @property
    def shape(self) -> GridShape:
        """The device's grid."""
        return shape_of(self.device)

    @cached_property
    def scope(self) -> str:
        """Digest of all of it."""
        given = [self.device.as_dict(), asdict(self.options), self.contrast_db, self.encoding, self.made_by]
        return hashlib.sha256(json.dumps(given, sort_keys=True).encode()).hexdigest()[:24]

    def key(self, kind: str, item: bytes) -> str:
        """Name of a record: what was done, with what."""
        return f"{kind}:{self.scope}:{hashlib.sha256(item).hexdigest()}"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Recipe) and self.scope == other.scope

    def __hash__(self) -> int:
        return hash(self.scope)


@dataclass(frozen=True)
class Task:
    """One piece of work.

    Attributes
    ----------
    key : of its record.
    data : bytes of a picture (`encode_icons`).
    amplitude : pattern in units of full scale, row by row (`plan_patterns`, `write_waves`).
    name : of the waveform's files, without suffix.
    """

    key: str
    data: bytes = b""
    amplitude: tuple[tuple[float, ...], ...] = ()
    name: str = ""


def encode_icons(recipe: Recipe, tasks: Sequence[Task]) -> Iterator[Record]:
    """Encode pictures and plan the best pattern of each.

    Yields
    ------
    Records with ``kind``, ``frames`` (of an animation; the first is the icon), ``notes``, ``doubt``,
    ``figure`` (bytes 0..255 in base64), ``options`` (bits of the good patterns, each filled up to bytes, in base64),
    their ``similarity``, best first, and ``plan`` as of `plan_patterns`; or ``bad``, one line on what is wrong.
    """
    return (_encoded(recipe, task) for task in tasks)


def _encoded(recipe: Recipe, task: Task) -> Record:
    try:
        report = encode_picture(task.data, recipe.shape, recipe.options).report
    except (EncodeError, MemoryError) as error:
        line = " ".join(str(error).split()) or "not enough memory"
        return {"key": task.key, "bad": line.removeprefix("picture: ")}
    first = report.frames[0]
    candidates = first.candidates
    bits = np.packbits(np.stack([one.dots.ravel() for one in candidates]), axis=1)
    return {
        "key": task.key,
        "kind": report.kind,
        "frames": len(report.frames),
        "notes": list(report.notes),
        "doubt": first.doubt,
        "figure": base64.b64encode(np.rint(first.figure * 255).astype(np.uint8).tobytes()).decode(),
        "options": base64.b64encode(bits.tobytes()).decode(),
        "similarity": [round(one.similarity, DIGITS) for one in candidates],
        "plan": _planned(recipe, candidates[0].dots.astype(np.float64)),
    }


def plan_patterns(recipe: Recipe, tasks: Sequence[Task]) -> Iterator[Record]:
    """Plan patterns, each from rest: records with ``outcome``, ``error`` (full scale) and ``note``."""
    return ({"key": task.key} | _planned(recipe, np.array(task.amplitude)) for task in tasks)


def write_waves(recipe: Recipe, tasks: Sequence[Task]) -> Iterator[Record]:
    """Write patterns as waveforms: records with the bytes of both files (``wav``, ``json``), or with ``bad``."""
    return (_written(recipe, task) for task in tasks)


def all_of_batch(
    work: Callable[[Given, Sequence[Task]], Iterable[Record]], recipe: Given, tasks: Sequence[Task]
) -> list[Record]:
    """All records of a batch at once, for where they cannot be had one by one."""
    return list(work(recipe, tasks))


def _written(recipe: Recipe, task: Task) -> Record:
    scene = Scene(recipe.shape, (_frame(recipe, np.array(task.amplitude)),), {"kind": "icon"})
    request = Request(contrast_db=recipe.contrast_db, encoding=recipe.encoding, yes=True)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{task.name}.wav"
        try:
            report = render(scene, recipe.device, path, request)
        except (AppError, DriverError, PlanError) as error:
            return {"key": task.key, "bad": " ".join(str(error).replace(folder, "").split())}
        if not report.ok:
            return {"key": task.key, "bad": report.failure}
        return {"key": task.key, "wav": path.read_bytes(), "json": path.with_suffix(".json").read_bytes()}


def icon_plan(recipe: Recipe, amplitude: Floats) -> Plan:
    """The plan of a pattern, float64, shape (rows, cols), from rest and back to it; good until the next one is made."""
    frames, plan = _planner(recipe)
    frames.frame = _frame(recipe, amplitude)
    return plan


def _frame(recipe: Recipe, amplitude: Floats) -> Frame:
    target = amplitude.astype(np.complex128)
    target.flags.writeable = False
    return Frame(TargetPattern(target), recipe.options.dwell_s)


class _Frames:
    """The frames of a scene that is planned over and over with another pattern; chains are planned once."""

    frame: Frame

    def __iter__(self) -> Iterator[Frame]:
        yield self.frame


_ONE_AT_A_TIME = threading.Lock()


@lru_cache(maxsize=4)
def _planner(recipe: Recipe) -> tuple[_Frames, Plan]:
    frames = _Frames()
    scene = Scene(recipe.shape, frames, {"kind": "icon"})
    return frames, plan_scene(scene, recipe.device, contrast_db=recipe.contrast_db)


def _planned(recipe: Recipe, amplitude: Floats) -> Record:
    # A worker of a cluster may run several tasks in threads.
    with _ONE_AT_A_TIME:
        try:
            planned = list(icon_plan(recipe, amplitude).frames)
        except PlanError as problem:
            return {"outcome": "not_planned", "error": None, "note": " ".join(str(problem).split())}
    failed = next((frame for frame in planned if frame.outcome is not Outcome.OK), None)
    error = planned[0].error
    return {
        "outcome": str(failed.outcome) if failed else "ok",
        "error": round(error, DIGITS) if np.isfinite(error) else None,
        "note": failed.note if failed else "",
    }
