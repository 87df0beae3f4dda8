"""Patterns that travel, from the job to what is felt: by `verify`, and by an integration written from the equations."""

from __future__ import annotations

import hashlib
import json
from bisect import bisect_right
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.io import wavfile
from scipy.special import betainc

import dotwave as dw
from dotwave.verification import verify
from encoders import levels_at

Floats = NDArray[np.float64]


def written(path: Path, scene: dw.Scene, device: str) -> Path:
    out = path / "x.wav"
    report = dw.plan(scene, device).waveform().write(out)
    assert report is not None
    return out


@pytest.mark.parametrize(("device", "rate"), [("paper-6x6", 5.0), ("linked-6x6", 1.2), ("independent-6x6", 3.0)])
def test_a_text_that_scrolls_is_felt_and_read(tmp_path: Path, device: str, rate: float) -> None:
    out = written(tmp_path, dw.text("Hi", device, presentation="scroll", rate=rate), device)
    found = verify(out)
    assert found.ok
    assert found.wrong_dots == 0
    assert found.felt_text == "Hi"
    ways = [frame.way_error for frame in found.frames]
    assert ways[0] is None
    assert max(way for way in ways if way is not None) < 0.006
    assert None not in ways[1:]
    assert "beside their way" in found.as_text()


def test_a_way_that_is_not_gone_is_found(tmp_path: Path) -> None:
    """Patterns that jump from place to place are right where they are read, and are no translation."""
    out = written(tmp_path, dw.text("Hi", presentation="scroll", rate=1.0), "paper-6x6")
    rate, samples = wavfile.read(out)
    manifest = json.loads(out.with_suffix(".json").read_text("utf-8"))
    for frame in manifest["frames"][1:]:
        first, stop = round(frame["start_s"] * rate), round(frame["end_s"] * rate)
        share = np.clip((np.arange(first, stop) - first) / (stop - first) * 4, 0, 1)[:, None]
        samples[first:stop] = samples[first] + betainc(6, 6, share) * (samples[stop - 1] - samples[first])
    wavfile.write(out, rate, samples)
    manifest["digest"] = digest(out)
    out.with_suffix(".json").write_text(json.dumps(manifest), "utf-8")
    found = verify(out)
    assert found.wrong_dots == 0
    assert not found.ok
    assert found.amplitude_error == max(frame.way_error or 0.0 for frame in found.frames)
    assert found.amplitude_error > 0.4


def digest(path: Path) -> str:
    return "sha256:" + hashlib.sha256(path.read_bytes()).hexdigest()


def row_motion(out: Path, row: int, until_s: float) -> tuple[dict[str, Any], Floats, Floats]:
    """Times and displacements of one row under the samples of a file, from the equations of the paper."""
    manifest = json.loads(out.with_suffix(".json").read_text("utf-8"))
    rate, samples = wavfile.read(out)
    device, n = manifest["device"], manifest["device"]["cols"]
    forces = np.zeros((len(samples) + 1, n))
    for channel in manifest["channels"]:
        if channel["row"] == row:
            per_volt = device["epsilon_per_volt" if channel["role"] == "drive" else "bias_per_volt"]
            volts = samples[:, channel["index"]].astype(float) * channel["volts_per_unit"]
            forces[:-1, channel.get("col") or 0] += volts * per_volt
    times, links = [0.0], [np.zeros(n - 1)]
    for event in manifest["coupling"]:
        if event["row"] == row:
            times += [event["t_s"], event["t_s"] + event["ramp_s"]]
            links += [links[-1] if event["ramp_s"] else np.array(event["lam"]), np.array(event["lam"])]
    course, tau_per_s = np.array(links), 2 * np.pi * device["f0_hz"]

    def motion(tau: float, state: Floats) -> Floats:
        z, v = state[:n], state[n:]
        place, part = divmod(tau / tau_per_s * rate, 1)
        push = (1 - part) * forces[int(place)] + part * forces[int(place) + 1] - device["delta"] * v
        push += -z - device["beta"] * z**3
        at = bisect_right(times, tau / tau_per_s)
        width = times[at] - times[at - 1] if at < len(times) else 0.0
        share = (tau / tau_per_s - times[at - 1]) / width if width else 0.0
        lam = course[at - 1] + (share * (course[at] - course[at - 1]) if width else 0.0)
        push[1:] += lam * (z[:-1] - z[1:])
        return np.concatenate([v, push])

    # Often enough for two periods of what is felt.
    time_s = np.arange(0, round(until_s * rate), rate // 4000) / rate
    span = (0.0, time_s[-1] * tau_per_s)
    found = solve_ivp(motion, span, np.zeros(2 * n), "DOP853", time_s * tau_per_s, rtol=1e-6, atol=1e-9, max_step=0.25)
    return manifest, time_s, found.y[:n].T / device["full_scale"]


@pytest.mark.parametrize("device", ["paper-6x6", "linked-6x6"])
def test_by_the_equations_alone_a_dot_goes_its_way(tmp_path: Path, device: str) -> None:
    kind = {"dot": {"path": [[2, 1], [2, 5]], "actuators_per_s": 2.9}}
    out = written(tmp_path, dw.texture(kind, device, dwell_s=0.35), device)
    manifest, time_s, felt = row_motion(out, 2, 0.6 + 1 / 2.9)
    for before, frame in zip(manifest["frames"], manifest["frames"][1:], strict=False):
        omega, length = frame["omega"][2] * 2 * np.pi * manifest["device"]["f0_hz"], frame["end_s"] - frame["start_s"]
        old, new = np.array(before["target"][2]), np.array(frame["target"][2])
        for share in (0.3, 0.4, 0.5, 0.6, 0.7, 0.95):
            middle = frame["start_s"] + share * length
            near = np.abs(time_s - middle) < 1 / manifest["device"]["f0_hz"]
            since = time_s[near] - middle
            waves = [np.cos(omega * since), np.sin(omega * since)] if omega else [np.ones_like(since)]
            basis = np.stack([*waves, *(since * wave for wave in waves)], axis=1)
            level = np.linalg.norm(np.linalg.lstsq(basis, felt[near])[0][: len(waves)], axis=0)
            np.testing.assert_allclose(level, old + (new - old) * betainc(10, 10, share), atol=0.01)
    assert len(manifest["frames"]) == 2


def test_what_is_planned_is_what_the_encoder_says_at_any_time(tmp_path: Path) -> None:
    """The bias alone tells: without coupling and at rest it is z + beta z^3, and the way is far slower than f0."""
    kind = {"dot": {"circle": {"radius": 1.0}, "actuators_per_s": 2.0}}
    scene = dw.texture(kind, "paper-6x6", dwell_s=2.0)
    out = written(tmp_path, scene, "paper-6x6")
    rate, samples = wavfile.read(out)
    manifest = json.loads(out.with_suffix(".json").read_text("utf-8"))
    device = manifest["device"]
    for time_s in np.linspace(0.7, 2.5, 37):
        wanted = levels_at(scene, float(time_s)) * device["full_scale"]
        for channel in manifest["channels"]:
            if channel["role"] == "bias":
                z = wanted[channel["row"], channel["col"]]
                force = samples[round(time_s * rate), channel["index"]] * channel["volts_per_unit"]
                assert force * device["bias_per_volt"] == pytest.approx(z + device["beta"] * z**3, abs=2e-3)
