"""Several tones in one drive: states and ramps turned and joined, kept in the cache, and sampled."""

from __future__ import annotations

import cmath
import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Outcome, load_device
from drivers import Waveform, WaveformError, write_waveform
from encoders import Frame, GridShape, Scene, TargetPattern, bars, plane_wave, walking_bars
from planner import ContrastError, FramePlan, Margins, OperatingPoint, Plan, PointTone, Ramp, ToneRamp, plan_scene
from planner.cache import PlanCache
from planner.memory import MOST_STATES, Memory
from planner.transitions.joining import as_tone, joined, rest_for, turned_ramp, turned_state

SINGLE = load_device("independent-6x6")
COMMON = load_device("paper-6x6-common")
GRID = GridShape(6, 6)
FINE = SINGLE.model_copy(update={"amplifier": SINGLE.amplifier.model_copy(update={"rate_hz": 200_000})})


def state(epsilon: complex = 0.01j, omega: float = 1.0, tones: tuple[PointTone, ...] = ()) -> OperatingPoint:
    return OperatingPoint(
        target=np.ones(1), epsilon=epsilon, lam=np.zeros(0), bias=np.zeros(1), omega=omega,
        phasor=np.full(1, 0.05 + 0j), mean=np.zeros(1), error=0.0, margins=Margins(0.0, 0.0), outcome=Outcome.OK,
        phase=np.array([0.5]), tones=tones,
    )  # fmt: skip


def tone(omega: float, epsilon: complex) -> PointTone:
    return PointTone(omega, epsilon, np.full(1, 0.02 + 0.01j))


def complexed(values: NDArray[np.complexfloating]) -> NDArray[np.complex128]:
    """The same numbers, for numpy's stubs know no width of a product with a complex number."""
    return values.astype(np.complex128)


def ramp(last: complex, *tones: ToneRamp) -> Ramp:
    x = np.linspace(0, 1, 5)
    return Ramp(0.1 * x, complexed(last * x**2), complexed(20 * last * x), tones=tones)


def sampled(shown: OperatingPoint, way: Ramp | None) -> np.ndarray:
    count = FINE.rows * FINE.chains_per_row
    frame = FramePlan(
        Frame(TargetPattern(np.ones((6, 6), dtype=np.complex128)), 0.3), 0.0, 0.1, 0.3, (shown,) * count, (way,) * count
    )
    return np.concatenate(list(Waveform.of(Plan(FINE, [frame], {})).blocks(4096)))[:, 0]


def test_a_drive_is_the_sum_of_its_tones() -> None:
    side = tone(1.02, 0.004 - 0.002j)
    x = np.linspace(0, 1, 5)
    way = ramp(0.01j, ToneRamp(1.02, complexed(side.epsilon * x**2), complexed(20 * side.epsilon * x)))
    volts = sampled(state(tones=(side,)), way)
    tau = FINE.tau_per_s * np.arange(len(volts)) / FINE.amplifier.rate_hz
    size = np.minimum(tau / FINE.tau_per_s / 0.1, 1.0) ** 2
    force = size * np.real(0.01j * np.exp(1j * tau) + side.epsilon * np.exp(1.02j * tau))
    np.testing.assert_allclose(volts * FINE.epsilon_per_volt, force, atol=2e-5 * 0.01)


def test_a_tone_at_the_main_frequency_is_not_heard_twice() -> None:
    before, after = state(0.01j, 1.0), state(0.02 + 0j, 1.0)
    down = np.linspace(1, 0, 5)
    fall = as_tone(Ramp(np.linspace(0, 0.1, 5), complexed(0.01j * down), np.full(5, -0.1j)), 1.0)
    whole = joined(fall, ramp(0.02 + 0j), before, after)
    assert whole.tones == ()
    assert whole.epsilon is not None
    np.testing.assert_allclose(whole.epsilon[[0, 4, 5, 9]], [0.01j, 0, 0, 0.02], atol=1e-15)
    other = joined(fall, ramp(0.02 + 0j), before, state(0.02 + 0j, 1.1))
    assert [one.omega for one in other.tones] == [1.0]


def test_joined_ramps_last_as_long_as_both() -> None:
    whole = joined(rest_for(as_tone(ramp(0j), 1.0), 0.25), ramp(0.01j), state(), state())
    assert whole.duration_s == pytest.approx(0.45)
    assert np.all(np.diff(whole.t_s) >= 0)


def test_links_jump_where_ramps_meet() -> None:
    device_state = state()
    three = [
        OperatingPoint(**{**vars(device_state), "lam": np.full(2, value), "bias": np.zeros(3), "target": np.ones(3)})
        for value in (0.1, 0.3)
    ]
    first = Ramp(np.array([0.0, 0.5]), lam_t_s=np.array([0.0, 0.5]), lam=np.array([[0.1, 0.1], [0.0, 0.0]]))
    second = Ramp(np.array([0.0, 0.2]), lam_t_s=np.array([0.0, 0.2]), lam=np.array([[0.5, 0.5], [0.3, 0.3]]))
    whole = joined(first, second, three[0], three[1])
    assert whole.lam_t_s is not None
    assert whole.lam is not None
    assert np.all(np.diff(whole.lam_t_s) > 0)
    assert np.interp(0.5, whole.lam_t_s, whole.lam[:, 0]) == pytest.approx(0.0)
    assert np.interp(0.501, whole.lam_t_s, whole.lam[:, 0]) == pytest.approx(0.5, abs=2e-3)


def test_turning_turns_every_tone() -> None:
    turned = turned_state(state(tones=(tone(1.1, 0.002 + 0j),)), 0.7)
    factor = cmath.exp(0.7j)
    assert turned.epsilon == pytest.approx(0.01j * factor)
    assert turned.tones[0].epsilon == pytest.approx(0.002 * factor)
    assert turned.phase is not None
    assert turned.phase[0] == pytest.approx(1.2)
    way = turned_ramp(ramp(0.01j, ToneRamp(1.1, np.full(5, 1j))), 0.7)
    assert way.epsilon is not None
    assert way.epsilon[-1] == pytest.approx(0.01j * factor)
    assert way.tones[0].epsilon[0] == pytest.approx(1j * factor)


def test_tones_are_kept() -> None:
    kept = PlanCache(SINGLE, 20.0)
    shown = state(tones=(tone(1.1, 0.002 + 0.001j),))
    way = ramp(0.01j, ToneRamp(1.1, np.full(5, 1j), np.zeros(5, np.complex128)))
    kept.keep([(b"tone state", shown), (b"tone ramp", way)])
    back, way_back = PlanCache(SINGLE, 20.0).find([b"tone state", b"tone ramp"])
    assert back.tones[0].epsilon == shown.tones[0].epsilon
    assert back.margins == shown.margins
    np.testing.assert_array_equal(back.tones[0].phasor, shown.tones[0].phasor)
    np.testing.assert_array_equal(way_back.tones[0].epsilon, way.tones[0].epsilon)
    assert not way_back.tones[0].epsilon.flags.writeable


def test_a_damaged_plan_is_made_again(caplog: pytest.LogCaptureFixture) -> None:
    kept = PlanCache(SINGLE, 20.0)
    kept.keep([(b"sound", state()), (b"ill", state())])
    connection = kept._file._connection
    assert connection is not None
    connection.execute("UPDATE plans SET value = x'00' WHERE key = ?", (kept._key(b"ill"),))
    again = PlanCache(SINGLE, 20.0)
    assert [one is None for one in again.find([b"sound", b"ill"])] == [False, True]
    again.keep([(b"ill", state())])
    assert all(one is not None for one in PlanCache(SINGLE, 20.0).find([b"sound", b"ill"]))


def test_the_converter_takes_steps() -> None:
    coarse = COMMON.model_copy(update={"amplifier": COMMON.amplifier.model_copy(update={"bits": 8})})
    plan = plan_scene(Scene(GRID, [Frame(bars(GRID, vertical=True, width=1, gap=1), 0.5)]), coarse)
    volts = np.concatenate(list(Waveform.of(plan).blocks(4096)))
    steps = volts / coarse.amplifier.volt_step
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert len(np.unique(steps)) > 20


def test_an_omega_beyond_the_rate_is_refused_in_a_tone_too() -> None:
    with pytest.raises(WaveformError, match="samples a second"):
        sampled(state(tones=(tone(1e4, 0.01 + 0j),)), None)


@pytest.mark.parametrize("contrast_db", [0.0, -20.0, math.nan, math.inf])
def test_a_contrast_that_is_none_is_refused(contrast_db: float) -> None:
    with pytest.raises(ContrastError, match="decibels above 0") as raised:
        plan_scene(Scene(GRID, []), SINGLE, contrast_db=contrast_db)
    assert "\n" not in str(raised.value)


def test_memory_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planner.memory.MOST_STATES", 8)
    monkeypatch.setattr("planner.memory.MOST_RAMPS", 8)
    memory, rng = Memory(SINGLE, 20.0), np.random.default_rng(0)
    held = [memory.rest] * 36
    for _ in range(5):
        now = memory.hold(TargetPattern(rng.uniform(0.1, 1, (6, 6)).astype(np.complex128)), held)
        for one, other in zip(held, now, strict=True):
            memory.state(other)
            memory.ramp(one, other, True)
        held = now
        assert len(memory._states) <= 8
        assert len(memory._turned) <= 8
        assert len(memory._held) <= 8
        assert len(memory._points) <= 8 + 36
    assert MOST_STATES >= 64


def plans(device: object, *patterns: TargetPattern, dwell_s: float) -> list[FramePlan]:
    return list(plan_scene(Scene(GRID, [Frame(one, dwell_s) for one in patterns]), device).frames)  # type: ignore[arg-type]


def test_one_drive_moves_all_chains_alike() -> None:
    shown, *_ = plans(COMMON, plane_wave(GRID, lag_deg=90, row_lag_deg=30), dwell_s=2.0)
    assert shown.outcome is Outcome.UNREACHABLE
    assert "lacks a drive per chain" in shown.note
    assert len({(one.epsilon, one.omega) for one in shown.states}) == 1
    alike, *_ = plans(COMMON, plane_wave(GRID, lag_deg=90), dwell_s=2.0)
    assert alike.outcome is Outcome.OK
    assert len({(one.epsilon, one.omega) for one in alike.states}) == 1


@pytest.mark.slow
def test_one_lam_for_all_chains() -> None:
    """With a drive per chain and one lam, rows of one wave and of another level share it."""
    device = COMMON.model_copy(update={"drive": "chain"})
    two = plane_wave(GRID, lag_deg=90).amplitude * np.where(np.arange(6) < 3, 0.6, 0.5)[:, None]
    mixed = TargetPattern(two, plane_wave(GRID, lag_deg=90).kind, phase_matters=True)
    shown, *_ = plans(device, mixed, dwell_s=20.0)
    assert len({float(one.lam[0]) for one in shown.states}) == 1
    assert all(one.lam[0] > 0 for one in shown.states)


def test_the_file_says_which_rows_move(tmp_path: Path) -> None:
    import json

    walk = walking_bars(GRID, width=2, level=0.5)
    write_waveform(plan_scene(Scene(GRID, [Frame(walk, 1.0)]), SINGLE), tmp_path / "walk.wav")
    (mark,) = json.loads((tmp_path / "walk.json").read_text())["frames"]
    assert [len(row) for row in mark["tones"]] == [1] * 6
    wave = plane_wave(GRID, lag_deg=90)
    write_waveform(plan_scene(Scene(GRID, [Frame(wave, 1.0)]), COMMON), tmp_path / "wave.wav")
    (mark,) = json.loads((tmp_path / "wave.json").read_text())["frames"]
    assert mark["moving"] == [True] * 6
    np.testing.assert_allclose(np.exp(1j * np.array(mark["phase"])), wave.amplitude, atol=1e-6)


def test_links_stay_through_a_rest() -> None:
    """Links that crept up while the chain rests would pass on what is left in it."""
    still = OperatingPoint(**{**vars(state()), "lam": np.full(2, 0.3), "bias": np.zeros(3), "target": np.ones(3)})
    down = Ramp(np.array([0.0, 0.5]), lam_t_s=np.array([0.0, 0.5]), lam=np.array([[0.3, 0.3], [0.0, 0.0]]))
    up = Ramp(np.array([0.0, 0.2]), lam_t_s=np.array([0.0, 0.2]), lam=np.array([[0.5, 0.5], [0.3, 0.3]]))
    whole = joined(rest_for(down, 1.0), up, still, still)
    assert whole.lam_t_s is not None
    assert whole.lam is not None
    assert np.interp([0.5, 1.0, 1.499], whole.lam_t_s, whole.lam[:, 0]).tolist() == [0.0, 0.0, 0.0]
    assert np.interp(1.501, whole.lam_t_s, whole.lam[:, 0]) == pytest.approx(0.5, abs=2e-3)
