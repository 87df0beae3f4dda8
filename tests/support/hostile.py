"""Extreme settings, and the systems they are tried on."""

from typing import Any

import numpy as np

from chainsim import Chain, Setting

ESCAPE = 2 / (3 * np.sqrt(3))
Given = dict[str, Any]
BASE: Given = {"n": 6, "delta": 0.02, "beta": -1.0, "epsilon": 1e-3, "lam": 0.01, "omega": 1.05, "preload": 0.0}


def fold(delta: float, omega: float) -> float:
    """The drive at which the lower branch of the first oscillator ends, by the cubic of one harmonic."""
    kappa, g = 1 - omega**2, delta * omega
    v = kappa / 3 * (2 - np.sqrt(1 - 3 * (g / kappa) ** 2))
    return float(np.sqrt(v * ((kappa - v) ** 2 + g * g) / 0.75))


HOSTILE: list[Given] = [
    *({"lam": value} for value in (0.0, 1e-12, 1.0, 1e6, -2.0)),
    *({"omega": value} for value in (1e-6, 1e-3, 1.0, np.nextafter(1.0, 0), np.nextafter(1.0, 2), 1e3, 1e6)),
    *({"delta": value} for value in (0.0, 1e-12, 1.0, 1e6)),
    *({"beta": value} for value in (0.0, 1e-12, -1e-12, 1e12, -1e12, 1e300, -1e300, 1e-300, -5e-324)),
    *({"epsilon": value} for value in (0.0, 5e-324, 1e-200, 1.0, 1e12, 1e300)),
    *({"epsilon": fold(0.02, 0.95) * (1 + by), "omega": 0.95} for by in (-1e-12, 1e-12)),
    *({"preload": ESCAPE * (1 + by), "epsilon": 0.0} for by in (-1e-9, 1e-9)),
    *({"epsilon": ESCAPE * (1 + by), "omega": 1e-3} for by in (-1e-9, 1e-9)),
    *({"n": value} for value in (1, 2, 1000)),
    {"preload": 1e12},
    {"preload": 0.1, "epsilon": 0.0},
    {"beta": -1e12, "epsilon": 1e-9},
    {"beta": 1.0, "epsilon": 30.0, "delta": 0.2},
    {"delta": 0.0, "omega": 1.0, "beta": 0.0},
    {"delta": 1e6, "omega": 1e-6},
    {"lam": 1e6, "omega": 1e3},
]
CLOSURES: dict[str, Given] = {
    "open": {}, "ring": {"closure": "ring"}, "bidirectional": {"closure": "bidirectional"}, "grid": {}
}  # fmt: skip
SYSTEMS = CLOSURES | {"amplifier": {"kind": "amplifier"}, "unequal": {}}
ROWS = {1: 1, 2: 2, 6: 2, 1000: 20, 1_000_000: 1000}


def built(system: str, extreme: Given) -> tuple[Chain, Setting]:
    values = BASE | extreme
    n, given = values["n"], {"delta": values["delta"], "beta": values["beta"]} | SYSTEMS[system]
    if system == "grid":
        given["rows"] = ROWS.get(n, 1)
    if system == "unequal":
        given["stiffness"] = np.resize([1.0, 1.01], n)
        given["delta"] = values["delta"] * np.resize([1.0, 1.5], n)
    chain = Chain.of(n, **given)
    down = {"lam_y": values["lam"]} if chain.rows > 1 else {}
    names = ("epsilon", "lam", "omega", "preload")
    return chain, Setting.of(chain, **{name: values[name] for name in names}, **down)
