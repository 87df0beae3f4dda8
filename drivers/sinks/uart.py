"""Bytes to and from a serial port; the one module that knows pyserial."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from ..errors import DriverError

__all__ = ["LinkLost", "PortUnavailable", "SerialMissing", "SerialPort", "Uart", "serial_ports"]

BAUD = 2_000_000
WRITE_TIMEOUT_S = 1.0
PARTING_S = 0.5


class SerialMissing(DriverError, ImportError):
    """pyserial is not installed, or another package named `serial` is in its place."""


class PortUnavailable(DriverError, OSError):
    """A serial port cannot be opened.

    Examples: nothing is plugged in; another program has it; no permission.
    """


class LinkLost(DriverError, ConnectionError):
    """The line went away in mid-session.

    Examples: the cable was pulled; the controller does not take what is sent.
    """


@dataclass(frozen=True)
class SerialPort:
    """A serial port of this machine."""

    name: str
    description: str
    hardware: str


def serial_ports() -> list[SerialPort]:
    """The serial ports of this machine, by name.

    Raises
    ------
    SerialMissing
        When pyserial is not there.
    """
    _serial()
    found = import_module("serial.tools.list_ports").comports()
    return sorted((SerialPort(p.device, p.description or "", p.hwid or "") for p in found), key=lambda p: p.name)


class Uart:
    """An open serial port that no other program can open.

    Parameters
    ----------
    name : such as /dev/ttyACM0, COM3, or the pty that `dotwave emulate` names.
    baud : bits per second.

    Raises
    ------
    SerialMissing, PortUnavailable
        When it cannot be opened.
    """

    def __init__(self, name: str, baud: int = BAUD) -> None:
        serial = _serial()
        self.name = name
        self._errors = (serial.SerialException, OSError, *_terminal_errors())
        try:
            self._port = serial.Serial(name, baudrate=baud, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True)
        except (*self._errors, ValueError) as error:
            raise PortUnavailable(f"{name}: cannot be opened: {_reason(error)}; `dotwave ports` lists ports") from None

    def read(self, wait_s: float) -> bytes:
        """What has come; waits up to `wait_s` for the first byte.

        Raises
        ------
        LinkLost
            When the port is gone.
        """
        try:
            self._port.timeout = wait_s
            data = self._port.read(1)
            return bytes(data + self._port.read(self._port.in_waiting)) if data else b""
        except self._errors as error:
            raise LinkLost(f"{self.name}: {_reason(error)}") from None

    def write(self, data: bytes) -> None:
        """Send bytes.

        Raises
        ------
        LinkLost
            When the port is gone, or takes nothing for a second.
        """
        try:
            self._port.write(data)
        except self._errors as error:
            raise LinkLost(f"{self.name}: {_reason(error)}") from None

    def close(self) -> None:
        """Give the port back, after the last bytes have left or `PARTING_S` have passed; never fails."""
        with suppress(*self._errors):
            # The last bytes are the ones that bring the output to zero. A line that takes nothing loses them: then
            # they are thrown away, because closing would wait for them.
            until = time.monotonic() + PARTING_S
            while self._port.out_waiting and time.monotonic() < until:
                time.sleep(0.005)
            if self._port.out_waiting:
                self._port.reset_output_buffer()
        with suppress(*self._errors):
            self._port.close()


def _terminal_errors() -> tuple[type[Exception], ...]:
    """What pyserial lets through of the terminal functions it calls; they exist on POSIX only."""
    try:
        return (import_module("termios").error,)
    except ImportError:
        return ()


def _reason(error: BaseException) -> str:
    number = getattr(error, "errno", None)
    if number == 2:
        return "there is no such port"
    if number == 11 or "exclusively lock" in str(error):
        return "another program is using it"
    if number == 13:
        return "no permission (on Linux: add yourself to the group dialout)"
    return " ".join(str(error).split()) or type(error).__name__


def _serial() -> Any:
    try:
        serial = import_module("serial")
    except ImportError:
        raise SerialMissing("pyserial is not installed; run: pip install pyserial") from None
    if not hasattr(serial, "Serial") or not hasattr(serial, "SerialException"):
        raise SerialMissing("this `serial` is not pyserial; run: pip uninstall serial && pip install pyserial")
    return serial
