"""The virtual controller on a pseudo-terminal, in real time, with mischief on request."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from .faults import Faults, FaultyLine
from .felt import FeltGrid
from .plant import Sensors, TruePlant
from .plant_file import PlantFile
from .playout import ControllerSpec, OutputBlock
from .pty_line import PtyLine
from .record import ArrivalRecorder, CutShort
from .replies import State
from .virtual_controller import VirtualController

__all__ = ["Emulator", "EmulatorStatus"]

# On a busy machine longer steps are cut to this. A pty holds 12 kB, 18 ms of 42 channels: longer steps would use up
# more than can come between them, and the controller would run dry whatever the host does.
LONGEST_STEP_S = 0.01


@dataclass(frozen=True)
class EmulatorStatus:
    """What the emulator shows.

    Attributes
    ----------
    session : of the host, 0 for none.
    played_s, stored_s : of the stream.
    peak_volts : of the last step.
    levels : float64, shape (rows, cols), what is felt in units of full scale.
    bad : frames that were no packet.
    mischief : packets dropped, corrupted or duplicated on purpose.
    slipped_s : time left out because the machine was busy.
    recorded : complete sessions written.
    cut_short : the last session that began, when a recorder saw it cut short.
    """

    state: State
    session: int
    plugged: bool
    played_s: float
    stored_s: float
    held_s: float
    peak_volts: float
    levels: NDArray[np.float64]
    underruns: int
    bad: int
    mischief: int
    slipped_s: float
    recorded: int
    cut_short: CutShort | None


class Emulator:
    """A controller for `device` that a program can open as a serial port.

    `faults` begin to count when the first byte arrives; a disconnection takes the pty away, as pulling the
    cable would.

    Parameters
    ----------
    link : a stable name for the port.
    record : a .wav for what arrives.
    plant : how the grid truly is; with it the controller measures. None: as the profile says, and without sensors.
    on_output : gets what goes out.

    Raises
    ------
    PtyUnavailable, FileError
        When the port or the record cannot be made.
    """

    def __init__(
        self,
        device: Device,
        spec: ControllerSpec,
        *,
        link: Path | None = None,
        faults: Faults | None = None,
        seed: int = 0,
        record: Path | None = None,
        plant: PlantFile | None = None,
        on_output: Callable[[OutputBlock], None] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._recorder = None if record is None else ArrivalRecorder(device, record)
        rate_hz = spec.true_rate_hz
        self._felt = FeltGrid(device, rate_hz, None if plant is None else TruePlant(plant, device, rate_hz))
        senses = None if plant is None else Sensors(plant, device, self._felt)
        # The first block compiles the integrator: that must not happen while a host waits.
        self._felt.take(OutputBlock(0.0, np.zeros((1, spec.channels)), np.zeros((1, spec.rows, spec.cols)), 0, False))
        self._line = PtyLine(link)
        self._faults = faults or Faults()
        self._seed = seed
        self._on_output = on_output
        self._clock = clock
        self._real = clock()
        self._now = self._real
        self._slipped = 0.0
        self._peak = 0.0
        self._began: float | None = None
        self._make_lines()
        self.controller = VirtualController(
            spec, now=self._now, name=f"emulated {device.name}", on_output=self._output, recorder=self._recorder,
            senses=senses,
        )  # fmt: skip
        self._moves_by_sensing = senses is not None

    @property
    def port(self) -> str:
        """What to open."""
        return self._line.name

    @property
    def now(self) -> float:
        """The controller's time, seconds."""
        return self._now

    @property
    def idle(self) -> bool:
        """Whether no session is under way and the output is at zero."""
        playout = self.controller.playout
        ended = self.controller.session == 0 or playout.state in (State.DONE, State.STOPPED)
        return ended and playout.silent

    def step(self, wait_s: float) -> None:
        """Exchange bytes with the host, waiting up to `wait_s` for some, and let the controller live."""
        self._pass_time()
        self._pull_or_push_cable()
        self.controller.tick(self._now)
        self._back.put(self.controller.outgoing(), self._now)
        data = self._line.exchange(self._back.take(self._now), wait_s)
        self._pass_time()
        if data and self._began is None:
            self._began = self._now
            self._make_lines()
        self._there.put(data, self._now)
        self.controller.receive(self._there.take(self._now), self._now)
        if self._recorder is not None and self.controller.playout.state is State.STOPPED:
            self._recorder.cut()

    def status(self) -> EmulatorStatus:
        """What there is to see now."""
        playout, rate = self.controller.playout, self.controller.spec.rate_hz
        lines = (self._there, self._back)
        return EmulatorStatus(
            state=playout.state, session=self.controller.session, plugged=self._line.plugged,
            played_s=playout.played / rate, stored_s=(playout.received - playout.played) / rate,
            held_s=playout.held_s, peak_volts=self._peak, levels=self._felt.levels(), underruns=playout.underruns,
            bad=self.controller.bad,
            mischief=sum(line.dropped + line.corrupted + line.duplicated for line in lines),
            slipped_s=self._slipped, recorded=self._recorder.finished if self._recorder is not None else 0,
            cut_short=self._recorder.cut_short if self._recorder is not None else None,
        )  # fmt: skip

    def close(self) -> None:
        """Take the port away and keep what arrived of a session under way."""
        self._line.close()
        if self._recorder is not None:
            self._recorder.cut()

    def _make_lines(self) -> None:
        faults = replace(self._faults, disconnect=None)
        self._there = FaultyLine(faults, seed=self._seed, now=self._now)
        self._back = FaultyLine(faults, seed=self._seed + 1, now=self._now)

    def _pass_time(self) -> None:
        real = self._clock()
        passed = real - self._real
        self._real = real
        self._slipped += max(0.0, passed - LONGEST_STEP_S)
        self._now += min(passed, LONGEST_STEP_S)

    def _pull_or_push_cable(self) -> None:
        cut = self._faults.disconnect
        pulled = cut is not None and self._began is not None and cut.holds(self._now - self._began)
        if pulled and self._line.plugged:
            self._line.unplug()
        elif not pulled and not self._line.plugged:
            self._line.plug()

    def _output(self, block: OutputBlock) -> None:
        self._peak = float(np.abs(block.volts).max())
        if not self._moves_by_sensing:
            self._felt.take(block)
        if self._on_output is not None:
            self._on_output(block)
