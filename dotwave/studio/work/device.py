"""What a device does: the resonance of one actuator, its deflection under a bias, and patterns that can be made."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Device, Setting, load_device, solve

from ...api.plans import plan
from ...api.scenes import texture
from ...progress import progress
from .tell import Tell

__all__ = ["do"]

POINTS = 61
SHARES = (0.01, 0.1, 1.0)
TOL = 1e-3


def do(folder: Path, asked: Mapping[str, Any], tell: Tell) -> dict[str, Any]:
    """The curves of the profile in `folder`, and which patterns it makes, plain JSON types."""
    device = load_device(str(folder / asked["profile"]))
    resonance = [_resonance(device, share) for share in SHARES]
    found = []
    with progress("patterns") as update:
        patterns = _patterns(device)
        for number, (name, levels) in enumerate(patterns.items()):
            update(number, len(patterns))
            frame = plan(texture({"levels": levels.tolist()}, device), device)[0]
            found.append({"name": name, "outcome": frame.outcome.value, "note": frame.note, "error": frame.error})
    return {
        "device": device.name, "resonance": resonance, "static": _static(device), "patterns": found,
        "full_scale": device.full_scale,
    }  # fmt: skip


def _resonance(device: Device, share: float) -> dict[str, Any]:
    """Amplitude of one actuator over the frequency, driven with a share of the volts; None where there is none."""
    omega: NDArray[np.float64] = np.linspace(device.omega.min, device.omega.max, POINTS)
    chain = Chain(n=1, delta=device.delta, beta=device.beta)
    epsilon = share * device.epsilon_max
    found = solve(
        chain, Setting.of(chain, epsilon=epsilon, lam=0.0, omega=omega), tol=TOL, rung="one_harmonic", start="rest"
    )
    amplitude = np.where([one.value == "ok" for one in found.outcome], np.abs(found.phasor[:, 0]), np.nan)
    return {
        "name": f"{share * device.amplifier.volts:g} V", "x": (omega * device.f0_hz).tolist(),
        "y": [float(a) if np.isfinite(a) else None for a in amplitude],
    }  # fmt: skip


def _static(device: Device) -> dict[str, Any] | None:
    """Deflection of one actuator over the volts of its bias; None for a device without."""
    if device.bias != "actuator":
        return None
    chain = Chain(n=1, delta=device.delta, beta=device.beta)
    volts = np.linspace(0.0, device.amplifier.volts, POINTS)
    bias = (volts * device.bias_per_volt)[:, np.newaxis]
    setting = Setting.of(chain, epsilon=0.0, lam=0.0, omega=1.0, bias=bias)
    found = solve(chain, setting, tol=TOL, rung="static", start="rest")
    fine = np.array([one.value == "ok" for one in found.outcome])
    return {
        "name": "deflection", "x": volts.tolist(),
        "y": [float(z) if ok else None for z, ok in zip(found.mean[:, 0], fine, strict=True)],
    }  # fmt: skip


def _patterns(device: Device) -> dict[str, NDArray[np.float64]]:
    rows, cols = np.indices((device.rows, device.cols))
    middle = (rows == device.rows // 2) & (cols == device.cols // 2)
    wanted = {
        "nothing but the first column": cols == 0, "nothing but the last column": cols == device.cols - 1,
        "every actuator": cols >= 0, "every second column": cols % 2 == 0, "a chessboard": (rows + cols) % 2 == 0,
        "the first row": rows == 0, "one actuator in the middle": middle,
    }  # fmt: skip
    patterns = {name: raised.astype(float) for name, raised in wanted.items()}
    return patterns | {"a slope from left to right": (cols + 1) / device.cols}
