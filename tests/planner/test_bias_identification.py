"""Deflection per volt, hysteresis and creep of biased actuators are learned from pages and made good."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Device, Outcome, load_device
from drivers import Waveform
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import BiasEstimate, EstimateError, Measured, Plan, SensorNoise, plan_scene
from planner.identification.bias_history import BiasHistory
from tests.support.hidden_piezo import HiddenPiezo

Floats = NDArray[np.float64]
PAPER = load_device("paper-6x6")
NOISE = SensorNoise(0.0, 0.01 * PAPER.full_scale)
DWELL_S = 2.0


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path))


def pages(count: int, seed: int, levels: int = 3) -> list[Floats]:
    """Dots, and levels between them."""
    rng = np.random.default_rng(seed)
    return [rng.integers(0, levels, (6, 6)) / (levels - 1) for _ in range(count)]


def planned(wanted: list[Floats], device: Device = PAPER) -> Plan:
    frames = tuple(Frame(TargetPattern(one.astype(np.complex128)), DWELL_S) for one in wanted)
    return plan_scene(Scene(GridShape(6, 6), frames), device)


def shown(hidden: HiddenPiezo, wanted: list[Floats], *, known: bool) -> tuple[list[float], BiasEstimate]:
    """Root mean square error of every page, and what is known in the end; each page is corrected anew."""
    estimate, errors = BiasEstimate.of(PAPER), list[float]()
    for page in wanted:
        plan = planned([page])
        frame = next(iter((estimate.corrected(plan) if known else plan).frames))
        assert frame.outcome is Outcome.OK
        felt = hidden.shows(frame)
        errors.append(float(np.sqrt(np.mean((felt - page.ravel()) ** 2))))
        estimate = estimate.after(frame, hidden.measured(felt), NOISE)
    return errors, estimate


def test_pages_get_right_where_they_are_wrong_without() -> None:
    wanted = pages(12, seed=1)
    blind, known = (shown(HiddenPiezo(PAPER, 2), wanted, known=known)[0] for known in (False, True))
    assert known[0] == blind[0]
    assert np.mean(blind[6:]) > 0.025
    assert np.mean(known[6:]) < 0.01
    assert np.mean(known[6:]) < 0.35 * np.mean(blind[6:])


def opening(history: BiasHistory, weights: Floats) -> Floats:
    """How much wider a force is at half of full scale on the way down than on the way up."""
    half, full = (np.full(len(history.play), share * 0.147) for share in (0.5, 1.0))
    up, down = history.after(half, 0.0), history.after(full, 0.0).after(half, 0.0)
    return np.asarray(np.sum((down.play - up.play) * weights, axis=1)) / 0.147


@pytest.mark.parametrize("part", [{"loop": 0.0, "creep": 0.0}, {"loop": 0.0}, {"creep": 0.0}], ids=str)
def test_each_part_is_told_from_the_others(part: dict[str, float]) -> None:
    hidden = HiddenPiezo(PAPER, 2, noise=0.002, **part)
    estimate = shown(hidden, pages(24, seed=4, levels=5), known=True)[1]
    truth = opening(BiasHistory.at_rest(1, hidden.radius), np.full((1, 20), hidden.loop / 20))
    assert truth[0] == 0 or truth[0] > 0.02
    assert np.median(estimate.loop) == pytest.approx(truth[0], abs=0.006)
    assert np.median(estimate.creep) == pytest.approx(hidden.creep, abs=0.008)
    assert np.corrcoef(estimate.gain, hidden.gain / hidden.stiffness)[0, 1] > 0.95


def test_the_correction_undoes_what_the_estimate_says() -> None:
    """Exactly: the plan's own deflections come out of its own numbers, page after page."""
    wanted = pages(5, seed=6)
    estimate = shown(HiddenPiezo(PAPER, 2), wanted, known=True)[1]
    fresh = BiasEstimate(PAPER, estimate.mean, estimate.covariance, BiasEstimate.of(PAPER).history)
    history, before = fresh.history, np.zeros(36)
    for frame, plain in zip(fresh.corrected(planned(wanted)).frames, planned(wanted).frames, strict=True):
        if frame.frame is None:
            assert not any(state.bias.any() for state in frame.states)
            break
        force, goal = (np.concatenate([state.bias for state in one.states]) for one in (frame, plain))
        hold_s = frame.end_s - frame.settled_s
        made = np.sum(history.terms(force, 0.75 * hold_s) * estimate.mean, axis=1)
        changed = goal != before
        np.testing.assert_allclose(made[changed], goal[changed], atol=1e-12)
        history, before = history.after(force, hold_s), goal
    else:
        pytest.fail("no way out")


def test_corrected_plans_are_waveforms_without_steps() -> None:
    wanted = pages(4, seed=7)
    estimate = shown(HiddenPiezo(PAPER, 2), wanted, known=True)[1]
    fresh = BiasEstimate(PAPER, estimate.mean, estimate.covariance, BiasEstimate.of(PAPER).history)
    volts, plain = (
        np.concatenate(list(Waveform.of(plan).blocks(4096)))[:, 6:]
        for plan in (fresh.corrected(planned(wanted)), planned(wanted))
    )
    assert volts.shape == plain.shape
    assert 0.5 < np.abs(volts - plain).max() < 15.0
    assert np.abs(np.diff(volts, axis=0)).max() < 1.3 * np.abs(np.diff(plain, axis=0)).max()
    assert not volts[-1].any()


def test_what_takes_more_volts_than_there_are_is_unreachable() -> None:
    weak = BiasEstimate.of(PAPER)
    weak.mean[3, 0] = 0.5
    first, *_ = weak.corrected(planned([np.ones((6, 6))])).frames
    assert first.outcome is Outcome.UNREACHABLE
    assert "paper-6x6 cannot hold this pattern as it was found to be: it takes 147 V." in first.note
    assert next(iter(BiasEstimate.of(PAPER).corrected(planned([np.ones((6, 6))])).frames)).outcome is Outcome.OK


def test_plays_remember_where_the_force_came_from() -> None:
    history = BiasHistory.at_rest(1, np.array([0.1, 0.3]))
    up = history.after(np.array([1.0]), 0.0)
    np.testing.assert_allclose(up.play, [[0.9, 0.7]])
    down = up.after(np.array([0.5]), 0.0)
    np.testing.assert_allclose(down.play, [[0.6, 0.7]])
    np.testing.assert_allclose(up.after(np.array([1.0]), 1e9).relaxed, np.ones((1, 7)))


def test_what_was_not_measured_stays_as_it_was() -> None:
    estimate, frame = BiasEstimate.of(PAPER), next(iter(planned([np.ones((6, 6))]).frames))
    mean = np.full(36, 0.9 * PAPER.full_scale)
    mean[4] = np.nan
    after = estimate.after(frame, Measured(0, mean, np.full(36, np.nan + 0j)), NOISE)
    assert np.flatnonzero(np.all(after.mean == estimate.mean, axis=1)).tolist() == [4]
    assert np.isfinite(after.covariance).all()


def test_a_device_without_bias_is_refused() -> None:
    with pytest.raises(EstimateError, match="linked-6x6: it has no bias on every actuator"):
        BiasEstimate.of(load_device("linked-6x6"))
