"""What a sink is: where samples can be played, and what it says of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from ..errors import DriverError
from ..formats.samples import SampleReader
from ..waveform.manifest import Manifest

__all__ = ["Sink", "SinkError", "SinkReport"]


class SinkError(DriverError, ValueError):
    """There is no such sink, or it cannot be had.

    Examples: a name nobody offers; a name that two packages offer; a package that fails to load; an option the
    sink does not have.
    """


@dataclass(frozen=True)
class SinkReport:
    """What a sink says of a waveform, before or after playing it.

    Attributes
    ----------
    ok : False when the output was held up on its way.
    facts : keys of the JSON report and what stands there, of plain JSON types.
    lines : the same as sentences.
    notes : what else a person should know or do.
    """

    ok: bool = True
    facts: Mapping[str, Any] = field(default_factory=dict)
    lines: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@runtime_checkable
class Sink(Protocol):
    """Where samples can be played. Making one opens nothing and sends nothing; only `play` does.

    What calls a sink is `OpenSink`: it has held the waveform against the safety gate before, and hands over samples
    that are held against it once more while they are read.
    """

    def check(self, manifest: Manifest, samples: SampleReader) -> SinkReport:
        """What playing would do; raises a DriverError when the waveform does not fit. Nothing is sent."""
        ...

    def play(self, manifest: Manifest, samples: SampleReader, progress: Callable[[float], None]) -> SinkReport:
        """Play to the end; on every error and Ctrl-C the output goes to zero. `progress` gets the seconds played."""
        ...

    def close(self) -> None:
        """Give back what `play` may have left open; may be called at any time."""
        ...
