"""A plant behind the emulated controller: what it is, what it senses, and what a host is told of it."""

from __future__ import annotations

import io
import math
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chainsim import Chain, Device, ProfileError, Setting, load_device, solve
from dotwave.playing.emulate import EmulateReport, emulate
from dotwave.playing.play import play
from drivers import (
    ControllerSpec,
    FeltGrid,
    HostSession,
    Kind,
    PacketReader,
    PlantError,
    PlantFile,
    Timing,
    VirtualController,
    read_plant,
    read_waveform,
    session_messages,
    write_waveform,
)
from drivers.protocol.felt import VoltForces
from drivers.protocol.measured import Measure
from drivers.protocol.plant import Sensors, TruePlant, true_factors
from drivers.protocol.playout import OutputBlock
from encoders import GridShape, TextOptions, TextSource, encode_text
from planner import Measured, Plan, plan_scene
from tests.support.playing import exchange

AS_PLANNED = PlantFile.model_validate({})
SPREAD = {"frequency": 0.002, "damping": 0.05, "lam": 0.02, "force": 0.03}


def planned(device: Device, text: str = "Hi", dwell_s: float = 0.5) -> Plan:
    scene = encode_text(TextSource.of_text(text), GridShape(6, 6), TextOptions(dwell_s=dwell_s))
    plan = plan_scene(scene, device)
    return Plan(device, list(plan.frames), plan.encoding)


class Played:
    """A written waveform played over a line in memory to a controller with a plant."""

    def __init__(self, path: Path, plant: PlantFile) -> None:
        manifest, reader = read_waveform(path)
        device = manifest.device
        felt = FeltGrid(device, manifest.rate_hz, TruePlant(plant, device, manifest.rate_hz))
        controller = VirtualController(
            ControllerSpec.of(device), now=0.0, senses=Sensors(plant, device, felt)
        )  # fmt: skip
        self.found, self.said = list[Measured](), bytearray()
        session = HostSession(
            lambda found: session_messages(manifest, reader, found, session=7),
            session=7, timing=Timing(), on_measured=self.found.append,
        )  # fmt: skip
        exchange(session, controller, watch=self.said.extend)
        assert session.report.underruns == 0


@pytest.fixture(scope="module")
def plans(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Plan, Path]]:
    """Plans that are played more than once, and their files."""
    found = {}
    for name in ("linked-6x6", "paper-6x6"):
        plan = planned(load_device(name))
        path = tmp_path_factory.mktemp(name) / "sent.wav"
        write_waveform(plan, path)
        found[name] = plan, path
    return found


@pytest.mark.parametrize("name", ["linked-6x6", "paper-6x6"])
def test_a_plant_as_planned_shows_what_was_planned(plans: dict[str, tuple[Plan, Path]], name: str) -> None:
    plan, path = plans[name]
    shown = [frame for frame in plan.frames if frame.frame is not None]
    played = Played(path, AS_PLANNED)
    assert [one.frame for one in played.found] == list(range(len(shown)))
    scale = plan.device.full_scale
    for found, frame in zip(played.found, shown, strict=True):
        phasor = np.concatenate([state.phasor for state in frame.states])
        mean = np.concatenate([state.mean for state in frame.states])
        moving = np.repeat([state.moving for state in frame.states], 6)
        assert moving.any() == (name == "linked-6x6")
        # Phases too: a harmonic counts its phase as the plan does.
        np.testing.assert_allclose(found.harmonic[moving], phasor[moving], atol=0.01 * scale)
        np.testing.assert_allclose(found.mean, mean, atol=0.01 * scale)
        # What a deflection is asked for has no harmonic; where nothing is asked for there is none.
        still = found.harmonic[~moving]
        assert np.isnan(still).all() if name == "paper-6x6" else not still.any()


def test_a_host_asks_those_who_measure_for_every_frame(plans: dict[str, tuple[Plan, Path]]) -> None:
    for name, (plan, path) in plans.items():
        manifest, reader = read_waveform(path)
        device, rate = manifest.device, manifest.rate_hz
        senses = Sensors(AS_PLANNED, device, FeltGrid(device, rate))
        found = VirtualController(ControllerSpec.of(device), now=0.0, senses=senses)._capabilities()
        sent = [one for one in session_messages(manifest, reader, found, session=7) if isinstance(one, Measure)]
        shown = [frame for frame in plan.frames if frame.frame is not None]
        assert [one.frame for one in sent] == list(range(len(shown)))
        for one, frame in zip(sent, shown, strict=True):
            assert one.at / rate == pytest.approx((frame.settled_s + frame.end_s) / 2, abs=1 / rate)
            assert (one.at + one.samples) / rate == pytest.approx(frame.end_s, abs=1 / rate)
            # The phases of the last rows are sent once where they are alike.
            turns = [*one.turns, *[one.turns[-1]] * (6 - len(one.turns))]
            assert len(one.turns) == 1 or one.turns[-1] != one.turns[-2]
            for row, state in enumerate(frame.states):
                wanted = state.omega * device.f0_hz / rate if name == "linked-6x6" else 0.0
                assert turns[row] / 2**64 == pytest.approx(wanted, abs=1e-15)
        # Not of one that does not measure, nor where a question fits into no packet.
        short = [replace(found, max_payload=23)] if name == "linked-6x6" else []
        for other in (replace(found, measures=False), *short):
            assert not any(isinstance(one, Measure) for one in session_messages(manifest, reader, other, session=7))


def test_a_plant_with_a_known_spread_is_the_chain_solved_directly(tmp_path: Path) -> None:
    device, plant = load_device("linked-6x6"), PlantFile.model_validate({"seed": 3, "spread": SPREAD})
    plan = planned(device, "l", dwell_s=7.0)
    write_waveform(plan, tmp_path / "sent.wav")
    (found,) = Played(tmp_path / "sent.wav", plant).found
    true, nominal = true_factors(plant, device), next(iter(plan.frames)).states
    for row, state in enumerate(nominal):
        chain = Chain.of(
            6, delta=device.delta * true["damping"][row], beta=device.beta * true["beta"][row],
            stiffness=true["frequency"][row] ** 2,
        )  # fmt: skip
        setting = Setting.of(
            chain, epsilon=abs(state.epsilon) * true["force"][row, 0], lam=state.lam * true["lam"][row, 1:],
            omega=state.omega, phase=np.angle(state.epsilon),
        )  # fmt: skip
        wanted = solve(chain, setting, tol=1e-6).phasor[0]
        here = found.harmonic[6 * row : 6 * row + 6]
        np.testing.assert_allclose(here, wanted, atol=0.005 * device.full_scale)
    # It is not what was planned.
    phasor = np.concatenate([state.phasor for state in nominal])
    assert np.abs(found.harmonic - phasor).max() > 0.03 * device.full_scale


def test_the_same_seed_gives_the_same_bytes(plans: dict[str, tuple[Plan, Path]]) -> None:
    _, path = plans["paper-6x6"]
    sensors = {"noise": 0.01, "cross_talk": 0.02}
    plants = [PlantFile.model_validate({"seed": seed, "spread": SPREAD, "sensors": sensors}) for seed in (1, 1, 2)]
    one, again, other = (Played(path, plant) for plant in plants)
    assert one.said == again.said
    assert one.said != other.said
    # A host sees of a plant what is measured, and nothing else.
    told, rest = (
        [packet for packet in PacketReader().feed(bytes(played.said)) if packet.kind is not Kind.MEASURED]
        for played in (one, other)
    )
    assert told == rest
    assert {packet.kind for packet in told} == {Kind.CAPABILITIES, Kind.ACK, Kind.MARKED}


def test_noise_has_the_size_that_is_said() -> None:
    device = load_device("paper-6x6")
    plant = PlantFile.model_validate({"seed": 5, "sensors": {"noise": 0.02}})
    sensors = Sensors(plant, device, FeltGrid(device, 8000))
    still = Measured(0, np.zeros(36), np.zeros(36, dtype=np.complex128))
    read = [sensors.read(still) for _ in range(500)]
    numbers = np.stack(
        [(one.mean, one.harmonic.real, one.harmonic.imag) for one in read]
    ) / (0.02 * device.full_scale)  # fmt: skip
    assert numbers.std() == pytest.approx(1, abs=0.02)
    assert abs(numbers.mean()) < 0.02
    each = numbers.reshape(500, -1)
    off = np.asarray(np.corrcoef(each.T))[np.triu_indices(each.shape[1], 1)]
    assert np.abs(off).max() < 0.25
    silent = Sensors(AS_PLANNED, device, FeltGrid(device, 8000))
    np.testing.assert_array_equal(silent.read(still).mean, still.mean)


def silence(device: Device, samples: int, bias_v: float | Sequence[float] = 0.0, played: int = 0) -> OutputBlock:
    """A block of a bias device: constant volts on all actuators, no drive."""
    volts = np.zeros((samples, 42))
    volts[:, 6:] = bias_v
    return OutputBlock(0.0, volts, np.zeros((samples, device.rows, device.cols)), played, live=True)


def test_cross_talk_is_what_the_neighbours_do() -> None:
    device = load_device("paper-6x6")

    class Held(FeltGrid):
        def take(self, block: OutputBlock) -> np.ndarray:
            z = np.zeros((1, 6, 6))
            z[0, 0, 0], z[0, 2, 3] = 1.0, 2.0
            return z

    plant = PlantFile.model_validate({"sensors": {"cross_talk": 0.1}})
    sensed = Sensors(plant, device, Held(device, 8000)).sense(silence(device, 1))[0]
    wanted = np.zeros((6, 6))
    wanted[0, 0], wanted[2, 3] = 1.0, 2.0
    wanted[0, 1] = wanted[1, 0] = 0.1
    wanted[1, 3] = wanted[3, 3] = wanted[2, 2] = wanted[2, 4] = 0.2
    np.testing.assert_allclose(sensed, wanted)


def deflection(plant: dict[str, Any], seconds: float, volts: float = 50.0) -> np.ndarray:
    """Where a bias of `volts` holds the actuators after so long; raised slowly, float64, shape (6, 6)."""
    device = load_device("paper-6x6")
    true = TruePlant(PlantFile.model_validate(plant), device.model_copy(update={"delta": 0.3}), 8000)
    z: np.ndarray = np.zeros((1, 6, 6))
    for block in range(math.ceil(seconds * 8000 / 400)):
        risen = min(1.0, (block + 1) / 20)
        z = true.move(silence(device, 400, volts * risen, played=400 * block))
    held: np.ndarray = z[-1]
    return held


def root(stiffness: float, force: float) -> float:
    """The static answer of stiffness z - z^3 = force next to rest."""
    z = 0.0
    for _ in range(200):
        z = (force + z**3) / stiffness
    return z


def test_a_fingertip_comes_and_goes_and_warmth_stays() -> None:
    force = 50 * load_device("paper-6x6").bias_per_volt
    finger = {"row": 1, "col": 2, "from_s": 1.5, "to_s": 3.0, "stiffness": 0.2, "damping": 0.1}
    for seconds, stiffness in ((1.25, 1.0), (2.75, 1.2), (4.5, 1.0)):
        z = deflection({"fingertips": [finger]}, seconds)
        assert z[1, 2] == pytest.approx(root(stiffness, force), rel=1e-4)
        assert z[1, 3] == pytest.approx(root(1.0, force), rel=1e-4)
    warm = deflection({"warming": {"stiffness": -0.1, "time_s": 2.0}}, 2.0)
    # The stiffness is still on its way, and the deflection a little behind it.
    assert warm[0, 0] == pytest.approx(root(1 - 0.1 * -math.expm1(-1.0), force), rel=5e-3)


def test_hysteresis_and_creep_are_in_the_plant() -> None:
    force = 50 * load_device("paper-6x6").bias_per_volt
    play = {"kind": "play", "radius": [0.02], "weight": [0.3], "base": 0.7}
    z = deflection({"hysteresis": play}, 1.5)
    assert z[4, 4] == pytest.approx(root(1.0, 0.7 * force + 0.3 * (force - 0.02)), rel=1e-3)
    creep = {"per_decade": 0.05, "first": 10.0, "last": 1.0e6}
    early, late = (deflection({"creep": creep}, seconds)[4, 4] for seconds in (1.25, 12.5))
    # tau = 10 is 12 ms: two decades later it has grown twice, another decade later three times.
    assert late / early == pytest.approx(root(1.0, 1.15 * force) / root(1.0, 1.1 * force), abs=0.01)
    assert late > early * 1.04


def test_true_numbers_that_are_given_are_not_drawn() -> None:
    device = load_device("paper-6x6")
    given = {"row": 5, "col": 0, "frequency": 1.02, "force": 0.9}
    plant = PlantFile.model_validate({"seed": 4, "spread": SPREAD, "actuators": [given]})
    drawn = true_factors(PlantFile.model_validate({"seed": 4, "spread": SPREAD}), device)
    true = true_factors(plant, device)
    assert (true["frequency"][5, 0], true["force"][5, 0]) == (1.02, 0.9)
    assert true["damping"][5, 0] == drawn["damping"][5, 0]
    true["frequency"][5, 0], true["force"][5, 0] = drawn["frequency"][5, 0], drawn["force"][5, 0]
    for name, numbers in drawn.items():
        np.testing.assert_array_equal(true[name], numbers)
    assert np.std(true["damping"]) == pytest.approx(0.05, rel=0.5)
    assert not (drawn["beta"] - 1).any()
    assert not (true_factors(AS_PLANNED, device)["force"] - 1).any()


def test_blocks_do_not_matter_to_a_plant() -> None:
    device = load_device("paper-6x6")
    plant = PlantFile.model_validate(
        {
            "spread": SPREAD, "warming": {"stiffness": 0.1, "time_s": 0.1},
            "fingertips": [{"row": 0, "col": 0, "from_s": 0.02, "stiffness": 0.1}],
        }
    )  # fmt: skip
    found = []
    for size in (1000, 1, 37, 256):
        true = TruePlant(plant, device, 8000)
        blocks = [silence(device, min(size, 1000 - at), 20.0, at) for at in range(0, 1000, size)]
        found.append(np.concatenate([true.move(block) for block in blocks]))
    for other in found[1:]:
        np.testing.assert_array_equal(other, found[0])


def test_the_link_that_closes_a_ring_is_set_with_its_first() -> None:
    device = load_device("paper-6x6-ring")
    block = OutputBlock(0.0, np.zeros((2, 6)), np.full((2, 6, 6), 0.01) * (np.arange(6) > 0), 0, live=True)
    np.testing.assert_array_equal(VoltForces(device, np.ones(6), 1.0).lam(block), np.full((2, 6, 6), 0.01))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sensors: {noise: 0.1, nose: 1}", r"plant\.yaml:1: sensors\.nose: "),
        ("seed: 1\nspread: {frequency: 2}", r"plant\.yaml:2: spread\.frequency: "),
        ("\nactuators:\n- {row: 0, col: 6}", r"plant\.yaml:3: actuators\.0: row 0, col 6 is outside the grid of 6 x 6"),
        ("actuators: [{row: 0, col: 0}, {row: 0, col: 0}]", r"row 0, col 0 is given twice; keep one"),
        ("fingertips:\n- {row: 9, col: 0}", r"plant\.yaml:2: fingertips\.0: row 9, col 0 is outside the grid"),
        ("fingertips: [{row: 1, col: 0, from_s: 3, to_s: 1}]", r"to_s: expected at least from_s = 3, got 1"),
        ("hysteresis: {kind: bouc_wen, gain: 1, loading: 1, unloading: 0}", "a plant has hysteresis of kind play"),
        ("creep: {per_decade: 0.1, first: 0.1, last: 10}", "first: expected at least 1"),
        ("schema: dotwave/device/1", r"plant\.yaml:1: schema: "),
    ],
)
def test_what_does_not_fit_is_one_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "plant.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises((ProfileError, PlantError), match=words) as caught:
        emulate(device="linked-6x6", plant=path, seconds=0.0)
    assert "\n" not in str(caught.value)


def test_the_sample_fits_the_device_it_names() -> None:
    path = Path(__file__).resolve().parents[2] / "samples" / "plants" / "bench.yaml"
    plant, device = read_plant(path, load_device("linked-6x6")), load_device("linked-6x6")
    still = OutputBlock(0.0, np.zeros((3, 6)), np.zeros((3, 6, 6)), 0, live=True)
    assert not TruePlant(plant, device, 24000).move(still).any()
    assert len(plant.fingertips) == 2


def test_two_fingers_may_press_one_actuator(tmp_path: Path) -> None:
    path = tmp_path / "plant.yaml"
    path.write_text("fingertips: [{row: 1, col: 0}, {row: 1, col: 0}]\nactuators: [{row: 1, col: 0}]")
    assert len(read_plant(path, load_device("paper-6x6")).fingertips) == 2


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_two_terminals_and_every_frame_is_measured(plans: dict[str, tuple[Plan, Path]], tmp_path: Path) -> None:
    plan, path = plans["paper-6x6"]
    file, link = tmp_path / "plant.yaml", tmp_path / "port"
    file.write_text("seed: 2\nspread: {force: 0.05}\nsensors: {noise: 0.005}\n")
    there, found = list[EmulateReport](), list[Measured]()

    def other() -> None:
        # Room for all of it, and patience: what a busy machine does to either side is not what this is about.
        options: dict[str, Any] = {"buffer_s": 10.0, "watchdog_s": 30.0, "once": True, "seconds": 600}
        there.append(emulate(device="paper-6x6", link=link, plant=file, out=io.StringIO(), **options))

    thread = threading.Thread(target=other)
    thread.start()
    try:
        while not link.exists() and thread.is_alive():
            time.sleep(0.01)
        report = play(path, live=True, port=str(link), patience_s=100.0, on_measured=found.append)
    finally:
        thread.join()
    assert report.ok
    assert there[0].status.recorded == 0
    frames = [frame for frame in plan.frames if frame.frame is not None]
    assert [one.frame for one in found] == list(range(len(frames)))
    assert f"{len(frames)} frames measured" in report.as_text()
    assert report.as_dict()["stream"]["measured"] == len(frames)
    true = true_factors(read_plant(file, plan.device), plan.device)["force"].ravel()
    for one, frame in zip(found, frames, strict=True):
        bias = np.concatenate([state.bias for state in frame.states])
        wanted = [root(1.0, force) for force in bias * true]
        np.testing.assert_allclose(one.mean, wanted, atol=0.03 * plan.device.full_scale)
