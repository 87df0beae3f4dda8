"""`verify --as-built`: the same felt levels as `verify`, judged over devices drawn at random."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import dotwave as dw
from chainsim import Actuator, ActuatorSpread, Device, Surroundings, load_device, surroundings_of
from chainsim.drawn.devices import DrawnNumbers
from dotwave.as_built.batch import Batch, verdict_on
from dotwave.as_built.effects import EFFECTS, alone, present
from dotwave.as_built.motion import FeltLevels, felt_levels, most_at_once
from dotwave.as_built.report import AsBuiltReport
from dotwave.as_built.settings import AsBuiltSettings
from dotwave.as_built.study import AsBuiltStudy, verify_as_built
from dotwave.as_built.verdict import joined, verdict_of
from dotwave.errors import AppError
from dotwave.studies.sweep import run_sweep
from dotwave.verification import verify
from drivers import read_waveform
from planner import standing_error

# Units of full scale: many devices move in coarser steps than the one of `verify`.
FELT = 5e-5
SPREAD = Surroundings(spread=ActuatorSpread(frequency=0.002, damping=0.02, beta=0.1, lam=0.005))


def written(folder: Path, device: Device, text: str = "Hi") -> Path:
    path = folder / "wave.npz"
    dw.plan(dw.text(text, device), device).waveform().write(path)
    return path


def small() -> Device:
    """Three chains with links, and a third of the samples: what is counted here needs no more."""
    profile = load_device("linked-6x6").as_dict()
    amplifier = profile["amplifier"] | {"rate_hz": 8000}
    return Device.model_validate(profile | {"rows": 3, "amplifier": amplifier})


@pytest.fixture(scope="module")
def linked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("linked"), small())


def levels(path: Path, around: Surroundings, *, count: int = 1, first: int = 0) -> FeltLevels:
    manifest, reader = read_waveform(path)
    return felt_levels(manifest, reader, around, first=first, count=count, seed=0, told=lambda _: None)


@pytest.mark.parametrize("name", ["linked-6x6", "paper-6x6", "independent-6x6"])
def test_with_nothing_around_it_a_device_feels_as_verify_says(name: str, tmp_path: Path) -> None:
    path = written(tmp_path, load_device(name), "Hello world" if name == "paper-6x6" else "Hi")
    found = levels(path, Surroundings()).level[0]
    checks = verify(path).frames
    assert len(found) == len(checks)
    for level, check in zip(found, checks, strict=True):
        assert np.abs(level - check.felt).max() < FELT


def test_bars_of_two_tones_too(tmp_path: Path) -> None:
    device, path = load_device("independent-6x6"), tmp_path / "bars.npz"
    bars = {"width": 2.0, "rate_hz": 1.5, "level": 0.4}
    dw.plan(dw.texture({"walking_bars": bars}, device, dwell_s=3.0), device).waveform().write(path)
    found, (check,) = levels(path, Surroundings()).level[0], verify(path).frames
    assert np.abs(found[0] - check.felt).max() < FELT


def test_a_drawn_device_feels_as_verify_says_of_its_actuators(linked: Path, tmp_path: Path) -> None:
    """The same waveform for a device whose actuators were measured to be what was drawn; no code is shared."""
    manifest, _ = read_waveform(linked)
    device = manifest.device
    drawn = DrawnNumbers(device, SPREAD, range(3), 0)
    found = levels(linked, SPREAD, count=3)
    for number in (0, 2):
        actuators = [
            Actuator(
                row=row, col=col, f0_hz=device.f0_hz * math.sqrt(drawn.stiffness[number, row, col]),
                delta=drawn.delta[number, row, col], beta=drawn.beta[number, row, col],
                lam=drawn.lam_gain[number, row, col] if col else None, lam_set=1.0 if col else None,
            ).model_dump(exclude_none=True)
            for row in range(device.rows) for col in range(device.cols)
        ]  # fmt: skip
        copy = tmp_path / "wave.npz"
        copy.write_bytes(linked.read_bytes())
        told = json.loads(linked.with_suffix(".json").read_text("utf-8"))
        told["device"] = Device.model_validate(told["device"] | {"actuators": actuators}).as_dict()
        copy.with_suffix(".json").write_text(json.dumps(told), "utf-8")
        for level, check in zip(found.level[number], verify(copy).frames, strict=True):
            assert np.abs(level - check.felt).max() < FELT
            assert check.amplitude_error > 0.01


@pytest.mark.parametrize("name", ["paper-6x6", "paper-6x6-common"])
def test_the_error_that_is_told_holds_what_the_piezos_do(name: str, tmp_path: Path, dotwave: Any) -> None:
    """Modes, creep and hysteresis, each alone and all of them together; most of what is told is there."""
    plan = dw.plan(dw.text("Hi", name), name)
    told = max(frame.error + standing_error(plan.device, frame.states, frame.end_s) for frame in plan)
    assert max(frame.error for frame in plan) < 1e-3
    path = tmp_path / "wave.npz"
    plan.waveform().write(path)
    around = surroundings_of(load_device(name))
    each = [alone(around, effect) for effect in ("higher modes", "creep", "hysteresis")]
    both = around.model_copy(update={"hysteresis": 0.0, "spread": ActuatorSpread(), "bandwidth_hz": None})
    manifest, _ = read_waveform(path)
    found = [
        float(verdict_of(manifest.frames, levels(path, one)).error.max())
        for one in (*each, both, around.model_copy(update={"spread": ActuatorSpread()}))
    ]
    assert max(found) <= told
    assert sum(found[:3]) > 0.5 * told
    bare = load_device(name).model_copy(update={"surroundings": Surroundings()})
    assert all(standing_error(bare, frame.states, frame.end_s) == 0 for frame in plan)
    assert f"off by up to {100 * told:.2g} % of full scale" in dotwave("text", "Hi", "-d", name, "--explain").out


def test_batches_are_the_whole(linked: Path) -> None:
    whole = verdict_on(linked, Batch(None, 0, 40, 5), lambda _: None)
    parts = [verdict_on(linked, Batch(None, first, count, 5), lambda _: None) for first, count in ((0, 32), (32, 8))]
    again = joined(parts)
    for name, value in vars(whole).items():
        assert np.array_equal(value, getattr(again, name), equal_nan=value.dtype.kind == "f"), name


def test_memory_does_not_grow_with_the_length_of_a_waveform(linked: Path) -> None:
    manifest, _ = read_waveform(linked)
    one = most_at_once(manifest)
    many = most_at_once(replace(manifest, frames=manifest.frames * 500))
    assert 32 <= many < one <= 1024
    assert many % 32 == one % 32 == 0


def test_every_value_of_the_surroundings_is_an_effect() -> None:
    known = {name for names in EFFECTS.values() for name in names}
    assert known == set(Surroundings.model_fields)
    around = surroundings_of(load_device("linked-6x6"))
    assert present(around) == ("spread", "hysteresis", "creep", "higher modes", "amplifier dynamics")
    assert alone(around, "hysteresis") == Surroundings(hysteresis=0.1, saturation=around.saturation)
    assert present(alone(around, "creep")) == ("creep",)
    assert present(Surroundings()) == ()


def judged(linked: Path, change: Callable[[np.ndarray], None]) -> tuple[Any, np.ndarray]:
    """A verdict on four devices that feel what is aimed at, the second but for `change`."""
    manifest, _ = read_waveform(linked)
    target = np.stack([mark.target for mark in manifest.frames])
    level = np.repeat(target[None], 4, axis=0)
    change(level[1])
    escaped = np.array([False, False, True, False])
    return verdict_of(manifest.frames, FeltLevels(level, escaped)), target


def test_a_verdict_counts_devices(linked: Path) -> None:
    def nothing(level: np.ndarray) -> None:
        pass

    verdict, target = judged(linked, nothing)
    assert verdict.ok.all()
    assert not verdict.wrong.any()
    assert verdict.contrast_db == pytest.approx(20.0, abs=0.1)
    raised = tuple(np.argwhere(target[0] >= 0.5)[0])
    flat = tuple(np.argwhere(target[0] < 0.5)[0])

    def falls(level: np.ndarray) -> None:
        level[0][raised] = 0.4

    verdict, _ = judged(linked, falls)
    assert verdict.ok.tolist() == [True, False, True, True]
    assert verdict.wrong[raised] == verdict.wrong.sum() == 1
    assert verdict.wrong_dots.tolist() == [0, 1, 0, 0]
    assert verdict.error[1] == pytest.approx(target[0][raised] - 0.4)

    def dim(level: np.ndarray) -> None:
        level[0][flat] = 0.3

    verdict, _ = judged(linked, dim)
    assert verdict.ok.tolist() == [True, False, True, True]
    assert not verdict.wrong.any()
    assert verdict.contrast_db[1] == pytest.approx(20 * math.log10(target[0].max() / 0.3), abs=0.2)

    def lost(level: np.ndarray) -> None:
        level[0][flat] = np.nan

    verdict, _ = judged(linked, lost)
    assert verdict.ok.tolist() == [True, False, True, True]
    assert verdict.wrong[flat] == 1
    assert verdict.escaped.tolist() == [False, False, True, False]
    assert np.isnan(verdict.contrast_db[1])

    def silent(level: np.ndarray) -> None:
        level[0][target[0] < 0.5] = 0.0

    verdict, _ = judged(linked, silent)
    assert verdict.ok.all()
    assert verdict.contrast_db[1] == math.inf


def test_contrasts_over_silence_are_told_and_no_contrast_is_none(tmp_path: Path) -> None:
    device = Device.model_validate(load_device("independent-6x6").as_dict() | {"rows": 3})
    said = verify_as_built(written(tmp_path, device), AsBuiltStudy(devices=2))
    assert "Contrast: over 100 dB on half of the devices; over 100 dB to over 100 dB" in said.as_text()
    assert said.as_dict()["contrast_db"] == [None] * 3
    assert said.ok
    assert said.worst_dot is None
    path = tmp_path / "flat.npz"
    dw.plan(dw.texture({"levels": [[0.5] * 6] * 3}, device), device).waveform().write(path)
    assert "Contrast: not defined on half" in verify_as_built(path, AsBuiltStudy(devices=2)).as_text()


def test_the_report_says_which_effect_spoils_what(linked: Path) -> None:
    report = verify_as_built(linked, AsBuiltStudy(devices=6))
    assert isinstance(report, AsBuiltReport)
    said = report.as_dict()
    assert json.loads(json.dumps(said, allow_nan=False)) == said
    effects = {one["effect"]: one for one in said["effects"]}
    assert list(effects) == ["none", *present(surroundings_of(load_device("linked-6x6")))]
    assert [effects[name]["devices"] for name in effects] == [1, 6, 1, 1, 1, 1]
    assert effects["none"]["yield"] == 1.0
    assert not effects["none"]["assumed"]
    assert all(one["assumed"] for name, one in effects.items() if name != "none")
    # The tips' own bending is a fifth of what they do, the loop a tenth of every force.
    assert {"higher modes", "hysteresis"} <= set(said["spoilers"])
    assert said["yield"] == 0.0
    assert not said["ok"]
    worst = said["worst_dot"]
    assert worst["wrong_on"] == said["wrong"][worst["row"]][worst["col"]] == max(map(max, said["wrong"]))
    assert sum(said["histogram"]["devices"]) == 6
    text = report.as_text()
    assert "Yield: 0 %; on 0 of 6 every dot is right and clear." in text
    assert "- higher modes, assumed: wrong on all alike" in text
    assert "Assumed, not measured: hysteresis" in text
    again = verify_as_built(linked, AsBuiltStudy(devices=6)).as_dict()
    assert {**again, "seconds": 0} == {**said, "seconds": 0}


def calibrated(folder: Path) -> Path:
    """A device that is known to 0.01 %, and what surrounds it measured to be little."""
    profile = small().as_dict()
    profile["surroundings"] = {"spread": {"frequency": 1e-4}, "bandwidth_hz": 12000.0, "hysteresis": 1e-4}
    profile["notes"] = {"surroundings": {"assumed": False, "why": "measured"}}
    path = folder / "mine.yaml"
    path.write_text(yaml.safe_dump(profile), "utf-8")
    return path


def test_the_command_line(dotwave: Callable[..., Any], tmp_path: Path, linked: Path) -> None:
    wave, profile = tmp_path / "hi.wav", calibrated(tmp_path)
    assert dotwave("text", "Hi", "--device", profile, "-o", wave).code == 0
    ended = dotwave("verify", wave, "--as-built", "--devices", 5, "--json")
    said = json.loads(ended.out)
    assert (ended.code, said["ok"], said["devices"], said["yield"], said["assumed"]) == (0, True, 5, 1.0, [])
    assert said["worst_dot"] is None
    assert said["spoilers"] == []
    spoiled = dotwave("verify", linked, "--as-built", "--devices", 3)
    assert spoiled.code == 1
    assert spoiled.out.startswith("As built: ")
    for option in ("--devices", "--seed", "--scheduler"):
        ended = dotwave("verify", wave, option, "7")
        assert (ended.code, ended.out) == (2, "")
        assert ended.err.strip().endswith(f"{option} belongs to --as-built; give that too, or leave it out")


def test_numbers_that_cannot_be_are_refused(linked: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dotwave.cluster.CONNECT_S", 1.0)
    with pytest.raises(AppError, match="devices: expected 1 or more, got 0"):
        dw.verify(linked, devices=0)
    with pytest.raises(AppError, match="seed: expected 0 or more, got -1"):
        dw.verify(linked, devices=1, seed=-1)
    with pytest.raises(AppError, match="no dask scheduler answers"):
        dw.verify(linked, devices=1, scheduler="tcp://127.0.0.1:1")


@pytest.mark.slow
def test_a_thousand_devices_of_hello(tmp_path: Path) -> None:
    """Counts of the whole study: every device once, every sample of it once, no more memory than a batch takes."""
    path = written(tmp_path, load_device("linked-6x6"), "Hello")
    manifest, _ = read_waveform(path)
    taken: list[int] = []
    whole = verdict_on(path, Batch("spread", 0, 1000, 0), taken.append)
    assert sum(taken) == 1000 * manifest.samples
    assert len(whole.ok) == 1000
    assert not whole.escaped.any()
    # 1 % spoils a good part of the default plan, and not all of it.
    assert 0.4 < whole.ok.mean() < 0.9


@pytest.fixture
def cluster() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed")
    with (
        warnings.catch_warnings(),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as running,
    ):
        yield running


@pytest.mark.slow
@pytest.mark.filterwarnings("default:::distributed")
@pytest.mark.filterwarnings("default::ResourceWarning")
@pytest.mark.filterwarnings("default::pytest.PytestUnraisableExceptionWarning")
def test_a_cluster_says_the_same(cluster: Any, linked: Path) -> None:
    here = dw.verify(linked, devices=40, seed=2).as_dict()
    there = dw.verify(linked, devices=40, seed=2, scheduler=cluster.scheduler_address).as_dict()
    assert {**here, "seconds": 0} == {**there, "seconds": 0}


@pytest.mark.slow
@pytest.mark.filterwarnings("default:::distributed")
@pytest.mark.filterwarnings("default::ResourceWarning")
@pytest.mark.filterwarnings("default::pytest.PytestUnraisableExceptionWarning")
def test_a_cluster_sweeps_the_same(cluster: Any, tmp_path: Path) -> None:
    source = tmp_path / "sweep.yaml"
    source.write_text(
        "chain: {n: 2, delta: 0.05, beta: -1.0}\n"
        "setting: {epsilon: 0.004, lam: 0.02, omega: {from: 0.95, to: 1.0, steps: 3}}\ntol: 1.0e-6\n"
    )
    drawn = AsBuiltSettings(small(), 20)
    run_sweep(source, tmp_path / "here.npz", as_built=drawn, units=1)
    run_sweep(source, tmp_path / "there.npz", as_built=drawn, units=1, scheduler=cluster.scheduler_address)
    assert (tmp_path / "here.npz").read_bytes() == (tmp_path / "there.npz").read_bytes()
    run_sweep(source, tmp_path / "plain.npz", scheduler=cluster.scheduler_address)
