"""Sinks by name: dotwave's own and those of other packages, each behind the safety gate."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..formats.samples import SampleReader
from ..safety import Gate, GateLimits, GateReport, pass_gate
from ..waveform.manifest import Manifest
from .base import Sink, SinkError, SinkReport

__all__ = ["GROUP", "SINKS", "Checked", "OpenSink", "open_sink", "sink_names"]

Progress = Callable[[float], None]

CHANGED = "stopped, the samples have changed since they were checked"
GROUP = "dotwave.sinks"
"""Entry points of this group in other packages are sinks: ``name = "module:maker"``."""

SINKS = {
    name: EntryPoint(name, f"{__package__}.{place}", GROUP)
    for name, place in {
        "controller": "controller:Controller",
        "drv2667": "board:Board",
        "audio": "audio:SoundCard",
    }.items()
}
"""dotwave's own: name -> what makes one from the address behind the name, and options."""


def sink_names() -> tuple[str, ...]:
    """Names of all sinks there are, dotwave's own first; nothing is loaded."""
    return (*SINKS, *sorted({point.name for point in entry_points(group=GROUP)} - SINKS.keys()))


def open_sink(address: str, *, limits: GateLimits | None = None, **options: Any) -> OpenSink:
    """The sink at ``name:place``: controller:/dev/ttyACM0, drv2667:/dev/ttyUSB0, audio:NAME, or another package's.

    Parameters
    ----------
    limits : of the actuators and the amplifier where they are known; None: those of the device played for.
    options : of the sink, by name, such as ``baud=115200``.

    Raises
    ------
    SinkError
        When there is no such sink, it cannot be loaded, or does not have such an option.

    Examples
    --------
    >>> from drivers import open_sink
    >>> with open_sink("audio:", mapping="0:2") as sink:
    ...     sink.name
    'audio'
    """
    name, _, place = address.partition(":")
    maker = _maker(name)
    try:
        inspect.signature(maker).bind(place, **options)
    except TypeError as error:
        raise SinkError(f"sink {name}: {error}; it has {_options(maker)}") from None
    sink = maker(place, **options)
    if not isinstance(sink, Sink):
        raise SinkError(f"sink {name}: what its package makes has no check, play and close; {_cure(name)}")
    return OpenSink(name, sink, limits)


@dataclass(frozen=True)
class Checked:
    """A waveform may be played: `gate` says how near the limits it comes, `report` what the sink would do."""

    gate: GateReport
    report: SinkReport


class OpenSink:
    """A sink behind the safety gate: nothing reaches it that has not passed whole. A context manager.

    Attributes
    ----------
    name : of the sink.
    """

    def __init__(self, name: str, sink: Sink, limits: GateLimits | None) -> None:
        self.name = name
        self._sink = sink
        self._limits = limits
        self._passed: tuple[Manifest, SampleReader] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._sink.close()

    def check(self, manifest: Manifest, samples: SampleReader, progress: Progress | None = None) -> Checked:
        """Hold a waveform against the gate and ask the sink what it would do; nothing is sent.

        `progress` gets the seconds checked.

        Raises
        ------
        DriverError
            When the gate refuses, or the waveform does not fit the sink.
        """
        self._passed = None
        gate = pass_gate(manifest, samples, self._limits_for(manifest), progress=progress)
        checked = Checked(gate, self._said(self._sink.check(manifest, self._gated(manifest, samples))))
        self._passed = manifest, samples
        return checked

    def play(self, manifest: Manifest, samples: SampleReader, progress: Progress | None = None) -> SinkReport:
        """Play a waveform, once it has passed `check`; `progress` gets the seconds played.

        Raises
        ------
        DriverError
            When it does not pass, when the samples change meanwhile, or when the hardware is lost.
        """
        passed = self._passed
        if passed is None or passed[0] is not manifest or passed[1] is not samples:
            self.check(manifest, samples)
        return self._said(self._sink.play(manifest, self._gated(manifest, samples), progress or _silent))

    def _said(self, report: object) -> SinkReport:
        if not isinstance(report, SinkReport):
            raise SinkError(f"sink {self.name}: it gives no SinkReport but {report!r:.60}; {_cure(self.name)}")
        return report

    def _limits_for(self, manifest: Manifest) -> GateLimits:
        return self._limits or GateLimits.of(manifest.device, len(manifest.channels))

    def _gated(self, manifest: Manifest, samples: SampleReader) -> SampleReader:
        return _GatedSamples(manifest, samples, self._limits_for(manifest))


class _GatedSamples:
    """Samples that are held against the gate while they are read: a file may change after it was checked."""

    def __init__(self, manifest: Manifest, samples: SampleReader, limits: GateLimits) -> None:
        self._manifest = manifest
        self._samples = samples
        self._limits = limits

    @property
    def path(self) -> Path:
        return self._samples.path

    @property
    def rate_hz(self) -> int:
        return self._samples.rate_hz

    @property
    def samples(self) -> int:
        return self._samples.samples

    def blocks(self, block: int) -> Iterator[NDArray[np.float64]]:
        gate = Gate(self._limits, self._manifest.channels, self._manifest.rate_hz, refused=CHANGED)
        for volts in self._samples.blocks(block):
            gate.check(volts)
            yield volts


def _maker(name: str) -> Callable[..., object]:
    offers = [point for point in (SINKS.get(name), *entry_points(group=GROUP, name=name)) if point is not None]
    if not offers:
        raise SinkError(f"there is no sink {name!r}; there are {', '.join(sink_names())}")
    if len(offers) > 1:
        raise SinkError(f"sink {name}: {' and '.join(map(_offered_by, offers))} both offer it; uninstall one")
    try:
        maker: Callable[..., object] = offers[0].load()
    except (ImportError, AttributeError, SyntaxError) as error:
        raise SinkError(f"sink {name}: {_offered_by(offers[0])} cannot be loaded: {error}; {_cure(name)}") from None
    if not callable(maker):
        raise SinkError(f"sink {name}: {offers[0].value} makes nothing; {_cure(name)}")
    return maker


def _offered_by(point: EntryPoint) -> str:
    return point.dist.name if point.dist is not None else "dotwave"


def _cure(name: str) -> str:
    return f"reinstall or mend the package that offers {name}"


def _options(maker: Callable[..., object]) -> str:
    return ", ".join(list(inspect.signature(maker).parameters)[1:]) or "no options"


def _silent(_: float) -> None:
    pass
