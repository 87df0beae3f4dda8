"""Devices coupled in two dimensions: waves of any lag each way, dots by links, and what they cannot do."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import dotwave as dw
from chainsim import Device, Outcome, load_device
from dotwave.as_built.study import AsBuiltStudy, verify_as_built
from dotwave.errors import AppError
from dotwave.playing.emulate import emulate
from dotwave.studies.tradeoff import trade_frame
from dotwave.verification import verify
from drivers import ControllerSpec, VirtualController, read_waveform, write_plan
from drivers.protocol.outgoing import UnfitController, check_fit
from encoders import Frame, GridShape, Scene, TargetPattern, bars, levels, plane_wave, rings, slanted_bars, walking_bars
from planner import DwellTooShort, FramePlan, plan_scene
from planner.analysis.effects import Linearisation
from planner.closed_forms import grid
from planner.closed_forms.ringing import ringing
from planner.families import family_of, row_of
from planner.targets import AmplitudeTarget
from tests.support.grid_motion import felt_after

SHAPE = GridShape(6, 6)
WAVES, LINKED = load_device("grid-6x6"), load_device("linked-grid-6x6")


def planned(device: Device, pattern: TargetPattern, dwell_s: float = 9.0) -> FramePlan:
    return next(iter(plan_scene(Scene(SHAPE, (Frame(pattern, dwell_s=dwell_s),)), device).frames))


def drives(device: Device, where: str) -> Device:
    return device.model_copy(update={"coupling": device.coupling.model_copy(update={"drives": where})})


@pytest.mark.parametrize("seed", range(6))
def test_the_closed_form_solves_the_stage(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lag_x, lag_y = rng.uniform(0.1, math.pi - 0.1, 2)
    amplitude, share = rng.uniform(0.001, 0.05), rng.uniform(0, 1)
    lam_x, lam_y, omega = grid.plane_wave(WAVES, amplitude, lag_x, lag_y, share)
    kappa = 1 - omega**2 + 0.75 * WAVES.beta * amplitude**2
    asked = lam_x * (np.exp(1j * lag_x) - 1) + lam_y * (np.exp(1j * lag_y) - 1)
    assert asked == pytest.approx(kappa + 1j * WAVES.delta * omega, abs=1e-12)
    row, col = np.ogrid[:6, :6]
    wave = np.asarray(amplitude * np.exp(-1j * (lag_x * col + lag_y * row)), dtype=np.complex128)
    needed = grid.drives_of(WAVES, wave, grid.GridLinks.alike(WAVES, lam_x, lam_y), omega)
    assert np.abs(needed[1:, 1:]).max() < 1e-12 < np.abs(needed[0]).min()


def test_what_drives_ask_for_is_what_they_make() -> None:
    rng = np.random.default_rng(1)
    wanted = np.asarray(0.02 * (rng.normal(size=(6, 6)) + 1j * rng.normal(size=(6, 6))), dtype=np.complex128)
    links = grid.GridLinks.of(WAVES, rng.uniform(0, 0.3, WAVES.links))
    drive = grid.drives_of(WAVES, wanted, links, 1.3)
    assert grid.motion_under(WAVES, drive, links, 1.3) == pytest.approx(wanted, abs=1e-12)


def test_small_motions_pass_on_as_the_matrix_of_links_says() -> None:
    rng = np.random.default_rng(2)
    links = grid.GridLinks.of(WAVES, rng.uniform(0, 0.3, WAVES.links))
    law = WAVES.chain.law
    matrix = law.matrix(links.right.reshape(1, -1), links.down.reshape(1, -1))[0]
    stage = np.eye(36) * (1 - 1.1**2 + 1.1j * WAVES.delta) + matrix
    found = grid.transfer(WAVES, links, np.array([1.1]))[:, :, :, 0]
    places = [row * 6 + col for row, col in WAVES.driven]
    assert found.reshape(11, 36) == pytest.approx(np.linalg.inv(stage)[:, places].T, rel=1e-9)


@pytest.mark.parametrize(("lag", "row_lag"), [(90, 90), (60, 45), (30, 150), (75, -80), (-20, 110), (0, 60), (165, 4)])
def test_a_wave_of_any_lags_is_planned(lag: float, row_lag: float) -> None:
    frame = planned(WAVES, plane_wave(SHAPE, lag_deg=lag, row_lag_deg=row_lag))
    assert frame.outcome is Outcome.OK, frame.note
    phasor = frame.states[0].phasor.reshape(6, 6)
    assert np.abs(phasor) == pytest.approx(np.full((6, 6), WAVES.full_scale))
    assert np.exp(1j * np.angle(phasor[:, 1:] / phasor[:, :-1])) == pytest.approx(
        np.full((6, 5), np.exp(-1j * math.radians(lag))), abs=1e-6
    )
    assert np.exp(1j * np.angle(phasor[1:] / phasor[:-1])) == pytest.approx(
        np.full((5, 6), np.exp(-1j * math.radians(row_lag))), abs=1e-6
    )


@pytest.mark.parametrize(
    ("lags", "words"),
    [((-60, -60), "0 to 180 degrees to the right or downwards"), ((180, 0), "0 to 180 degrees to the right or")],
)
def test_a_wave_towards_the_drives_is_refused_with_what_lacks(lags: tuple[float, float], words: str) -> None:
    frame = planned(WAVES, plane_wave(SHAPE, lag_deg=lags[0], row_lag_deg=lags[1]))
    assert frame.outcome is Outcome.UNREACHABLE
    assert words in frame.note


@pytest.mark.parametrize(("where", "lags"), [("corner", (60, 60)), ("column", (0, 60))])
def test_drives_that_are_not_there_are_named(where: str, lags: tuple[float, float]) -> None:
    frame = planned(drives(WAVES, where), plane_wave(SHAPE, lag_deg=lags[0], row_lag_deg=lags[1]))
    assert frame.outcome is Outcome.UNREACHABLE
    assert "it lacks drives on the first row and column" in frame.note


def test_a_driven_column_makes_waves_to_the_right_with_any_lag_downwards() -> None:
    frame = planned(drives(WAVES, "column"), plane_wave(SHAPE, lag_deg=60, row_lag_deg=-100))
    assert frame.outcome is Outcome.OK, frame.note
    assert not frame.states[0].lam[30:].any()


def test_dots_under_one_lam_each_way_are_refused_with_the_nearest() -> None:
    frame = planned(WAVES, bars(SHAPE, vertical=True, width=1, gap=1))
    assert frame.outcome is Outcome.UNREACHABLE
    assert "it lacks a lam per link" in frame.note
    # The driven edge of the nearest is as wished.
    assert np.abs(frame.states[0].phasor[:6]) / WAVES.full_scale == pytest.approx([1, 0, 1, 0, 1, 0], abs=1e-6)


def test_a_wave_that_is_no_stable_motion_is_refused() -> None:
    loud = WAVES.model_copy(update={"full_scale": 0.1})
    frame = planned(loud, plane_wave(SHAPE, lag_deg=60, row_lag_deg=60))
    assert frame.outcome is Outcome.UNREACHABLE
    assert "no stable motion" in frame.note
    assert frame.states[0].margins.multiplier > 1
    # As the condition of a chain says (theory.md section 2.2), in the direction that carries nearly all of it.
    assert 1.5 * 0.1**2 * math.sin(math.radians(60)) * math.cos(math.radians(60)) > loud.delta


def test_walking_bars_are_refused() -> None:
    frame = planned(WAVES, walking_bars(SHAPE, width=3))
    assert frame.outcome is Outcome.UNREACHABLE
    assert "it lacks separate rows" in frame.note


def test_a_frame_too_short_for_its_way_in_says_how_long() -> None:
    with pytest.raises(DwellTooShort, match="show frames for"):
        planned(WAVES, plane_wave(SHAPE, lag_deg=60, row_lag_deg=60), dwell_s=1.0)


def test_a_wave_is_felt_through_the_file(tmp_path: Path) -> None:
    path = tmp_path / "wave.npz"
    scene = Scene(SHAPE, (Frame(plane_wave(SHAPE, lag_deg=60, row_lag_deg=45), dwell_s=3.0),))
    write_plan(plan_scene(scene, WAVES), path)
    report = verify(path)
    assert report.ok
    planned_error = next(iter(plan_scene(scene, WAVES).frames)).error
    assert report.frames[0].amplitude_error < planned_error < 0.011
    felt = felt_after(path, until_s=2.9)
    row, col = np.ogrid[:6, :6]
    wanted = np.exp(-1j * np.deg2rad(60 * col + 45 * row))
    turn = np.exp(1j * np.angle(np.vdot(felt, wanted)))
    assert np.abs(felt * turn - wanted).max() < 0.01


def test_dots_are_felt_through_the_file(tmp_path: Path) -> None:
    path = tmp_path / "dots.npz"
    rng = np.random.default_rng(3)
    wanted = (rng.random((6, 6)) < 0.5).astype(float)
    scene = Scene(SHAPE, (Frame(TargetPattern(wanted.astype(np.complex128)), dwell_s=0.7),))
    write_plan(plan_scene(scene, LINKED), path)
    assert verify(path).ok
    felt = np.abs(felt_after(path, until_s=0.69))
    assert felt[wanted > 0] == pytest.approx(np.ones(int(wanted.sum())), abs=0.02)
    assert felt[wanted == 0].max() < 0.11


@pytest.mark.slow
def test_one_drive_makes_dots_through_the_file(tmp_path: Path) -> None:
    path = tmp_path / "corner.npz"
    wanted = (np.random.default_rng(8).random((6, 6)) < 0.3).astype(float)
    plan = plan_scene(
        Scene(SHAPE, (Frame(TargetPattern(wanted.astype(np.complex128)), dwell_s=5.0),)), drives(LINKED, "corner")
    )
    frame = next(iter(plan.frames))
    assert frame.outcome is Outcome.OK, frame.note
    write_plan(plan, path)
    assert verify(path).ok
    felt = np.abs(felt_after(path, until_s=frame.settled_s + 0.12))
    assert felt[wanted > 0] == pytest.approx(np.ones(int(wanted.sum())), abs=0.02)
    assert felt[wanted == 0].max() < 0.11


def test_one_drive_leaves_dots_silent_that_nobody_listens_to() -> None:
    wanted = np.zeros((6, 6))
    wanted[0] = wanted[:, 0] = 1
    frame = planned(drives(LINKED, "corner"), TargetPattern(wanted.astype(np.complex128)))
    assert not frame.states[0].phasor.reshape(6, 6)[1:, 1:].any()


def test_too_many_stages_for_one_drive_are_refused_with_what_lacks() -> None:
    frame = planned(drives(LINKED, "corner"), TargetPattern(np.ones((6, 6), dtype=np.complex128)))
    assert frame.outcome is Outcome.UNREACHABLE
    assert "it lacks drives" in frame.note
    assert np.abs(frame.states[0].phasor) == pytest.approx(np.full(36, LINKED.full_scale))


def test_a_text_is_felt_through_the_file(tmp_path: Path) -> None:
    path = tmp_path / "hello.npz"
    dw.plan(dw.text("Hi all", LINKED), LINKED).waveform().write(path)
    report = verify(path)
    assert report.ok
    assert report.felt_text == "Hi all"


@pytest.mark.parametrize(
    "pattern",
    [
        slanted_bars(SHAPE, angle_deg=30, width=1, gap=1.5),
        rings(SHAPE, row=2, col=3, width=1, gap=1),
        levels(np.outer(0.6 ** np.arange(6), 0.6 ** np.arange(6))),
    ],
    ids=["slanted bars", "rings", "levels"],
)
@pytest.mark.parametrize("where", ["corner", "column", "border"])
def test_bars_rings_and_levels_are_held_by_links(pattern: TargetPattern, where: str) -> None:
    device = drives(LINKED, where)
    family = family_of(row_of(AmplitudeTarget, device), device, 20.0)
    wished = np.abs(pattern.amplitude).ravel()
    (point,) = family.points([family.held(AmplitudeTarget.of(wished), started=False)])
    assert point.outcome is Outcome.OK, point.lacking
    felt = np.abs(point.phasor) / LINKED.full_scale
    assert felt[wished > 0.1] == pytest.approx(wished[wished > 0.1], abs=1e-3)
    assert felt[wished <= 0.1].max(initial=0.0) < 0.11


def test_deviations_ring_on_as_the_links_of_a_grid_say() -> None:
    rng = np.random.default_rng(5)
    links = grid.GridLinks.of(WAVES, rng.uniform(0, 0.3, WAVES.links))
    matrix = WAVES.chain.law.matrix(links.right.reshape(1, -1), links.down.reshape(1, -1))[0]
    found = ringing(WAVES.chain, links.flat, np.zeros(36))
    assert found[36:, :36] == pytest.approx(-np.eye(36) - matrix, abs=1e-12)


def test_what_is_for_chains_says_so(tmp_path: Path) -> None:
    path = tmp_path / "rest.npz"
    scene = Scene(SHAPE, (Frame(TargetPattern(np.zeros((6, 6), dtype=np.complex128)), dwell_s=0.1),))
    write_plan(plan_scene(scene, LINKED), path)
    with pytest.raises(AppError, match="only chains are drawn"):
        verify_as_built(path, AsBuiltStudy())
    with pytest.raises(AppError, match="links along rows only"):
        emulate(device="grid-6x6")
    with pytest.raises(AppError, match="pareto: grid-6x6 is coupled in two dimensions"):
        trade_frame("Hello", device="grid-6x6", frame=1, picture=None)
    with pytest.raises(UnfitController, match="only files hold them"):
        check_fit(read_waveform(path)[0], VirtualController(ControllerSpec.of(LINKED), now=0.0)._capabilities())


def test_explain_counts_the_links_downwards() -> None:
    frame = planned(WAVES, plane_wave(SHAPE, lag_deg=60, row_lag_deg=45))
    about = Linearisation(WAVES.chain, frame.states[0])
    standing = about.impedance(frame.states[0].omega, 0.75 * WAVES.beta * about.size**2) @ frame.states[0].phasor
    assert standing == pytest.approx(about.driven(about.lines[0]), abs=1e-12)
    assert np.abs(about.without_down()[0]).max() > 0.5 * WAVES.full_scale


def test_a_pattern_changes_into_another_without_rest(tmp_path: Path) -> None:
    path = tmp_path / "two.npz"
    first, second = np.eye(6), 1 - np.eye(6)
    scene = Scene(SHAPE, tuple(Frame(TargetPattern(one.astype(np.complex128)), dwell_s=0.8) for one in (first, second)))
    plan = plan_scene(scene, LINKED)
    assert [frame.settled_s - frame.start_s < 0.4 for frame in plan.frames] == [True] * 3
    write_plan(plan, path)
    assert verify(path).ok
