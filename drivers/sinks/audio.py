"""A sound card as amplifier input; the one module that knows sounddevice (an extra: pip install 'dotwave[audio]')."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DriverError
from ..formats.samples import SampleReader
from ..waveform.manifest import Manifest
from .base import SinkReport

__all__ = ["AudioError", "AudioUnavailable", "SoundCard", "parse_outputs", "play_audio"]

Floats = NDArray[np.float64]

BLOCK = 512
RAMP_S = 0.05


class AudioUnavailable(DriverError, ImportError):
    """sounddevice, or the PortAudio library under it, is not installed."""


class AudioError(DriverError, OSError):
    """The sound card cannot play this.

    Examples: no such device; fewer outputs than channels; a rate it does not know.
    """


@dataclass(frozen=True)
class SoundCard:
    """A sink: the sound card called `card`.

    Attributes
    ----------
    card : name or number for PortAudio, '' for its default.
    mapping : ``channel:output,...``, as `parse_outputs`.
    """

    card: str
    mapping: str = ""

    def check(self, manifest: Manifest, samples: SampleReader) -> SinkReport:
        """Whether the mapping fits the channels; raises AudioError."""
        parse_outputs(self.mapping, len(manifest.channels))
        return SinkReport(
            notes=("A sound card carries no coupling: links stay as they are.",) * bool(manifest.coupling)
        )

    def play(self, manifest: Manifest, samples: SampleReader, progress: Callable[[float], None]) -> SinkReport:
        """As `play_audio`."""
        device: str | int | None = int(self.card) if self.card.isdecimal() else (self.card or None)
        outputs = parse_outputs(self.mapping, len(manifest.channels))
        play_audio(manifest, samples, device=device, outputs=outputs, progress=progress)
        return self.check(manifest, samples)

    def close(self) -> None:
        """Nothing stays open after `play`."""


def parse_outputs(text: str, channels: int) -> tuple[int, ...]:
    """Output (from 0) of each channel: from ``0:2,1:3`` (channel:output), the rest keep their own number.

    Raises
    ------
    AudioError
        When it is not of that form, or two channels share an output.
    """
    outputs = list(range(channels))
    for part in filter(None, text.split(",")):
        channel, colon, output = part.partition(":")
        if not (colon and channel.strip().isdecimal() and output.strip().isdecimal() and int(channel) < channels):
            raise AudioError(f"channel mapping: expected channel:output, channels 0 to {channels - 1}, got {part!r}")
        outputs[int(channel)] = int(output)
    if len(set(outputs)) < channels:
        raise AudioError(f"channel mapping: two channels share an output in {outputs}; name one for each")
    return tuple(outputs)


def play_audio(
    manifest: Manifest,
    reader: SampleReader,
    *,
    device: str | int | None,
    outputs: Sequence[int],
    progress: Callable[[float], None] | None = None,
) -> None:
    """Play through a sound card; a full-scale output stands for a channel's volts_per_unit at the amplifier.

    At the end, on Ctrl-C and on every error the output ramps to zero in 50 ms.

    Parameters
    ----------
    device : name or number for PortAudio, None for its default.
    outputs : of each channel.
    progress : gets the seconds handed over.

    Raises
    ------
    AudioUnavailable
        When there is no sounddevice or no PortAudio.
    AudioError
        When the card refuses.
    FileError, UnreadableWaveform
        When the samples cannot be read.
    """
    sounddevice = _sounddevice()
    width = max(outputs) + 1
    unit = np.array([channel.volts_per_unit for channel in manifest.channels])
    last = np.zeros(width, dtype=np.float32)
    try:
        with sounddevice.OutputStream(
            samplerate=manifest.rate_hz, device=device, channels=width, dtype="float32", blocksize=BLOCK
        ) as stream:
            done = 0
            try:
                for volts in reader.blocks(BLOCK):
                    block = np.zeros((len(volts), width), dtype=np.float32)
                    block[:, list(outputs)] = volts / unit
                    stream.write(block)
                    last, done = block[-1], done + len(volts)
                    if progress is not None:
                        progress(done / manifest.rate_hz)
            finally:
                fall = np.linspace(1.0, 0.0, round(RAMP_S * manifest.rate_hz) + 1, dtype=np.float32)[1:]
                stream.write(fall[:, np.newaxis] * last)
    except sounddevice.PortAudioError as error:
        raise AudioError(f"sound card: {' '.join(str(error).split())}; `python -m sounddevice` lists devices") from None


def _sounddevice() -> Any:
    try:
        return import_module("sounddevice")
    except ImportError:
        raise AudioUnavailable("sounddevice is not installed; run: pip install sounddevice") from None
    except OSError:
        raise AudioUnavailable(
            "the PortAudio library is not installed; run: apt install libportaudio2 (macOS: brew install portaudio)"
        ) from None
