"""How a plan gets to the hardware: waveforms, files and sinks."""

from .channels import Channel, Role, channels_of
from .coupling import CouplingEvent
from .errors import DriverError, FileError, LimitError, UnreadableWaveform, WaveformError
from .files import atomic_path, atomic_paths, naming
from .limits import LimitCheck
from .manifest import FrameMark, Manifest
from .manifest_reader import read_manifest
from .pair import WrittenWaveform, read_waveform, write_waveform
from .samples import SUFFIXES, SampleReader, SampleWriter
from .wav import Encoding, WavWriter
from .wav_reader import WavReader
from .waveform import Waveform

__all__ = [
    "SUFFIXES",
    "Channel",
    "CouplingEvent",
    "DriverError",
    "Encoding",
    "FileError",
    "FrameMark",
    "LimitCheck",
    "LimitError",
    "Manifest",
    "Role",
    "SampleReader",
    "SampleWriter",
    "UnreadableWaveform",
    "WavReader",
    "WavWriter",
    "Waveform",
    "WaveformError",
    "WrittenWaveform",
    "atomic_path",
    "atomic_paths",
    "channels_of",
    "naming",
    "read_manifest",
    "read_waveform",
    "write_waveform",
]
