"""From text to what is felt, through the written file: the project's main promise."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from scipy.io import wavfile

from chainsim import load_device
from dotwave.api.scenes import device as device_of, text as text_scene
from dotwave.rendering.render import render
from dotwave.verification import verify
from drivers import UnreadableWaveform, write_waveform
from encoders import Frame, GridShape, Scene, TargetPattern, TextOptions
from planner import plan_scene
from tests.support.everyday import one_in
from tests.support.known import known

ROOT = Path(__file__).parents[3]
LANGUAGES = yaml.safe_load((ROOT / "samples/texts/languages.yaml").read_text("utf-8"))


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path / "cache"))


def rendered(tmp_path, text, device, **options):
    out = tmp_path / "x.wav"
    profile = device_of(device)
    source = Path(text) if text.endswith(".txt") else text
    report = render(text_scene(source, profile, TextOptions(**options)), profile, out)
    return report, out


@pytest.mark.parametrize("device", ["paper-6x6", "linked-6x6", "independent-6x6"])
def test_hello_world_is_felt(tmp_path, device):
    report, out = rendered(tmp_path, "Hello world", device)
    assert report.ok
    found = verify(out)
    assert found.ok
    assert found.wrong_dots == 0
    assert known(found.contrast_db) >= 12
    assert found.amplitude_error <= 0.02
    assert found.ramp_s <= 0.35
    assert found.felt_text == "Hello world"
    assert found.text_equal


@pytest.mark.parametrize("name", one_in(3, LANGUAGES))
def test_ten_languages_are_felt_on_the_papers_grid(tmp_path, name):
    report, out = rendered(tmp_path, str(ROOT / "samples/texts" / name), "paper-6x6", table=LANGUAGES[name]["table"])
    assert not report.undefined
    found = verify(out)
    assert found.ok
    assert found.cells_equal
    assert found.amplitude_error < 1e-5


@pytest.mark.parametrize("name", one_in(3, ["ar.txt", "en.txt", "zh.txt"]))
def test_languages_are_felt_with_linked_actuators(tmp_path, name):
    _, out = rendered(tmp_path, str(ROOT / "samples/texts" / name), "linked-6x6", table=LANGUAGES[name]["table"])
    found = verify(out)
    assert found.ok
    assert found.cells_equal
    assert known(found.contrast_db) >= 19


@pytest.mark.parametrize("presentation", ["together", "by-row", "by-dot"])
def test_pages_shown_in_parts_say_the_same(tmp_path, presentation):
    from encoders import Presentation

    _, out = rendered(tmp_path, "Hi there", "linked-6x6", presentation=Presentation(presentation))
    found = verify(out)
    assert found.ok
    assert found.felt_text == "Hi there"
    assert (len(found.frames) > len({frame.page for frame in found.frames})) == (presentation != "together")


def test_paragraphs_and_blank_pages(tmp_path):
    _, out = rendered(tmp_path, "HELLO\n\nTHE WORLD AGAIN", "linked-6x6", blank_between=True)
    found = verify(out)
    assert found.ok
    assert found.text_equal


def hard_scene(count: int) -> Scene:
    """Rows all raised, the most delicate there are, among random ones, in short frames."""
    rng = np.random.default_rng(3)
    frames = []
    for k in range(count):
        dots = rng.random((6, 6)) < rng.choice([0.2, 0.5, 0.8])
        if k % 3 == 1:
            dots[:3] = True
        frames.append(Frame(TargetPattern(dots.astype(np.complex128)), 0.7, page=k))
    return Scene(GridShape(6, 6), frames)


def test_the_most_delicate_rows_are_felt(tmp_path):
    out = tmp_path / "x.wav"
    write_waveform(plan_scene(hard_scene(16), load_device("linked-6x6")), out)
    found = verify(out)
    assert found.wrong_dots == 0
    assert known(found.contrast_db) >= 18
    assert found.amplitude_error <= 0.02


def test_a_large_display(tmp_path):
    _, out = rendered(tmp_path, "The quick brown fox jumps over the lazy dog.", "linked-40x96", dwell_s=0.6)
    found = verify(out)
    assert found.ok
    assert found.text_equal


def test_an_independent_integrator_feels_the_same(tmp_path):
    """Only scipy, the two files and the equations: DOP853 under straight lines between the samples."""
    _, out = rendered(tmp_path, "He", "linked-6x6", dwell_s=0.6)
    manifest = json.loads(out.with_suffix(".json").read_text("utf-8"))
    rate, samples = wavfile.read(out)
    device, (frame,) = manifest["device"], manifest["frames"]
    row = 1
    channel = next(c for c in manifest["channels"] if c["row"] == row)
    force = samples[:, channel["index"]].astype(float) * channel["volts_per_unit"] * device["epsilon_per_volt"]
    events = [e for e in manifest["coupling"] if e["row"] == row and e["t_s"] < frame["end_s"]]
    assert len(events) == 1, "a rise holds its links"
    lam = np.array(events[-1]["lam"])
    tau_per_s, n = 2 * np.pi * device["f0_hz"], device["cols"]

    def motion(tau, state):
        z, v = state[:n], state[n:]
        change = np.concatenate([v, -device["delta"] * v - z - device["beta"] * z * z * z])
        place, part = divmod(tau / tau_per_s * rate, 1)
        change[n] += (1 - part) * force[int(place)] + part * force[int(place) + 1]
        change[n + 1 :] += lam * (z[:-1] - z[1:])
        return change

    at = np.arange(round(frame["settled_s"] * rate), round(frame["end_s"] * rate)) / rate * tau_per_s
    answer = solve_ivp(motion, (0, at[-1]), np.zeros(2 * n), "DOP853", at, rtol=1e-8, atol=1e-11, max_step=0.1)
    phase = frame["omega"][row] * at
    basis = np.stack([np.ones_like(at), np.cos(phase), np.sin(phase)], axis=1)
    fit = np.linalg.lstsq(basis, answer.y[:n].T)[0]
    felt = np.hypot(fit[1], fit[2]) / device["full_scale"]
    assert max(frame["target"][row]) == 1
    np.testing.assert_allclose(felt, frame["target"][row], atol=0.004)
    np.testing.assert_allclose(felt, verify(out).frames[0].felt[row], atol=1e-5)


def test_what_cannot_be_made_is_said_and_not_written(tmp_path):
    report, out = rendered(tmp_path, "Hello", "paper-6x6-ring")
    assert not report.ok
    assert report.outcomes == {"unreachable": 1}
    assert not out.exists()
    assert list(tmp_path.glob("x.*")) == []
    assert "lacks a bias per actuator or a lam per link" in report.as_text()
    assert "nearest pattern" in report.as_text()


def test_a_waveform_turned_down_fails(tmp_path):
    """The file decides, not the plan: scale the samples and the verdict changes."""
    _, out = rendered(tmp_path, "Hello", "linked-6x6")
    manifest = json.loads(out.with_suffix(".json").read_text("utf-8"))
    for channel in manifest["channels"]:
        channel["volts_per_unit"] *= 0.9
    out.with_suffix(".json").write_text(json.dumps(manifest), "utf-8")
    found = verify(out)
    assert not found.ok
    # Gains per stage hardly change, so every level falls by about a tenth.
    assert 0.08 < found.amplitude_error < 0.12


def test_swapped_channels_give_wrong_dots(tmp_path):
    _, out = rendered(tmp_path, "Hello", "paper-6x6")
    manifest = json.loads(out.with_suffix(".json").read_text("utf-8"))
    bias = [channel for channel in manifest["channels"] if channel["role"] == "bias"]
    for one, other in zip(bias[0:6], bias[6:12], strict=True):
        one["row"], other["row"] = other["row"], one["row"]
    out.with_suffix(".json").write_text(json.dumps(manifest), "utf-8")
    found = verify(out)
    assert found.wrong_dots > 0
    assert found.text_equal is False
    assert not found.ok


def test_other_samples_than_the_manifests_are_refused(tmp_path):
    _, out = rendered(tmp_path, "Hello", "paper-6x6")
    raw = bytearray(out.read_bytes())
    raw[-1] ^= 1
    out.write_bytes(raw)
    with pytest.raises(UnreadableWaveform, match=r"x\.wav"):
        verify(out)


def test_same_input_same_bytes(tmp_path):
    texts = []
    for name in ("a", "b"):
        folder = tmp_path / name
        folder.mkdir()
        _, out = rendered(folder, "Same", "linked-6x6")
        texts.append((out.read_bytes(), out.with_suffix(".json").read_bytes()))
    assert texts[0] == texts[1]
