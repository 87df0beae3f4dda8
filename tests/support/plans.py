"""Plans made by hand, on devices with round numbers."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from chainsim import Amplifier, Device, Outcome, Span, load_device
from encoders import Frame, TargetPattern
from planner import FramePlan, Margins, OperatingPoint, Plan, Ramp

NAMES = ["linked-6x6", "paper-6x6", "independent-6x6", "linked-40x96"]


def load(name: str) -> Device:
    """A built-in profile's layout with the numbers these tests count on."""
    device = load_device(name)
    lam = Span(min=0.0, max=1.0 if device.coupling.scope == "link" else 0.0)
    return device.model_copy(
        update={
            "f0_hz": 133.13,
            "epsilon_per_volt": 2e-3,
            "bias_per_volt": 2e-3,
            "omega": Span(min=0.9, max=1.5),
            "coupling": device.coupling.model_copy(update={"lam": lam}),
            "amplifier": Amplifier(volts=100.0, slew_v_per_s=3e5, rate_hz=8000),
        }
    )


def levels(device: Device, level: float, lam: float, omega: float = 1.25) -> OperatingPoint:
    n, biased = device.chain_length, device.bias == "actuator"
    return OperatingPoint(
        target=np.full(n, level / 3), epsilon=0j if biased else 0.05j * level, lam=np.full(n - 1, lam),
        bias=np.full(n, 0.1 * level if biased else 0.0), omega=omega, phasor=np.zeros(n, dtype=np.complex128),
        mean=np.zeros(n), error=0.0, margins=Margins(0.0, 0.0), outcome=Outcome.OK,
    )  # fmt: skip


def frames(device: Device, count: int, dwell_s: float = 0.1) -> Iterator[FramePlan]:
    """Frames that swing between two levels, and a way out."""
    chains, before = device.rows * device.chains_per_row, levels(device, 0.0, 0.0)
    t_s = np.array([0.0, 0.02, 0.04])
    top = device.coupling.lam.max
    for k in range(count + 1):
        held = levels(device, 0.0 if k == count else 1.0 - 0.5 * (k % 2), top / (3 + k % 2))
        mix = np.array([0.0, 0.5, 1.0])
        ramp = Ramp(
            t_s,
            epsilon=before.epsilon + (held.epsilon - before.epsilon) * mix,
            bias=before.bias + np.outer(mix, held.bias - before.bias) if device.bias == "actuator" else None,
            lam_t_s=t_s if device.coupling.scope == "link" else None,
            lam=before.lam + np.outer(mix, held.lam - before.lam) if device.coupling.scope == "link" else None,
        )
        pattern = TargetPattern(np.full((device.rows, device.cols), 1 - k % 2, dtype=np.complex128))
        shown = None if k == count else Frame(pattern, dwell_s, page=k, text=f"«{k}»", span=(k, k + 1), cells="⠁\n⠃")
        start_s = k * dwell_s
        yield FramePlan(
            shown, start_s, start_s + 0.04, start_s + dwell_s, (held,) * chains, (ramp,) * chains,
            Outcome.UNREACHABLE if k == 1 else Outcome.OK,
        )  # fmt: skip
        before = held


def plan_of(name: str, count: int = 3, encoding: dict[str, Any] | None = None) -> Plan:
    device = load(name)
    return Plan(device, list(frames(device, count)), encoding or {"table": "en.ctb"})
