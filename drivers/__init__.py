"""How a plan gets to the hardware: waveforms, files and sinks."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .channels import Channel, Role, channels_of
from .coupling import CouplingEvent
from .errors import DriverError, FileError, LimitError, UnreadableWaveform, WaveformError
from .files import atomic_file, atomic_files, made_folder, naming, settled
from .limits import LimitCheck
from .locks import held
from .manifest import FrameMark, Manifest
from .manifest_reader import read_manifest
from .pair import WrittenWaveform, read_waveform, write_waveform
from .parts import Part, is_at, part_of
from .samples import EXCHANGE_SUFFIXES, SUFFIXES, SampleReader, SampleWriter
from .wav import Encoding, WavWriter
from .wav_reader import WavReader
from .waveform import Waveform

if TYPE_CHECKING:
    from .audio import AudioError, AudioUnavailable, parse_outputs, play_audio
    from .board_serial import BOARD_BAUD, BoardEmulator, Firmware, grid_line, play_grid_lines
    from .controller import VirtualController
    from .drv2667 import BoardRefusal
    from .emulator import Emulator, EmulatorStatus
    from .exchange import read_exchange, write_exchange
    from .faults import Faults, FaultyLine, Window
    from .felt import FeltGrid
    from .gate import GateLimits, GateRefusal, GateReport, pass_gate
    from .messages import Ack, Capabilities
    from .outgoing import UnfitController, session_messages
    from .packet import Kind, Packet, PacketReader
    from .playout import BUFFER_S, ControllerSpec
    from .pty_line import PtyUnavailable
    from .record import ArrivalRecorder
    from .serial_play import NoAnswer, run_session
    from .stream import ControllerRefused, HostSession, SessionLost, StreamReport, Timing
    from .tactile_board import BoardPlan, plan_board
    from .uart import LinkLost, PortUnavailable, SerialMissing, Uart, serial_ports

__all__ = [
    "BOARD_BAUD",
    "BUFFER_S",
    "EXCHANGE_SUFFIXES",
    "SUFFIXES",
    "Ack",
    "ArrivalRecorder",
    "AudioError",
    "AudioUnavailable",
    "BoardEmulator",
    "BoardPlan",
    "BoardRefusal",
    "Capabilities",
    "Channel",
    "ControllerRefused",
    "ControllerSpec",
    "CouplingEvent",
    "DriverError",
    "Emulator",
    "EmulatorStatus",
    "Encoding",
    "Faults",
    "FaultyLine",
    "FeltGrid",
    "FileError",
    "Firmware",
    "FrameMark",
    "GateLimits",
    "GateRefusal",
    "GateReport",
    "HostSession",
    "Kind",
    "LimitCheck",
    "LimitError",
    "LinkLost",
    "Manifest",
    "NoAnswer",
    "Packet",
    "PacketReader",
    "Part",
    "PortUnavailable",
    "PtyUnavailable",
    "Role",
    "SampleReader",
    "SampleWriter",
    "SerialMissing",
    "SessionLost",
    "StreamReport",
    "Timing",
    "Uart",
    "UnfitController",
    "UnreadableWaveform",
    "VirtualController",
    "WavReader",
    "WavWriter",
    "Waveform",
    "WaveformError",
    "Window",
    "WrittenWaveform",
    "atomic_file",
    "atomic_files",
    "channels_of",
    "grid_line",
    "held",
    "is_at",
    "made_folder",
    "naming",
    "parse_outputs",
    "part_of",
    "pass_gate",
    "plan_board",
    "play_audio",
    "play_grid_lines",
    "read_exchange",
    "read_manifest",
    "read_waveform",
    "run_session",
    "serial_ports",
    "session_messages",
    "settled",
    "write_exchange",
    "write_waveform",
]

_LATE = {
    "Ack": "messages",
    "ArrivalRecorder": "record",
    "AudioError": "audio",
    "AudioUnavailable": "audio",
    "BOARD_BAUD": "board_serial",
    "BUFFER_S": "playout",
    "BoardEmulator": "board_serial",
    "BoardPlan": "tactile_board",
    "BoardRefusal": "drv2667",
    "Capabilities": "messages",
    "ControllerRefused": "stream",
    "ControllerSpec": "playout",
    "Emulator": "emulator",
    "read_exchange": "exchange",
    "write_exchange": "exchange",
    "EmulatorStatus": "emulator",
    "Faults": "faults",
    "FaultyLine": "faults",
    "FeltGrid": "felt",
    "Firmware": "board_serial",
    "GateLimits": "gate",
    "GateRefusal": "gate",
    "GateReport": "gate",
    "HostSession": "stream",
    "Kind": "packet",
    "LinkLost": "uart",
    "NoAnswer": "serial_play",
    "Packet": "packet",
    "PacketReader": "packet",
    "PortUnavailable": "uart",
    "PtyUnavailable": "pty_line",
    "SerialMissing": "uart",
    "SessionLost": "stream",
    "StreamReport": "stream",
    "Timing": "stream",
    "Uart": "uart",
    "UnfitController": "outgoing",
    "VirtualController": "controller",
    "Window": "faults",
    "grid_line": "board_serial",
    "parse_outputs": "audio",
    "pass_gate": "gate",
    "plan_board": "tactile_board",
    "play_audio": "audio",
    "play_grid_lines": "board_serial",
    "run_session": "serial_play",
    "serial_ports": "uart",
    "session_messages": "outgoing",
}


def __getattr__(name: str) -> object:
    if name in _LATE:
        return getattr(import_module(f".{_LATE[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
