"""Live playing to a virtual controller in virtual time: no thread and no sleep."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np

from chainsim import Device
from dotwave.live.core import LiveCore
from drivers import (
    ArrivalRecorder,
    ControllerSpec,
    Faults,
    FaultyLine,
    GateLimits,
    HostSession,
    KeyEvent,
    LiveMessages,
    Timing,
    VirtualController,
)
from drivers.protocol.playout import OutputBlock
from encoders import CellGrid, GridShape
from planner import FramePlan

STEP_S = 0.001


class WatchedCore(LiveCore):
    """A core that tells of the ways that were begun."""

    going: deque[FramePlan]

    def began(self, placed: FramePlan) -> None:
        super().began(placed)
        self.going.append(placed)


class LiveBench:
    """A host that shows, a controller that plays, and a line between them.

    Attributes
    ----------
    peak_volts, peak_slew : of what went out.
    most_stored : samples in the controller at most.
    latencies_s : from `show` to the moment at which the pattern stood at the controller.
    """

    def __init__(
        self, device: Device, *, record: Path | None = None, faults: Faults | None = None, lead_s: float = 0.06,
        idle_s: float = 1.0, limits: GateLimits | None = None, buffer_s: float = 2.0, plans: bool = True,
        seed: int = 1,
    ) -> None:  # fmt: skip
        self.now, self.device, self.plans = 100.0, device, plans
        self.cells = CellGrid(GridShape(device.rows, device.cols))
        self.core = WatchedCore(device, idle_s=idle_s, clock=lambda: self.now)
        self.core.going = deque()
        self.recorder = None if record is None else ArrivalRecorder(device, record)
        self.spec = ControllerSpec.of(device, buffer_s=buffer_s)
        self.controller = VirtualController(
            self.spec,
            now=self.now,
            on_output=self._out,
            recorder=self.recorder,
        )
        self.keys = list[KeyEvent]()
        self.session = HostSession(
            lambda found: LiveMessages(
                device, found, self.core, session=7, encoding=self.cells.encoding, prefill_s=lead_s / 2, limits=limits
            ),
            session=7, timing=Timing(lead_s=lead_s), on_key=self.keys.append,
        )  # fmt: skip
        self.there = FaultyLine(faults or Faults(), seed=seed, now=self.now)
        self.back = FaultyLine(faults or Faults(), seed=seed + 1, now=self.now)
        self.peak_volts = self.peak_slew = 0.0
        self.last = np.zeros(self.spec.channels)
        self.most_stored = 0
        self.latencies_s = list[float]()
        self._asked = dict[str, float]()
        self.session.connected()

    def show(self, cells: str, note: str) -> None:
        """Show cells under a note that no others have."""
        self._asked[note] = self.now
        self.core.show(self.cells.frame(cells, note))

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> None:
        """Let time pass, or until something holds."""
        end = self.now + seconds
        while self.now < end and not (until is not None and until()):
            self.step()

    def step(self) -> None:
        """A millisecond."""
        self.stepped_s()

    def stepped_s(self) -> float:
        """The same; seconds of the processor that the host took."""
        self.now += STEP_S
        before = time.thread_time()
        if self.plans:
            self.core.plan()
        out = self.session.poll(self.now)
        host_s = time.thread_time() - before
        self.there.put(out, self.now)
        self.controller.receive(self.there.take(self.now), self.now)
        self.back.put(self.controller.outgoing(), self.now)
        back, before = self.back.take(self.now), time.thread_time()
        self.session.receive(back, self.now)
        self.core.played(self.session.played_s)
        host_s += time.thread_time() - before
        playout = self.controller.playout
        self.most_stored = max(self.most_stored, playout.received - playout.played)
        while self.core.going and self.core.going[0].settled_s * self.spec.rate_hz <= playout.played:
            self.stood(self.core.going.popleft())
        return host_s

    def stood(self, placed: FramePlan) -> None:
        """A pattern stands now, by the controller's clock."""
        if placed.frame is not None:
            self.latencies_s.append(self.now - self._asked.get(placed.frame.text, math.nan))

    def _out(self, block: OutputBlock) -> None:
        self.peak_volts = max(self.peak_volts, float(np.abs(block.volts).max()))
        steps = np.diff(np.concatenate([self.last[None], block.volts]), axis=0)
        self.peak_slew = max(self.peak_slew, float(np.abs(steps).max()) * self.spec.rate_hz)
        self.last = block.volts[-1].copy()
