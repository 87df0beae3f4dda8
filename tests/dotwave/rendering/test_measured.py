"""From measured sweeps to patterns that are right on the device as it really is."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Device, load_device
from chainsim.model.calibrated import Actuator
from dotwave.api.scenes import device as device_of, text as text_scene
from dotwave.rendering.render import render
from dotwave.reports.text import VerifyReport
from dotwave.studies.calibrate import calibrate
from dotwave.studies.measured_sweeps import COLUMNS
from dotwave.verification import verify
from drivers import write_waveform
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import plan_scene
from planner.robustness.batch_march import BatchParts, march

Floats = NDArray[np.float64]

LAM_SET, NOISE, DRIVES_V = 6e-3, 0.003, (0.15, 0.4)
FREQUENCIES_HZ = np.linspace(128.0, 138.5, 47)


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path / "cache"))


@dataclass(frozen=True)
class Real:
    """A device as it is: float64, shape (rows, cols) each; the first `lam` of a chain is not used."""

    device: Device
    natural: Floats
    delta: Floats
    beta: Floats
    lam: Floats
    per_volt: float

    @classmethod
    def drawn(cls, name: str, seed: int) -> Real:
        device, rng = load_device(name), np.random.default_rng(seed)
        shape = (device.rows, device.cols)
        return cls(
            device, rng.normal(1, 0.01, shape), device.delta * rng.normal(1, 0.05, shape),
            device.beta * rng.normal(1, 0.05, shape), LAM_SET * rng.normal(1, 0.03, shape), 2.1e-3,
        )  # fmt: skip

    def profile(self) -> Device:
        """The profile that tells the truth."""
        n = self.device.chain_length
        actuators = tuple(
            Actuator(
                row=row, col=col, f0_hz=self.device.f0_hz * self.natural[row, col], delta=self.delta[row, col],
                beta=self.beta[row, col], lam=self.lam[row, col] if col % n else None,
                lam_set=LAM_SET if col % n else None, epsilon_per_volt=None if col % n else self.per_volt,
            )
            for row in range(self.device.rows)
            for col in range(self.device.cols)
        )  # fmt: skip
        return self.device.model_copy(update={"actuators": actuators})

    def sweeps(self, path: Path, seed: int) -> None:
        """Write what a careful laboratory would measure of it: noise on either part of every phasor."""
        rng, n, f0 = np.random.default_rng(seed), self.device.chain_length, self.device.f0_hz
        lines = [",".join(COLUMNS)]
        omega = (FREQUENCIES_HZ / f0)[:, None]
        for row in range(self.device.rows):
            for first in range(0, self.device.cols, n):
                part = slice(first, first + n)
                natural, delta, beta = (one[row, part, None, None] for one in (self.natural, self.delta, self.beta))
                force = np.zeros((n, 1, len(DRIVES_V)), dtype=np.complex128)
                force[0] = self.per_volt * np.array(DRIVES_V)
                lam = np.append(0.0, self.lam[row, first + 1 : first + n])[:, None, None]
                seen = march(BatchParts(natural**2, delta, beta, np.ones((n, 1, 1))), force, lam, omega).phasor
                noise = rng.standard_normal(seen.shape) + 1j * rng.standard_normal(seen.shape)
                seen = seen + NOISE * np.abs(seen).max(axis=(1, 2), keepdims=True) * noise
                for m, k, drive in np.ndindex(seen.shape):
                    z = seen[m, k, drive]
                    numbers = (FREQUENCIES_HZ[k], DRIVES_V[drive], abs(z), np.angle(z))
                    lines.append(f"{row},{first + m}," + ",".join(f"{one:.9g}" for one in numbers))
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def felt_on(real: Device, planned_for: str, out: Path) -> VerifyReport:
    """What "Hi", planned for one device, makes felt on another."""
    profile = device_of(planned_for)
    report = render(text_scene("Hi", profile), profile, out)
    assert report.ok, report.as_text()
    manifest = out.with_suffix(".json")
    told = json.loads(manifest.read_text(encoding="utf-8"))
    manifest.write_text(json.dumps(told | {"device": real.as_dict()}), encoding="utf-8")
    return verify(out)


@pytest.mark.parametrize("name", ["linked-6x6", "independent-6x6"])
def test_a_calibrated_device_is_right_where_the_profile_is_not(name: str, tmp_path: Path) -> None:
    real = Real.drawn(name, seed=5)
    real.sweeps(tmp_path / "sweep.csv", seed=6)
    own = tmp_path / "own.yaml"
    linked = real.device.chain_length > 1
    report = calibrate(str(tmp_path / "sweep.csv"), device=name, out=own, lam_set=LAM_SET if linked else None)
    assert report.ok, report.as_text()
    blind = felt_on(real.profile(), name, tmp_path / "blind.wav")
    known = felt_on(real.profile(), str(own), tmp_path / "known.wav")
    assert known.wrong_dots == 0
    assert known.text_equal
    assert known.amplitude_error < blind.amplitude_error / 4
    assert not blind.ok


def test_a_biased_device_is_planned_with_what_was_measured(tmp_path: Path) -> None:
    """The truth itself as the profile: what is left is the integration's own error."""
    real = Real.drawn("paper-6x6", seed=7).profile()
    profile = tmp_path / "real.json.yaml"
    profile.write_text(json.dumps(real.as_dict()), encoding="utf-8")
    blind = felt_on(real, "paper-6x6", tmp_path / "blind.wav")
    known = felt_on(real, str(profile), tmp_path / "known.wav")
    assert blind.amplitude_error > 0.02
    assert known.amplitude_error < 1e-6
    assert known.ok


def test_a_manifest_is_verified_with_its_own_actuators(tmp_path: Path) -> None:
    """Drive, links, stiffness, damping and cubic term of every actuator count: each alone spoils a plan without it."""
    real = Real.drawn("linked-6x6", seed=8)
    every = np.ones((6, 6))
    plain = Real(real.device, every, 5.3006e-3 * every, -1.0 * every, LAM_SET * every, per_volt=2e-3)
    # Damping and the cubic term matter little so far from resonance; what they change must be seen all the same.
    seen = {"natural": 0.02, "delta": 1e-5, "beta": 1e-4, "lam": 0.02, "per_volt": 0.02}
    for field, least in seen.items():
        changed = Real(**(vars(plain) | {field: getattr(real, field)}))
        report = felt_on(changed.profile(), "linked-6x6", tmp_path / f"{field}.wav")
        assert report.amplitude_error > least, field
    assert felt_on(plain.profile(), "linked-6x6", tmp_path / "same.wav").amplitude_error < 1e-6


@pytest.mark.slow
def test_a_wave_goes_its_way_with_links_and_drives_as_they_are(tmp_path: Path) -> None:
    """Every lam makes 1.05 and every drive 1.1 of what it is set to: the wave stands as on the device without."""
    plain = load_device("paper-6x6")
    every = np.ones((6, 6))
    real = Real(plain, every, plain.delta * every, plain.beta * every, 1.05 * LAM_SET * every, 2.2e-3)
    wave = 0.1 * np.exp(-0.5j * np.pi * np.arange(6))[None].repeat(6, axis=0)
    scene = Scene(GridShape(6, 6), [Frame(TargetPattern(wave, phase_matters=True), 8.0)])
    device = real.profile()
    write_waveform(plan_scene(scene, device), tmp_path / "wave.wav", encoding="float32")
    report = verify(tmp_path / "wave.wav")
    assert report.frames[0].outcome == "ok"
    assert report.amplitude_error < 2e-3 * 0.1
    manifest = json.loads((tmp_path / "wave.json").read_text(encoding="utf-8"))
    (tmp_path / "wave.json").write_text(json.dumps(manifest | {"device": plain.as_dict()}), encoding="utf-8")
    assert verify(tmp_path / "wave.wav").amplitude_error > 0.05 * 0.1
