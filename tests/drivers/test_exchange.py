"""Haptic exchange files: held to their formats' rules, and read back."""

import json

import numpy as np
import pytest

from chainsim import load_device
from drivers import EXCHANGE_SUFFIXES, FileError, UnreadableWaveform, WaveformError, read_exchange, write_exchange
from drivers.exchange.curves import haptic_curves
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import plan_scene


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path / "cache"))


def plan(device="linked-6x6", frames=4, dwell_s=0.8):
    rng = np.random.default_rng(4)
    shown = [Frame(TargetPattern((rng.random((6, 6)) < 0.5).astype(complex)), dwell_s, page=k) for k in range(frames)]
    return plan_scene(Scene(GridShape(6, 6), shown), load_device(device))


def at(curves, time_s, row=0, col=0):
    return np.interp(time_s, curves.time_s, curves.level[:, row, col])


def test_hjif_carries_the_whole_grid_with_its_phases(tmp_path):
    path = tmp_path / "x.hjif"
    write_exchange(plan(), path)
    made, back = haptic_curves(plan()), read_exchange(path)
    assert back.level.shape[1:] == (6, 6)
    np.testing.assert_allclose(back.frequency_hz, made.frequency_hz, atol=1e-5)
    middle = (made.time_s[1:] + made.time_s[:-1])[::2] / 2
    for row in range(6):
        for col in range(6):
            np.testing.assert_allclose(at(back, middle, row, col), at(made, middle, row, col), atol=2e-3)
    standing = np.searchsorted(back.time_s, made.time_s[2] - 1e-3) - 1
    turn = np.exp(1j * (back.phase[standing] - made.phase[2]))
    np.testing.assert_allclose(turn, 1, atol=1e-5)
    data = json.loads(path.read_text())
    assert (data["version"], data["profile"], data["level"]) == ("2023", "Main", 1)
    assert len(data["perceptions"][0]["channels"]) == 36


@pytest.mark.parametrize("suffix", [".ahap", ".haptic"])
@pytest.mark.parametrize("actuator", [None, (2, 3)])
def test_phone_formats_carry_one_curve(tmp_path, suffix, actuator):
    path = tmp_path / f"x{suffix}"
    write_exchange(plan(frames=12), path, actuator=actuator)
    made, back = haptic_curves(plan(frames=12)), read_exchange(path)
    wanted = made.level.mean(axis=(1, 2)) if actuator is None else made.level[:, 2, 3]
    np.testing.assert_allclose(at(back, made.time_s), wanted, atol=1e-5)
    assert back.frequency_hz[0] == pytest.approx(made.frequency_hz[0], abs=0.01)


def test_ahap_keeps_to_its_limits(tmp_path):
    path = tmp_path / "x.ahap"
    write_exchange(plan(frames=60), path)
    pattern = json.loads(path.read_text())["Pattern"]
    events = [item["Event"] for item in pattern if "Event" in item]
    curves = [item["ParameterCurve"] for item in pattern if "ParameterCurve" in item]
    assert len(events) == 2
    assert max(event["EventDuration"] for event in events) <= 30
    assert max(len(curve["ParameterCurveControlPoints"]) for curve in curves) <= 16
    assert len(curves) > 4


@pytest.mark.parametrize("suffix", EXCHANGE_SUFFIXES)
def test_same_plan_same_bytes(tmp_path, suffix):
    for name in ("a", "b"):
        write_exchange(plan(), tmp_path / f"{name}{suffix}")
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def spoiled(path, *keys, value):
    data = json.loads(path.read_text())
    place = data
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = value
    path.write_text(json.dumps(data))


@pytest.mark.parametrize(
    ("suffix", "keys", "value", "says"),
    [
        (".hjif", ("level",), 3, "level"),
        (".hjif", ("perceptions", 0, "channels", 0, "bands", 0, "band_type"), "Other", "band_type"),
        (".ahap", ("Version",), 2.0, "Version"),
        (".ahap", ("Pattern", 0, "Event", "EventDuration"), 40.0, "30 s"),
        (".haptic", ("signals", "continuous", "envelopes", "amplitude", 0, "amplitude"), 1.5, "0 to 1"),
        (".haptic", ("signals", "continuous", "envelopes", "frequency", 1, "time"), 99.0, "last amplitude"),
    ],
)
def test_files_that_break_a_rule_are_refused(tmp_path, suffix, keys, value, says):
    path = tmp_path / f"x{suffix}"
    write_exchange(plan(), path)
    spoiled(path, *keys, value=value)
    with pytest.raises(UnreadableWaveform, match=says):
        read_exchange(path)


@pytest.mark.parametrize("suffix", EXCHANGE_SUFFIXES)
@pytest.mark.parametrize("content", ["", "{", "[]", "{}", '{"Version": 1.0}', "3"])
def test_files_of_another_kind_are_refused(tmp_path, suffix, content):
    path = tmp_path / f"x{suffix}"
    path.write_text(content)
    with pytest.raises(UnreadableWaveform, match="x"):
        read_exchange(path)


def test_what_cannot_be_said_is_refused(tmp_path):
    with pytest.raises(WaveformError, match="still"):
        write_exchange(plan("paper-6x6"), tmp_path / "x.hjif")
    with pytest.raises(WaveformError, match="rows 0 to 5"):
        write_exchange(plan(), tmp_path / "x.ahap", actuator=(6, 0))
    with pytest.raises(FileError, match=r"\.hjif, \.ahap, \.haptic"):
        write_exchange(plan(), tmp_path / "x.json")
    assert [path.name for path in tmp_path.iterdir() if path.name != "cache"] == []
