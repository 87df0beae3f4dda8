"""Errors of the drivers, each with the situations in which it is met."""

from __future__ import annotations

from .channels import Channel

__all__ = ["DriverError", "FileError", "LimitError", "UnreadableWaveform", "WaveformError"]


class DriverError(Exception):
    """Root of everything `drivers` raises on purpose.

    Examples
    --------
    >>> from drivers import DriverError, read_waveform
    >>> try:
    ...     read_waveform("nowhere.wav")
    ... except DriverError as error:
    ...     print(error)
    nowhere.wav: no such file; ...
    """


class WaveformError(DriverError, ValueError):
    """A plan cannot become a waveform.

    Examples: a frame begins before the last one ends; a ramp is longer than its frame; the drive frequency
    is above half the amplifier's rate; two chains of one row are driven at different frequencies.
    """


class LimitError(DriverError, ValueError):
    """A sample is more than the amplifier, or the file's sample format, can give.

    Examples: a ramp asks for 120 V of a 100 V amplifier; a bias jumps faster than the slew rate; +100 V in
    PCM24, whose largest code stands for a little less.

    Attributes
    ----------
    channel : where.
    time_s : when, seconds from the start.
    value, limit : what was asked and what can be had, both in the unit of the message (V or V/s).
    """

    def __init__(self, message: str, *, channel: Channel, time_s: float, value: float, limit: float) -> None:
        super().__init__(message)
        self.channel = channel
        self.time_s = time_s
        self.value = value
        self.limit = limit


class FileError(DriverError, OSError):
    """The file system refuses.

    Examples: the disk is full; the folder is missing or may not be written; the file to read is missing.
    """


class UnreadableWaveform(DriverError, ValueError):
    """A file is not a waveform, or not a whole one.

    Examples: a WAV cut short; a compressed WAV; a manifest that is not JSON or lacks a key; samples whose
    digest is not the manifest's.
    """
