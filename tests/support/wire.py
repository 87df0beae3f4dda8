"""A small controller and a stream of samples for it."""

from collections.abc import Iterator

import numpy as np

from chainsim import Device
from drivers.protocol.messages import VERSION, Mark, SamplesMessage, StartMessage
from drivers.protocol.outgoing import End, Message
from drivers.protocol.playout import ControllerSpec
from drivers.protocol.replies import Capabilities

SPEC = ControllerSpec(
    rows=2, cols=3, channels=2, rate_hz=8000, buffer_samples=2000, event_slots=16, full_volts=100.0,
    lam_step=1 / 65535, lam_max=1.0, watchdog_s=0.2, ramp_s=0.05, drift_ppm=0.0,
)  # fmt: skip


def capabilities_of(device: Device, *, version: int = VERSION) -> Capabilities:
    """What a controller for `device` says, without room for samples."""
    spec = ControllerSpec.of(device)
    return Capabilities(
        version=version, rows=spec.rows, cols=spec.cols, channels=spec.channels, rate_hz=spec.rate_hz, bits=16,
        buffer_samples=0, event_slots=512, max_payload=512, full_volts=spec.full_volts, lam_step=spec.lam_step,
        lam_max=spec.lam_max, watchdog_ms=200, ramp_ms=50, session=0, next_number=0,
    )  # fmt: skip


def stream(codes: np.ndarray, marks: list[int], _: Capabilities) -> Iterator[Message]:
    yield StartMessage(7, False, SPEC.rate_hz, len(codes))
    for first in range(0, len(codes), 48):
        for number, at in enumerate(marks):
            if first <= at < first + 48:
                yield Mark(at, number)
        yield SamplesMessage(first, codes[first : first + 48])
    yield End(len(codes))
