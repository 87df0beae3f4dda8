"""The safety gate: plans that each break one limit are refused with channel, time, value and limit; nothing is sent."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from chainsim import Device, load_device
from dotwave.playing.play import play
from drivers import UnreadableWaveform, WavWriter, channels_of, open_sink, read_waveform
from drivers.safety import Gate, GateLimits, GateRefusal, GateReport, pass_gate
from drivers.waveform.manifest import digest_of

RATE = 8000
DEVICE = load_device("paper-6x6")
# Wide enough that none but the limit under test is met; 60 nF and a loss of 0.02, as the defaults.
WIDE = GateLimits(
    volts=100.0, slew_v_per_s=3e5, dc_volts=60.0, duty=0.5, current_a=1.0, supply_a=1.0, energy_j=1.0, lam_max=0.05
)


def written(folder: Path, volts: np.ndarray, device: Device = DEVICE, lam: float | None = None) -> Path:
    """A waveform file of these volts, by hand: the package's own writer would refuse them."""
    path = folder / "made.wav"
    channels = channels_of(device)
    with path.open("wb") as file:
        writer = WavWriter(file, channels, RATE, "float32")
        writer.write(volts)
        writer.finish()
    coupling: list[dict[str, Any]] = []
    if lam is not None:
        coupling = [{"t_s": 0.25, "row": 3, "lam": [0.01, lam, 0.01, 0.01, 0.01], "ramp_s": 0.0}]
    manifest = {
        "schema": "dotwave/waveform/1", "samples_file": path.name, "rate_hz": RATE, "samples": len(volts),
        "digest": digest_of(path), "device": device.as_dict(),
        "channels": [channel.as_dict() for channel in channels], "coupling": coupling, "frames": [],
    }  # fmt: skip
    path.with_suffix(".json").write_text(json.dumps(manifest))
    return path


def silence(seconds: float = 2.0) -> np.ndarray:
    return np.zeros((round(seconds * RATE), 42))


def bump(height: float, first: int, stop: int, channel: int) -> np.ndarray:
    """A half sine, 0 at both ends."""
    volts = silence()
    volts[first:stop, channel] = height * np.sin(np.linspace(0, np.pi, stop - first))
    return volts


def tone(height: float, hertz: float, channels: slice = slice(0, 1)) -> np.ndarray:
    volts, t_s = silence(), np.arange(2 * RATE) / RATE
    volts[:, channels] = (height * np.sin(2 * np.pi * hertz * t_s) * np.sin(np.pi * t_s / 2) ** 2)[:, np.newaxis]
    return volts


def plateau(height: float, first_s: float, stop_s: float, channel: int) -> np.ndarray:
    t_s = np.arange(2 * RATE) / RATE
    rise = np.interp(t_s, [first_s, first_s + 0.05, stop_s - 0.05, stop_s], [0, 1, 1, 0])
    volts = silence()
    volts[:, channel] = height * rise
    return volts


def step(height: float, sample: int, channel: int) -> np.ndarray:
    volts = silence()
    volts[sample : sample + 1000, channel] = height
    volts[sample + 1000 : sample + 2000, channel] = np.linspace(height, 0, 1000)
    return volts


@dataclass(frozen=True)
class Case:
    """A waveform that breaks one limit, and what the refusal has to say."""

    volts: Callable[[], np.ndarray]
    quantity: str
    channel: int
    time_s: float
    value: float
    limit: float
    limits: GateLimits = WIDE
    lam: float | None = None


def held_to_the_end() -> np.ndarray:
    volts = silence()
    volts[8000:, 7] = np.linspace(0, 50, 8000)
    return volts


# Where a half sine of 101 V over samples 4000 to 5000 passes 100 V.
OVER_100 = 4000 + 1000 * np.arcsin(100 / 101) / np.pi
HEAT = 0.02 * 60e-9 / 2
CASES = {
    "volts of a drive": Case(lambda: bump(101, 4000, 5001, 2), "volts", 2, OVER_100 / RATE, 100.0, 100.0),
    "volts of a bias, negative": Case(lambda: bump(-130, 4000, 5001, 41), "volts", 41, 0.0, 100.0, 100.0),
    "not a number": Case(lambda: bump(100, 4000, 5001, 0), "volts", 0, 0.0, 0.0, 99.0, replace(WIDE, volts=99.0)),
    "a step": Case(lambda: step(50, 4000, 9), "slew", 9, 0.5, 4e5, 3e5),
    "a step at the start": Case(lambda: step(50, 0, 5), "slew", 5, 0.0, 4e5, 3e5),
    "a step at the end": Case(held_to_the_end, "slew", 7, 2.0, 4e5, 3e5),
    "a constant part": Case(lambda: plateau(70, 0.1, 1.9, 1), "dc", 1, 1.0, 70.0, 60.0),
    "high for too long": Case(lambda: plateau(95, 0.2, 0.8, 3), "duty", 3, 0.75, 0.0, 0.4, replace(WIDE, duty=0.4)),
    "current": Case(lambda: tone(90, 200, slice(4, 5)), "current", 4, 0.0, 0.0, 5e-3, replace(WIDE, current_a=5e-3)),
    "current of all": Case(
        lambda: tone(90, 100, slice(0, 42)), "supply", -1, 0.0, 0.0, 0.1, replace(WIDE, supply_a=0.1)
    ),
    # 4 quarters of a period charge or discharge 90^2 each: 400 of them in a window of a second at 100 Hz.
    "heat": Case(
        lambda: tone(90, 100), "energy", 0, 0.0, 400 * 90**2 * HEAT, 1e-3, replace(WIDE, energy_j=1e-3)
    ),
    "coupling": Case(silence, "lam", 3, 0.25, 0.06, 0.05, lam=0.06),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_each_limit_refuses_what_breaks_it_alone(tmp_path: Path, case: Case) -> None:
    manifest, reader = read_waveform(written(tmp_path, case.volts(), lam=case.lam))
    with pytest.raises(GateRefusal) as refused:
        pass_gate(manifest, reader, case.limits)
    error = refused.value
    assert (error.quantity, error.channel, error.limit) == (case.quantity, case.channel, case.limit)
    assert error.value > error.limit
    if case.time_s:
        assert error.time_s == pytest.approx(case.time_s, abs=2 / RATE + 1e-9)
    if case.value and case.quantity in {"slew", "lam"}:
        assert error.value == pytest.approx(case.value)
    text = str(error)
    assert text.startswith("refused, nothing was sent: ")
    assert f"{error.limit:.4g}" in text
    assert f"{error.value:.4g}" in text
    # With this one limit wide open the same waveform passes.
    names = {"dc": "dc_volts", "slew": "slew_v_per_s", "current": "current_a", "supply": "supply_a", "lam": "lam_max",
             "energy": "energy_j"}  # fmt: skip
    pass_gate(manifest, reader, replace(case.limits, **{names.get(case.quantity, case.quantity): 1e9}))


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_what_is_refused_never_reaches_a_port(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: Case) -> None:
    opened: list[object] = []
    for place in ("controller.Uart", "board.Uart", "audio.play_audio"):
        monkeypatch.setattr(f"drivers.sinks.{place}", lambda *given, **_: opened.append(given))
    path = written(tmp_path, case.volts(), lam=case.lam)
    for address in ("controller:/dev/ttyACM0", "drv2667:/dev/ttyUSB0", "audio:0"):
        with pytest.raises(GateRefusal, match="nothing was sent"):
            play(path, live=True, limits=case.limits, to=address)
        with open_sink(address, limits=case.limits) as sink, pytest.raises(GateRefusal, match="nothing was sent"):
            sink.play(*read_waveform(path))
    assert not opened


def test_the_report_says_how_near_the_limits_it_is(tmp_path: Path) -> None:
    manifest, reader = read_waveform(written(tmp_path, tone(80, 100)))
    report = pass_gate(manifest, reader, WIDE)
    slope = 80 * 2 * np.pi * 100
    assert report.volts == pytest.approx(80, rel=2e-3)
    assert report.slew_v_per_s == pytest.approx(slope, rel=1e-2)
    assert report.current_a == pytest.approx(60e-9 * slope, rel=1e-2)
    assert report.supply_a == pytest.approx(report.current_a)
    # What is left of a tone that grows by 80 V in the second of a window.
    assert report.dc_volts == pytest.approx(80 / (2 * np.pi * 100), rel=0.01)
    assert report.duty == 0
    # sin^4 has the mean 3/8 over two seconds; the window sees the middle one: 3/8 + 1/pi.
    mean = 3 / 8 + 1 / np.pi
    assert report.energy_j == pytest.approx(400 * 80**2 * mean * HEAT, rel=0.02)


@given(st.lists(st.integers(1, 3000), min_size=1, max_size=6), st.integers(0, 2**32 - 1))
def test_blocks_do_not_matter(cuts: list[int], seed: int) -> None:
    volts = np.random.default_rng(seed).uniform(-5, 5, (sum(cuts), 2))
    channels = channels_of(DEVICE)[:2]

    def report(parts: list[int]) -> GateReport:
        gate, at = Gate(replace(WIDE, window_s=0.1), channels, RATE), 0
        for part in parts:
            gate.check(volts[at : at + part])
            at += part
        return gate.finish()

    whole, cut = report([len(volts)]), report(cuts)
    for name in GateReport.__dataclass_fields__:
        assert getattr(whole, name) == pytest.approx(getattr(cut, name), rel=1e-9)


def test_not_a_number_is_never_passed() -> None:
    gate = Gate(WIDE, channels_of(DEVICE), RATE)
    volts = silence(0.1)
    volts[7, 3] = np.nan
    with pytest.raises(GateRefusal, match=r"volts of channel 3 .* is nan V at 0.000875 s"):
        gate.check(volts)


def test_a_file_that_was_changed_is_not_played(tmp_path: Path) -> None:
    path = written(tmp_path, tone(80, 100))
    with path.open("r+b") as file:
        file.seek(5000)
        file.write(b"\0\0\x80\x3f")
    manifest, reader = read_waveform(path)
    with pytest.raises(UnreadableWaveform, match="digest"):
        pass_gate(manifest, reader, WIDE)


def test_the_devices_own_limits() -> None:
    paper, linked = (load_device(name) for name in ("paper-6x6", "linked-6x6"))
    limits = GateLimits.of(paper, 42)
    assert (limits.volts, limits.slew_v_per_s, limits.lam_max) == (100.0, 3e5, 0.05)
    assert limits.dc_volts == 100.0
    assert GateLimits.of(linked, 6).dc_volts == pytest.approx(5.0)
    assert limits.current_a == pytest.approx(0.018)
