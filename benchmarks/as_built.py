"""How long `verify --as-built` takes for 1,000 devices of "Hello" on linked-6x6, beside its goal of 10 s on two cores.

python benchmarks/as_built.py

Beside the time stands the processor's, of all cores together: where other work goes on, half of it is what the time
would be without.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import dotwave as dw
from dotwave.as_built.batch import Batch, verdict_on

DEVICES, GOAL_S = 1000, 10.0


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hello.wav"
        dw.plan(dw.text("Hello", "linked-6x6"), "linked-6x6").waveform().write(path)
        # Compiled, or read from disk, before it is looked at.
        verdict_on(path, Batch(None, 0, 1, 0), lambda _: None)
        began, used = time.perf_counter(), time.process_time()
        verdict = verdict_on(path, Batch(None, 0, DEVICES, 0), lambda _: None)
        wall_s, processor_s = time.perf_counter() - began, time.process_time() - used
    print(
        f"{len(verdict.ok)} devices of Hello, all effects: {wall_s:.1f} s (processor {processor_s:.1f} s), "
        f"goal {GOAL_S:g} s: {'met' if wall_s <= GOAL_S else 'MISSED'}"
    )


if __name__ == "__main__":
    main()
