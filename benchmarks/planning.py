"""How long planning takes, warm, beside its goals: frames new and known, many rows, a large device, the yield.

python benchmarks/planning.py                   print it beside what is kept
python benchmarks/planning.py --keep            write benchmarks/results/planning.json

Beside the time stands the processor's: where other work goes on, it is what the time would be without.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

# Matrices are small here: further threads would only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome, load_device
from encoders import Frame, GridShape, Scene, levels
from planner import FramePlan, RelativeSpread, plan_scene, seconds_words, spread_of
from planner.families import family_of, row_of
from planner.family import AmplitudeFamily
from planner.targets import AmplitudeTarget

KEPT = Path(__file__).resolve().parent / "results" / "planning.json"
SEED, CONTRAST_DB, SPREAD = 0, 20.0, RelativeSpread(f0=0.01)
# What is looked at only once the code and its tables are in memory.
WARM = 3


@dataclass(frozen=True)
class Line:
    """One goal: what, in how many seconds, and what was reached: medians of time and of processor time, best time."""

    what: str
    goal_s: float
    median_s: float
    processor_s: float
    best_s: float
    repeats: int

    def words(self, kept: float | None) -> str:
        """For a person."""
        verdict = "met" if self.median_s <= self.goal_s else "MISSED"
        was = "" if kept is None else f"  (kept: {seconds_words(kept)})"
        return (
            f"{self.what:54} goal {seconds_words(self.goal_s):>7}  reached {seconds_words(self.median_s):>8}  "
            f"(processor {seconds_words(self.processor_s):>8}, best {seconds_words(self.best_s):>8})  {verdict}{was}"
        )


class Timed(NamedTuple):
    """Seconds, and seconds of the processor."""

    wall_s: float
    processor_s: float

    @classmethod
    def since(cls, began: Timed) -> Timed:
        return cls(time.perf_counter() - began.wall_s, time.process_time() - began.processor_s)

    @classmethod
    def now(cls) -> Timed:
        return cls(time.perf_counter(), time.process_time())


def line(what: str, goal_s: float, times: Iterable[Timed]) -> Line:
    found = list(times)
    wall, processor = zip(*found, strict=True)
    return Line(what, goal_s, statistics.median(wall), statistics.median(processor), min(wall), len(found))


def scene(device: Device, amplitudes: Iterable[NDArray[np.float64]]) -> Scene:
    return Scene(GridShape(device.rows, device.cols), tuple(Frame(levels(one), 1.0) for one in amplitudes))


def dots(device: Device, count: int) -> list[NDArray[np.float64]]:
    rng = np.random.default_rng(SEED)
    return [(rng.random((device.rows, device.cols)) < 0.4).astype(np.float64) for _ in range(count)]


def amplitudes(device: Device, count: int) -> list[NDArray[np.float64]]:
    rng = np.random.default_rng(SEED)
    return [rng.uniform(0.1, 1.0, (device.rows, device.cols)) for _ in range(count)]


def frame_times(frames: Iterable[FramePlan]) -> Iterator[Timed]:
    """Seconds for each frame; the way out after the last is none."""
    rest = iter(frames)
    while True:
        began = Timed.now()
        frame = next(rest, None)
        spent = Timed.since(began)
        if frame is None or frame.frame is None:
            return
        assert frame.outcome is Outcome.OK, frame.note
        yield spent


def timed(work: Callable[[], object], repeats: int) -> Iterator[Timed]:
    for number in range(WARM + repeats):
        began = Timed.now()
        work()
        if number >= WARM:
            yield Timed.since(began)


def measured() -> Iterator[Line]:
    linked, large = load_device("linked-6x6"), load_device("linked-40x96")
    # Every row and every way of it is new: the amplitudes are random numbers.
    plan = plan_scene(scene(linked, amplitudes(linked, 60)), linked, contrast_db=CONTRAST_DB)
    yield line("a new 6 x 6 frame of random amplitudes", 10e-3, list(frame_times(plan.frames))[WARM:])
    plan = plan_scene(scene(linked, dots(linked, 60)), linked, contrast_db=CONTRAST_DB)
    list(plan.frames)
    yield line("a 6 x 6 frame whose rows are known", 1e-4, list(frame_times(plan.frames))[WARM:])
    family = family_of(row_of(AmplitudeTarget, linked), linked, CONTRAST_DB)
    assert isinstance(family, AmplitudeFamily)
    rows = np.random.default_rng(SEED).uniform(0.1, 1.0, (10_000, 6))
    yield line("10,000 random amplitude rows, nominal", 1.0, timed(lambda: family.states(rows), 5))
    pages = dots(large, 12)
    plan = plan_scene(scene(large, pages), large, contrast_db=CONTRAST_DB)
    times = list(frame_times(plan.frames))
    yield line("a 40 x 96 page of random dots after another", 0.1, times[1:])
    yield line("the same, rows and ways known", 0.1, list(frame_times(plan.frames))[1:])
    # Devices that differ by a hair have nothing planned.
    others = [large.model_copy(update={"f0_hz": large.f0_hz + 1e-6 * number}) for number in range(WARM + 5)]
    first = [list(frame_times(plan_scene(scene(one, pages[:2]), one).frames))[1] for one in others]
    yield line("the same, the first change: all 545 ways in it are new", 0.1, first[WARM:])
    states = next(iter(plan_scene(scene(linked, dots(linked, 1)), linked).frames)).states
    yield line(
        "the yield of 1,000 draws of a 6 x 6 frame", 0.2,
        timed(lambda: spread_of(linked, states, SPREAD, tolerance=0.2, threshold=0.5, count=1000), 9),
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", action="store_true", help=f"write {KEPT.name}")
    given = parser.parse_args()
    before = json.loads(KEPT.read_text(encoding="utf-8"))["lines"] if KEPT.exists() else []
    kept = {one["what"]: one["median_s"] for one in before}
    found = []
    with tempfile.TemporaryDirectory() as folder:
        # Nothing that an earlier run planned may be found.
        os.environ["DOTWAVE_CACHE"] = folder
        load = os.getloadavg()[0]
        for one in measured():
            found.append(one)
            print(one.words(kept.get(one.what)), flush=True)
    if given.keep:
        KEPT.parent.mkdir(parents=True, exist_ok=True)
        facts = {"schema": "dotwave/planning/1", "cores": os.cpu_count(), "load_before": load}
        KEPT.write_text(
            json.dumps(facts | {"lines": [asdict(one) for one in found]}, indent=1) + "\n", encoding="utf-8"
        )


if __name__ == "__main__":
    main()
