"""Simulate the sample measurement: ``python samples/calibration/make_sweep.py``. Same bytes on every run.

The actuators of row 0 of `linked-6x6` differ by 1 % in natural frequency and 5 to 10 % in the rest. The full equations
(harmonic balance) are followed up and down in frequency at two drives, with every link set to 0.006, and noise of 1 %
of each actuator's largest amplitude is added. What went in is in the lines that start with #.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Setting, balance_near, load_device, solve

HERE = Path(__file__).parent
SEED, LAM_SET, NOISE = 4, 6.0e-3, 0.01
DRIVES_V = (0.15, 0.6)
FREQUENCIES_HZ = np.round(np.linspace(128.0, 138.0, 61), 3)
TOL = 1e-8

Complexes = NDArray[np.complex128]


def followed(chain: Chain, frequencies: NDArray[np.float64], epsilon: float, lam: list[float]) -> list[Complexes]:
    """Phasors at each frequency in turn, each next to the one before; a jump where that has no neighbour."""
    found: list[Complexes] = []
    f0 = load_device("linked-6x6").f0_hz
    for frequency in frequencies:
        setting = Setting.of(chain, epsilon=epsilon, lam=[lam], omega=frequency / f0)
        response = balance_near(chain, setting, found[-1][None], tol=TOL) if found else None
        if response is None or response.outcome[0] != "ok" or _unlike(response.phasor[0], found[-1]):
            response = solve(chain, setting, tol=TOL, rung="harmonic_balance", start="rest")
        found.append(response.phasor[0])
    return found


def _unlike(here: Complexes, before: Complexes) -> bool:
    return bool(np.abs(here - before).max() > 0.5 * np.abs(before).max())


def main() -> None:
    """Write sweep.csv beside this file."""
    device, rng = load_device("linked-6x6"), np.random.default_rng(SEED)
    n = device.chain_length
    f0 = device.f0_hz * (1 + 0.01 * rng.standard_normal(n))
    delta = device.delta * (1 + 0.1 * rng.standard_normal(n))
    beta = device.beta * (1 + 0.1 * rng.standard_normal(n))
    lam = LAM_SET * (1 + 0.05 * rng.standard_normal(n - 1))
    chain = Chain.of(n, delta=delta, beta=beta, stiffness=(f0 / device.f0_hz) ** 2)
    shots = [
        (frequency, drive, phasor)
        for drive in DRIVES_V
        for way in (FREQUENCIES_HZ, FREQUENCIES_HZ[::-1])
        for frequency, phasor in zip(way, followed(chain, way, drive * device.epsilon_per_volt, list(lam)), strict=True)
    ]
    clean = np.array([phasor for _, _, phasor in shots])
    noise = rng.standard_normal((2, *clean.shape)) * NOISE * np.abs(clean).max(axis=0)
    seen = clean + noise[0] + 1j * noise[1]
    truth = {"f0_hz": f0, "delta": delta, "beta": beta, "lam": np.append(np.nan, lam)}
    lines = [f"# {name}: {' '.join(f'{value:.6g}' for value in values)}" for name, values in truth.items()]
    lines.append("row,col,frequency_hz,drive_v,amplitude,phase_rad")
    for col in range(n):
        for (frequency, drive, _), z in zip(shots, seen[:, col], strict=True):
            lines.append(f"0,{col},{frequency:g},{drive:g},{abs(z):.5g},{np.angle(z):.4f}")
    (HERE / "sweep.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
