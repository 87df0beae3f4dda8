"""Frames are corrected while they play, from what was measured of those before, and never beyond the gate."""

from __future__ import annotations

import io
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from chainsim import Device, load_device
from dotwave.playing.adapting import Adapting, plan_of
from dotwave.playing.emulate import EmulateReport, emulate
from dotwave.playing.play import play
from drivers import (
    ControllerSpec,
    FeltGrid,
    GateLimits,
    GateRefusal,
    HostSession,
    Manifest,
    PlantFile,
    StreamReport,
    Timing,
    VirtualController,
    plan_messages,
    read_waveform,
    session_messages,
    write_waveform,
)
from drivers.protocol.messages import VERSION, Links, Mark, SamplesMessage
from drivers.protocol.outgoing import Message
from drivers.protocol.plant import Sensors, TruePlant
from drivers.protocol.playout import Event
from drivers.protocol.record import _unpacked
from drivers.sinks.controller import LEAD_S
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import Adaptation, EstimateError, Measured, Plan, plan_scene
from tests.support.playing import exchange

if TYPE_CHECKING:
    from tests.conftest import Ended

LINKED = load_device("linked-6x6").model_copy(update={"rows": 1})
PAPER = load_device("paper-6x6").model_copy(update={"rows": 1})
SPREAD = {"frequency": 0.01, "damping": 0.05, "lam": 0.02, "force": 0.03}
PAGES = ([1, 0, 1, 1, 0, 1], [0, 1, 1, 0, 1, 0], [1, 1, 0, 1, 0, 0])


@pytest.fixture(scope="module", autouse=True)
def _cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DOTWAVE_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def written(folder: Path, device: Device, count: int, dwell_s: float = 1.0) -> tuple[Path, list[Frame]]:
    """As many pages, one after another."""
    patterns = [np.array([PAGES[at % len(PAGES)]], dtype=np.complex128) for at in range(count)]
    frames = [Frame(TargetPattern(one), dwell_s) for one in patterns]
    write_waveform(plan_scene(Scene(GridShape(1, 6), frames), device), folder / "sent.wav")
    return folder / "sent.wav", frames


class Played:
    """A written waveform played on a plant, corrected or not: the deviation of every page, as measured."""

    def __init__(self, path: Path, plant: dict[str, object], *, adapt: bool) -> None:
        self.manifest, reader = read_waveform(path)
        device, rate = self.manifest.device, self.manifest.rate_hz
        true = PlantFile.model_validate(plant)
        sensors = Sensors(true, device, FeltGrid(device, rate, TruePlant(true, device, rate)))
        self.volts = 0.0
        controller = VirtualController(
            ControllerSpec.of(device), now=0.0, senses=sensors,
            on_output=lambda block: self._most(np.abs(block.volts).max()),
        )  # fmt: skip
        self.adaptation = Adaptation(device)
        frames = self.adaptation.adapted(plan_of(self.manifest)).frames
        self.found: list[Measured] = []
        limits = GateLimits.of(device, len(self.manifest.channels))

        def heard(measured: Measured) -> None:
            self.found.append(measured)
            self.adaptation.learned(measured)

        session = HostSession(
            lambda found: plan_messages(self.manifest, frames, found, session=7, prefill_s=LEAD_S / 2, limits=limits)
            if adapt
            else session_messages(self.manifest, reader, found, session=7),
            session=7, timing=Timing(lead_s=LEAD_S) if adapt else Timing(), on_measured=heard,
        )  # fmt: skip
        exchange(session, controller)
        self.report: StreamReport = session.report
        assert self.report.underruns == 0

    def _most(self, volts: float) -> None:
        self.volts = max(self.volts, float(volts))

    @property
    def errors(self) -> list[float]:
        """Largest deviation of any actuator on every page, in units of full scale."""
        scale, errors = self.manifest.device.full_scale, []
        for one in self.found:
            mark = self.manifest.frames[one.frame]
            felt = np.abs(one.harmonic) if mark.moving[0] else one.mean
            errors.append(float(np.abs(felt / scale - mark.target[0]).max()))
        return errors


def test_pages_get_right_while_they_play(tmp_path: Path) -> None:
    path, _ = written(tmp_path, LINKED, 9)
    plant: dict[str, object] = {"seed": 4, "spread": SPREAD, "sensors": {"noise": 0.002}}
    plain, led = Played(path, plant, adapt=False), Played(path, plant, adapt=True)
    # The first page is out before anything is measured; the second too.
    assert led.errors[0] == pytest.approx(plain.errors[0], abs=0.02)
    assert np.mean(plain.errors[6:]) > 0.1
    assert np.mean(led.errors[6:]) < 0.4 * np.mean(plain.errors[6:])
    assert max(led.errors[6:]) < 0.1
    report = led.adaptation.report()
    assert len(report.errors) == 9
    assert report.told > 0
    assert not report.strange
    assert led.volts <= LINKED.amplifier.volts


def test_a_finger_is_followed_and_let_go(tmp_path: Path) -> None:
    path, _ = written(tmp_path, LINKED, 12)
    touch = {"row": 0, "col": 1, "from_s": 4.1, "to_s": 8.1, "stiffness": 0.02, "damping": 0.003}
    plant: dict[str, object] = {"sensors": {"noise": 0.002}, "fingertips": [touch]}
    plain, led = Played(path, plant, adapt=False), Played(path, plant, adapt=True)
    # As planned but for the finger: nothing is spoiled before, it helps while the finger is there, and lets it go.
    assert max(led.errors[:4]) < 0.03
    assert np.mean(led.errors[6:8]) < 0.6 * np.mean(plain.errors[6:8])
    assert led.errors[11] < 0.1
    # Tracked, not fought: the drive stays about what was planned.
    assert led.volts < 1.3 * plain.volts


def test_deflections_are_led_through_loops_and_creep(tmp_path: Path) -> None:
    path, _ = written(tmp_path, PAPER, 12)
    plant: dict[str, object] = {
        "seed": 2, "spread": {"frequency": 0.01, "force": 0.03},
        "hysteresis": {"kind": "play", "radius": [0.002, 0.006, 0.014], "weight": [0.03, 0.03, 0.04], "base": 0.9},
        "creep": {"per_decade": 0.02, "first": 84, "last": 8.36e5}, "sensors": {"noise": 0.002},
    }  # fmt: skip
    plain, led = Played(path, plant, adapt=False), Played(path, plant, adapt=True)
    assert np.mean(led.errors[6:]) < 0.5 * np.mean(plain.errors[6:])
    assert max(led.errors[8:]) < 0.03
    assert led.volts <= PAPER.amplifier.volts


def messages(manifest: Manifest, plan: Plan, limits: GateLimits | None = None) -> np.ndarray:
    """The samples of a plan that is sent as it is drawn."""
    device = manifest.device
    found = VirtualController(ControllerSpec.of(device), now=0.0)._capabilities()
    limits = limits or GateLimits.of(device, len(manifest.channels))
    sent = plan_messages(manifest, plan.frames, found, session=7, prefill_s=LEAD_S / 2, limits=limits)
    return np.concatenate([one.codes for one in sent if isinstance(one, SamplesMessage)])


@pytest.mark.parametrize("device", [LINKED, PAPER], ids=["vibrating", "held"])
def test_what_is_not_measured_is_not_corrected(tmp_path: Path, device: Device) -> None:
    path, _ = written(tmp_path, device, 3)
    manifest, reader = read_waveform(path)
    found = VirtualController(ControllerSpec.of(device), now=0.0)._capabilities()
    plain = [one for one in session_messages(manifest, reader, found, session=7) if isinstance(one, SamplesMessage)]
    adaptation = Adaptation(manifest.device)
    led = messages(manifest, adaptation.adapted(plan_of(manifest)))
    np.testing.assert_allclose(led, np.concatenate([one.codes for one in plain]), atol=3)
    assert "Nothing was measured" in adaptation.report().as_lines()[0]


@pytest.mark.parametrize("device", [LINKED, PAPER], ids=["vibrating", "held"])
def test_marks_measures_and_links_are_those_of_the_file(tmp_path: Path, device: Device) -> None:
    path, _ = written(tmp_path, device, 3)
    manifest, reader = read_waveform(path)
    bare = VirtualController(ControllerSpec.of(device), now=0.0)._capabilities()
    found = replace(bare, version=VERSION, measures=True)
    sent = session_messages(manifest, reader, found, session=7)
    limits = GateLimits.of(device, len(manifest.channels))
    drawn = plan_messages(manifest, plan_of(manifest).frames, found, session=7, prefill_s=LEAD_S / 2, limits=limits)
    (plain, notes), (led, led_notes) = map(told, (sent, drawn))
    assert [without_links(event) for event in led] == [without_links(event) for event in plain]
    for mine, its in zip(led, plain, strict=True):
        if isinstance(mine, Links) and isinstance(its, Links):
            # A file has twelve digits.
            assert mine.lam == pytest.approx(its.lam, abs=1e-9)
    assert led_notes == notes
    assert len(notes) == 3
    assert all(notes)
    assert any(isinstance(event, Links) for event in plain)


def without_links(event: Event) -> Event:
    """What an event says beside the strength of links."""
    return replace(event, lam=()) if isinstance(event, Links) else event


def told(sent: Iterator[Message]) -> tuple[list[Event], list[dict[str, Any]]]:
    """The events of a session, by sample and kind, and what the notes of its marks say."""
    found = (one for one in sent if isinstance(one, Event))
    events: list[Event] = sorted(found, key=lambda event: (event.at, type(event).__name__))
    notes = [_unpacked(event.note) for event in events if isinstance(event, Mark)]
    bare: list[Event] = [replace(event, note=b"") if isinstance(event, Mark) else event for event in events]
    return bare, notes


@pytest.mark.parametrize(("version", "most_s"), [(VERSION, 0.5), (3, 2.0)])
def test_a_large_buffer_is_not_filled(
    tmp_path: Path, version: int, most_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frames that are not asked for can still be corrected; a controller of before wants half of its buffer."""
    monkeypatch.setattr("drivers.protocol.virtual_controller.VERSION", version)
    path, _ = written(tmp_path, LINKED, 6)
    manifest, _ = read_waveform(path)
    limits, rate = GateLimits.of(LINKED, len(manifest.channels)), manifest.rate_hz
    controller = VirtualController(ControllerSpec.of(LINKED, buffer_s=4.0), now=0.0)
    session = HostSession(
        lambda found: plan_messages(
            manifest, plan_of(manifest).frames, found, session=7, prefill_s=LEAD_S / 2, limits=limits
        ),
        session=7, timing=Timing(lead_s=LEAD_S),
    )  # fmt: skip
    ahead: list[float] = []
    exchange(
        session, controller, patience_s=20.0,
        watch=lambda said: ahead.append((controller.playout.received - controller.playout.played) / rate),
    )  # fmt: skip
    assert session.report.underruns == 0
    assert most_s - 0.1 < max(ahead) < most_s + 0.02


def test_no_sample_passes_the_gate_that_is_over_it(tmp_path: Path) -> None:
    path, _ = written(tmp_path, LINKED, 2)
    manifest, _ = read_waveform(path)
    low = replace(GateLimits.of(LINKED, 1), volts=5.0)
    with pytest.raises(GateRefusal, match="stopped, what was corrected is not safe: volts"):
        messages(manifest, plan_of(manifest), low)
    loose = replace(GateLimits.of(LINKED, 1), lam_max=1e-3)
    with pytest.raises(GateRefusal, match=r"stopped, what was corrected is not safe: lam of row 0"):
        messages(manifest, plan_of(manifest), loose)


def test_a_sensor_that_lies_leads_nowhere_far(tmp_path: Path) -> None:
    """Whatever is measured, drives and links stay within the device, and change in steps."""
    path, _ = written(tmp_path, LINKED, 8)
    manifest, _ = read_waveform(path)
    rng, adaptation = np.random.default_rng(0), Adaptation(manifest.device)
    plain = {frame.start_s: frame for frame in plan_of(manifest).frames}
    for number, frame in enumerate(adaptation.adapted(plan_of(manifest)).frames):
        before = plain[frame.start_s].states[0]
        state = frame.states[0]
        assert np.all((state.lam >= LINKED.coupling.lam.min) & (state.lam <= LINKED.coupling.lam.max))
        assert abs(state.epsilon) <= min(4.0 * abs(before.epsilon), LINKED.epsilon_max) * (1 + 1e-9)
        wild = LINKED.full_scale * 10 ** rng.uniform(-3, 2, 6) * np.exp(2j * np.pi * rng.random(6))
        adaptation.learned(Measured(number, np.zeros(6), wild, wild, np.abs(wild) ** 2))
    assert adaptation.report().strange


def test_a_dry_run_is_corrected_by_nothing(dotwave: Callable[..., Ended], tmp_path: Path) -> None:
    path, _ = written(tmp_path, LINKED, 1)
    ended = dotwave("play", path, "--adapt", "--port", tmp_path / "none")
    assert ended.code == 0, ended.err
    assert "gate passed" in ended.out


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_two_terminals(tmp_path: Path) -> None:
    """The whole way to an emulated controller that measures; how busy the machine is decides nothing."""
    device = load_device("linked-6x6")
    (tmp_path / "plant.yaml").write_text("seed: 4\nsensors: {noise: 0.002}\n", encoding="utf-8")
    page = np.array([PAGES[0]] * 6, dtype=np.complex128)
    plan = plan_scene(Scene(GridShape(6, 6), (Frame(TargetPattern(page), 0.5),)), device)
    path = write_waveform(plan, tmp_path / "sent.wav").samples_path
    link, out, found = tmp_path / "port", io.StringIO(), list[EmulateReport]()

    def other() -> None:
        found.append(
            emulate(
                device="linked-6x6", link=link, plant=tmp_path / "plant.yaml", record=tmp_path / "arrived.wav",
                once=True, seconds=600, buffer_s=10.0, watchdog_s=30.0, out=out,
            )
        )  # fmt: skip

    thread = threading.Thread(target=other)
    thread.start()
    try:
        while not link.exists() and thread.is_alive():
            time.sleep(0.01)
        report = play(path, live=True, port=str(link), adapt=Adapting(), patience_s=100.0)
    finally:
        thread.join()
    assert found[0].status.recorded == 1
    assert report.as_dict()["stream"]["samples"] == round(report.duration_s * report.rate_hz)
    assert report.as_dict()["adaptation"]["actuators"] == 36
    arrived, _ = read_waveform(tmp_path / "arrived.wav")
    assert len(arrived.frames) == 1


def test_what_cannot_be_corrected_is_refused(dotwave: Callable[..., Ended], tmp_path: Path) -> None:
    path, _ = written(tmp_path, LINKED, 1)
    ended = dotwave("play", path, "--adapt")
    assert ended.code == 2
    assert "--adapt: only a controller measures what it plays; give its --port" in ended.err
    ended = dotwave("play", path, "--adapt", "--parametric", "--port", "/dev/null")
    assert ended.code == 2
    assert "--adapt and --parametric: what is corrected goes out as samples" in ended.err
    with pytest.raises(EstimateError, match="its chains are ring"):
        Adaptation(load_device("paper-6x6-ring"))
