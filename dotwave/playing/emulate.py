"""The emulated controller in a terminal: what is felt as Braille, levels, buffer and faults, while a host plays."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from chainsim import load_device
from drivers import BUFFER_S, ControllerSpec, Emulator, EmulatorStatus, Faults, FaultWindow, read_plant
from planner import DOT_THRESHOLD

from ..errors import AppError
from ..plain import printable

__all__ = ["EmulateReport", "dots_as_braille", "emulate", "parse_window"]

STEP_S = 0.002
SHOW_EVERY_S = 0.1
LINGER_S = 1.0  # after a session: its host has to hear how it ended
SHADES = " ▁▂▃▄▅▆▇█"
CELL_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20))


@dataclass(frozen=True)
class EmulateReport:
    """What the emulator saw."""

    device: str
    port: str
    status: EmulatorStatus
    record: str

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        status = self.status
        return {
            "device": self.device, "port": self.port, "state": status.state.name.lower(),
            "played_s": status.played_s, "held_s": status.held_s, "underruns": status.underruns, "bad": status.bad,
            "mischief": status.mischief, "slipped_s": status.slipped_s, "recorded": status.recorded,
            "cut_short": None if status.cut_short is None else asdict(status.cut_short),
            "record": self.record, "levels": status.levels.tolist(),
        }  # fmt: skip

    def as_text(self) -> str:
        """Lines of plain text."""
        status = self.status
        lines = [
            f"{self.device} on {self.port}: {status.state.name.lower()} at {status.played_s:.2f} s",
            f"  {status.underruns} underruns, {status.held_s:.2f} s held, {status.bad} broken packets, "
            f"{status.mischief} spoiled on purpose, {status.slipped_s:.2f} s left out (busy machine)",
        ]
        cut = status.cut_short
        if cut is not None:
            kept = "" if cut.arrived_s else "; it left no record"
            lines.append(f"  cut short: {cut.arrived_s:.2f} of {cut.total_s:.2f} s arrived{kept}")
        if status.recorded or (cut is not None and cut.arrived_s):
            lines.append(f"  what arrived: {self.record}; try `dotwave verify {self.record}`")
        return "\n".join(lines)


def emulate(
    *,
    device: str,
    link: Path | None = None,
    record: Path | None = None,
    plant: Path | None = None,
    seconds: float | None = None,
    once: bool = False,
    buffer_s: float = BUFFER_S,
    watchdog_s: float = 0.2,
    drift_ppm: float = 0.0,
    faults: Faults | None = None,
    seed: int = 0,
    out: TextIO | None = None,
) -> EmulateReport:
    """Stand in for a controller until Ctrl-C, for `seconds`, or (`once`) until one session has ended.

    Parameters
    ----------
    device : profile name or file.
    link : a stable name for the port.
    record : a .wav for what arrives.
    plant : file of how the grid truly is; with it the controller measures.
    buffer_s, watchdog_s, drift_ppm : of the controller.
    faults : what to spoil, the same each time for a `seed`.
    out : where to draw; stderr by default. A terminal is redrawn, anything else gets the port's name only.

    Raises
    ------
    AppError
        When a number is out of range, or the device is coupled in two dimensions.
    ChainError, DriverError
        When the profile, the plant, the port or the record cannot be made.
    """
    for name, value in (("buffer", buffer_s), ("watchdog", watchdog_s)):
        if not 0.01 <= value <= 60:
            raise AppError(f"--{name}: expected 0.01 to 60 seconds, got {value}")
    out = out or sys.stderr
    profile = load_device(device)
    if profile.grid:
        raise AppError(f"emulate: a controller has links along rows only, {profile.name} also downwards; use verify")
    spec = ControllerSpec.of(profile, buffer_s=buffer_s, watchdog_s=watchdog_s, drift_ppm=drift_ppm)
    true = None if plant is None else read_plant(plant, profile)
    emulator = Emulator(profile, spec, link=link, faults=faults, seed=seed, record=record, plant=true)
    screen = _Screen(out, profile.name, emulator.port)
    try:
        began = shown = busy = time.monotonic()
        served = False
        while seconds is None or time.monotonic() - began < seconds:
            emulator.step(STEP_S)
            if time.monotonic() - shown >= SHOW_EVERY_S:
                shown = time.monotonic()
                screen.show(emulator.status())
            if not emulator.idle:
                busy, served = time.monotonic(), True
            elif once and served and time.monotonic() - busy > LINGER_S:
                break
    except KeyboardInterrupt:
        pass
    finally:
        emulator.close()
        screen.close()
    return EmulateReport(profile.name, emulator.port, emulator.status(), str(record or ""))


def parse_window(text: str | None, name: str) -> FaultWindow | None:
    """``at,length`` in seconds, or nothing.

    Raises
    ------
    AppError
        When it is not two numbers >= 0.
    """
    if text is None:
        return None
    try:
        start_s, length_s = (float(part) for part in text.split(","))
    except ValueError:
        raise AppError(f"--{name}: expected two numbers of seconds such as 3,2, got {text!r}") from None
    if not (start_s >= 0 and 0 <= length_s < float("inf")):
        raise AppError(f"--{name}: expected seconds >= 0, got {text!r}")
    return FaultWindow(start_s, length_s)


def dots_as_braille(levels: NDArray[np.float64]) -> list[str]:
    """Actuators at or above half of full scale as Unicode Braille, a cell for every 3 rows and 2 columns."""
    rows, cols = levels.shape
    on = np.zeros((-(-rows // 3) * 3, -(-cols // 2) * 2), dtype=bool)
    on[:rows, :cols] = levels >= DOT_THRESHOLD
    lines = []
    for row in range(0, on.shape[0], 3):
        cells = (on[row : row + 3, col : col + 2] for col in range(0, on.shape[1], 2))
        lines.append("".join(chr(0x2800 + int((cell * CELL_BITS).sum())) for cell in cells))
    return lines


class _Screen:
    """Draws over itself on a terminal; elsewhere it says the port once."""

    def __init__(self, out: TextIO, device: str, port: str) -> None:
        self._out, self._live = out, out.isatty()
        self._lines = 0
        out.write(printable(f"{device} listens on {port}\n  dotwave play OUT --port {port} --live\n"))
        out.flush()

    def show(self, status: EmulatorStatus) -> None:
        """Draw the status."""
        if not self._live:
            return
        lines = list(_drawing(status))
        up = f"\x1b[{self._lines}A" if self._lines else ""
        self._out.write(up + "".join(f"\x1b[2K{line}\n" for line in lines))
        self._out.flush()
        self._lines = len(lines)

    def close(self) -> None:
        """Leave the last drawing where it is."""
        self._out.flush()


def _drawing(status: EmulatorStatus) -> Iterator[str]:
    plug = "" if status.plugged else "  UNPLUGGED"
    yield f"{status.state.name.lower():8} {status.played_s:8.2f} s   in store {1e3 * status.stored_s:4.0f} ms{plug}"
    yield (
        f"peak {status.peak_volts:5.1f} V   underruns {status.underruns}   held {status.held_s:.2f} s   "
        f"broken {status.bad}   spoiled {status.mischief}"
    )
    braille = dots_as_braille(status.levels)
    for number, row in enumerate(status.levels):
        shade = np.clip(np.nan_to_num(row) * (len(SHADES) - 2), 0, len(SHADES) - 1).astype(int)
        cells = braille[number // 3] if number % 3 == 1 else ""
        yield "  " + "".join(SHADES[value] * 2 for value in shade) + f"   {cells}"
