"""A device is tuned while it shows pages: from the profile to a file that is right, and every way to fail."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import yaml

from chainsim import Device, load_device
from dotwave.errors import AppError
from dotwave.playing.measuring import MeasuringPort
from dotwave.studies.tune import TuneReport, tune
from dotwave.studies.tune_bias import tune_bias
from drivers import ControllerSpec, Emulator, read_plant
from drivers.protocol.plant import true_factors
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import EstimateError, Measured, Plan, plan_scene
from tests.support.hidden_device import HiddenDevice, HiddenGrid, drawn
from tests.support.hidden_piezo import HiddenPiezo
from tests.support.playing import serving

if TYPE_CHECKING:
    from tests.conftest import Ended

LINKED, PAPER = load_device("linked-6x6"), load_device("paper-6x6")
TWO = LINKED.model_copy(update={"rows": 2})


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path / "cache"))


def profile(tmp_path: Path, device: Device) -> str:
    path = tmp_path / "base.yaml"
    path.write_text(yaml.safe_dump(device.as_dict()), encoding="utf-8")
    return str(path)


def balanced(hidden: HiddenDevice) -> Callable[[Plan], list[Measured]]:
    """A line to a device whose pages have settled."""
    return lambda plan: [hidden.measured(next(iter(plan.frames)).states)]


def line_to(device: Device, *, f0: float = 0.01) -> Callable[[Plan], list[Measured]]:
    return balanced(HiddenDevice(drawn(device, 5, f0=f0), 0.01, np.random.default_rng(6)))


def test_a_device_is_tuned_through_the_full_equations(tmp_path: Path) -> None:
    one = LINKED.model_copy(update={"rows": 1})
    grid = HiddenGrid(drawn(one, 5, f0=0.01), 0.01, np.random.default_rng(6))
    out = tmp_path / "mine.yaml"
    report = tune(profile(tmp_path, one), grid, out, goal=0.02, noise=0.0)
    assert report.ok
    assert report.pages[0].error > 0.1
    assert report.pages[-1].error < 0.0125
    assert len(report.pages) <= 4
    # Another page, planned with the file that was written.
    device = load_device(str(out))
    frame = Frame(TargetPattern(np.array([[1, 1, 0, 1, 0, 1]], dtype=np.complex128)), 4.5)
    plan = plan_scene(Scene(GridShape(1, 6), (frame,)), device)
    (seen,) = replace(grid, noise=0.0)(plan)
    states = next(iter(plan.frames)).states
    assert np.abs(np.abs(seen.harmonic) / device.full_scale - states[0].target).max() < 0.04


@pytest.mark.parametrize("phases", [True, False], ids=["phasors", "amplitudes"])
def test_the_file_written_knows_every_actuator(tmp_path: Path, phases: bool) -> None:
    out = tmp_path / "my-device.yaml"
    report = tune(profile(tmp_path, TWO), line_to(TWO), out, goal=0.02, noise=0.0, phases=phases)
    assert report.ok
    assert report.path == str(out)
    assert report.expected[0] > 0.3
    assert report.expected[1] < 0.03
    device = load_device(str(out))
    assert device.name == "my-device"
    assert device.model_dump(exclude={"name", "actuators"}) == TWO.model_dump(exclude={"name", "actuators"})
    assert [(one.row, one.col) for one in device.actuators] == list(np.ndindex(2, 6))
    first, second = device.actuators[:2]
    assert first.epsilon_per_volt is not None
    assert first.plus_minus.f0_hz is not None
    assert second.lam is not None
    assert second.lam_set == 1.0


def test_what_is_known_is_where_the_next_tuning_begins(tmp_path: Path) -> None:
    out, line = tmp_path / "mine.yaml", line_to(TWO)
    blind = tune(profile(tmp_path, TWO), line, out, goal=0.02, noise=0.0)
    again = tune(str(out), line, tmp_path / "again.yaml", goal=0.02, noise=0.0)
    assert again.pages[0].error < 0.03 < blind.pages[0].error


def test_the_report_says_what_happened_and_what_is_not_known(tmp_path: Path) -> None:
    report = tune(profile(tmp_path, TWO), line_to(TWO), None, goal=0.02, noise=0.0)
    text = report.as_text()
    assert text.splitlines()[0].endswith("expected before: 38.8%")
    assert f"  page {len(report.pages)}: " in text
    assert "  beta: told for 0 of 12 actuators; these pages do not tell it, and it stays as it was known" in text
    assert text.endswith("Not written.")
    plain = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    assert plain["outcome"] == "ok"
    assert plain["told"]["beta"] == 0
    assert len(plain["pages"]) == len(report.pages)


@contextmanager
def emulated(device: Device, plant: Path, link: Path) -> Iterator[None]:
    """A controller on actuators that are as `plant` says, until the block ends."""
    spec = ControllerSpec.of(device, buffer_s=10.0, watchdog_s=30.0)
    with serving(Emulator(device, spec, link=link, plant=read_plant(plant, device))):
        yield


@pytest.mark.slow
def test_a_device_is_tuned_over_a_port(tmp_path: Path) -> None:
    """Through protocol, sensors and full equations; more damping than usual, so that pages need not stand for long."""
    device = TWO.model_copy(update={"delta": 0.02})
    plant, link = tmp_path / "plant.yaml", tmp_path / "port"
    plant.write_text(
        "schema: dotwave/plant/1\nseed: 3\nspread: {frequency: 0.01, damping: 0.05, lam: 0.02, force: 0.03}\n"
        "sensors: {noise: 0.002}\n",
        encoding="utf-8",
    )
    out = tmp_path / "mine.yaml"
    with emulated(device, plant, link):
        report = tune(profile(tmp_path, device), MeasuringPort(str(link)), out, goal=0.03, noise=0.002)
    assert report.ok, report.as_text()
    assert report.pages[-1].error < 0.02 < 0.1 < report.pages[0].error
    true = true_factors(read_plant(plant, device), device)
    found = load_device(str(out))
    wanted = (true["frequency"].ravel() ** 2, [*found.chain_at(0).stiffness, *found.chain_at(1).stiffness])
    assert np.corrcoef(*wanted)[0, 1] > 0.8


def spoiled(line: Callable[[Plan], Sequence[Measured]], *factors: complex) -> Callable[[Plan], list[Measured]]:
    """Some actuators of the first chain are measured wrongly."""

    def measured(plan: Plan) -> list[Measured]:
        return [
            replace(one, harmonic=one.harmonic * np.append(factors, np.ones(12 - len(factors)))) for one in line(plan)
        ]

    return measured


def test_an_actuator_of_another_kind_is_named_and_nothing_written(tmp_path: Path) -> None:
    out = tmp_path / "mine.yaml"
    report = tune(profile(tmp_path, TWO), spoiled(line_to(TWO), 1, 1, 0.02), out, goal=0.02, noise=0.0)
    assert not report.ok
    assert (0, 2) in report.strange
    assert "Row 0, column 2: no actuator of this profile moves so" in report.as_text()
    assert report.as_dict()["outcome"] == "no_convergence"
    assert not out.exists()


def test_actuators_that_are_not_measured_are_left_as_they_are(tmp_path: Path) -> None:
    out = tmp_path / "mine.yaml"
    tune(profile(tmp_path, TWO), spoiled(line_to(TWO), *[complex(np.nan)] * 6), out, goal=0.02, noise=0.0)
    device = load_device(str(out))
    assert np.all(device.chain_at(0).stiffness == 1.0)
    assert np.all(device.chain_at(1).stiffness != 1.0)


def test_a_device_that_never_gets_right_is_said_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dotwave.studies.tune.TUNED", 1e-4)
    out = tmp_path / "mine.yaml"
    report = tune(profile(tmp_path, TWO), line_to(TWO), out, goal=0.02, noise=0.0)
    assert not report.ok
    assert not report.strange
    assert not out.exists()
    assert "The last page is not felt as wanted" in report.as_text()


def test_what_cannot_be_tuned_is_refused(tmp_path: Path) -> None:
    base = profile(tmp_path, TWO)
    with pytest.raises(AppError, match=r"nothing was measured; its controller must sense its actuators"):
        tune(base, lambda plan: [], None, goal=0.02, noise=0.0)
    with pytest.raises(AppError, match=r"mine\.txt: a device profile ends in \.yaml; name it so"):
        tune(base, lambda plan: [], tmp_path / "mine.txt", goal=0.02, noise=0.0)
    with pytest.raises(
        AppError, match=r"paper-6x6: its pages are held by a bias, .* leave out --output to look at them"
    ):
        tune("paper-6x6", lambda plan: [], None, goal=0.02, noise=0.0)
    with pytest.raises(AppError, match="paper-6x6: nothing was measured; its controller must sense its actuators"):
        tune_bias(PAPER, lambda plan: [], noise=0.01)
    with pytest.raises(EstimateError, match="linked-6x6 has 12 actuators, 3 were measured; give its own profile"):
        tune(base, lambda plan: [Measured(0, np.zeros(3), np.ones(3, dtype=np.complex128))], None, goal=0.02, noise=0.0)


def held(hidden: HiddenPiezo) -> Callable[[Plan], list[Measured]]:
    """A line to actuators that a bias holds; the way out is no page."""

    def measured(plan: Plan) -> list[Measured]:
        felt = [(number, frame, hidden.shows(frame)) for number, frame in enumerate(plan.frames)]
        return [hidden.measured(seen, number) for number, frame, seen in felt if frame.frame is not None]

    return measured


def test_a_biased_device_is_looked_at_and_made_good() -> None:
    hidden = HiddenPiezo(PAPER, 2)
    report = tune_bias(PAPER, held(hidden), noise=0.01)
    assert report.ok
    # Both as measured, with 1 % of noise: what is left is hardly more.
    assert np.mean(report.blind) > 0.03
    assert np.mean(report.corrected) < 0.0135
    assert report.gain == pytest.approx(np.median(hidden.gain / hidden.stiffness) * 0.96, abs=0.02)
    assert report.creep == pytest.approx(0.02, abs=0.01)
    assert "shown again with what was learned: 1." in report.as_text()
    assert not tune_bias(PAPER, held(HiddenPiezo(PAPER, 3, noise=0.1)), noise=0.01).ok


def test_the_command_writes_and_prints(
    dotwave: Callable[..., Ended], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[str, int | None]] = []
    line = line_to(TWO)

    def port(name: str, baud: int | None) -> Callable[[Plan], list[Measured]]:
        asked.append((name, baud))
        return line

    monkeypatch.setattr("dotwave.playing.measuring.MeasuringPort", port)
    base, out = profile(tmp_path, TWO), tmp_path / "mine.yaml"
    ended = dotwave("tune", "--port", "/dev/ttyX", "--device", base, "-o", out, "--noise", "0")
    assert ended.code == 0
    assert f"Written: {out}" in ended.out
    assert asked == [("/dev/ttyX", None)]
    ended = dotwave("tune", "--port", "/dev/ttyX", "--device", base, "--json", "--amplitudes", "--baud", "9600")
    assert ended.code == 0
    assert json.loads(ended.out)["path"] == ""
    line = spoiled(line, 1, 1, 0.02)
    ended = dotwave("tune", "--port", "/dev/ttyX", "--device", base, "-o", tmp_path / "no.yaml")
    assert ended.code == 1
    assert not (tmp_path / "no.yaml").exists()
    ended = dotwave("tune", "--port", "/dev/ttyX", "--device", "paper-6x6", "-o", tmp_path / "no.yaml")
    assert ended.code == 2
    assert ended.err.count("\n") == 1
    line = held(HiddenPiezo(PAPER, 2))
    ended = dotwave("tune", "--port", "/dev/ttyX", "--device", "paper-6x6", "--noise", "0.01", "--json")
    assert ended.code == 0
    assert json.loads(ended.out)["loop"] == pytest.approx(0.05, abs=0.02)


def test_a_report_without_pages_is_not_ok() -> None:
    assert not TuneReport("", "x", (), (0.4, 0.4), {}, 0, (), "Page 1 cannot be shown any more: it lacks volts.").ok
