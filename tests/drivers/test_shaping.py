"""Rounding with the error pushed up in frequency, and what it is good for: chains that magnify noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from chainsim import load_device
from dotwave.verification import verify
from drivers import write_waveform
from drivers.waveform.shaping import Shaper
from encoders import Frame, GridShape, Scene, levels
from planner import Plan, plan_scene


def by_hand(samples: np.ndarray) -> np.ndarray:
    """Error feedback as it is written down, sample by sample."""
    out, latest, before = [], 0.0, 0.0
    for x in samples:
        wanted = x - 2 * latest + before
        y = np.floor(wanted + 0.5)
        latest, before = y - wanted, latest
        out.append(y)
    return np.array(out)


@given(st.integers(0, 2**32), st.lists(st.integers(1, 40), min_size=1, max_size=6))
def test_it_is_error_feedback_however_the_samples_are_cut(seed: int, cuts: list[int]) -> None:
    rng = np.random.default_rng(seed)
    # On the grid of 2^-20 of a step sums are exact, in the shaper and by hand.
    samples = np.round(rng.uniform(-1000, 1000, (2, sum(cuts))) * 2**20) / 2**20
    shaper = Shaper(2)
    parts = np.split(samples, np.cumsum(cuts)[:-1], axis=1)
    got = np.concatenate([shaper.round(part) for part in parts], axis=1)
    np.testing.assert_array_equal(got, [by_hand(row) for row in samples])
    assert np.abs(got - samples).max() <= 2.0


def test_the_noise_near_the_carrier_is_that_of_the_formula() -> None:
    rate, count = 60, 60 * 4000
    theta = 2 * np.pi / rate
    samples = 300.3 * np.cos(theta * np.arange(count) * 1.000317)[None, :]
    noise = np.fft.rfft((Shaper(1).round(samples) - samples)[0] * np.hanning(count))
    near = np.abs(noise[3000:5000]) ** 2
    white = 1 / 12 * np.sum(np.hanning(count) ** 2)
    omega = 2 * np.pi * np.arange(3000, 5000) / count
    assert near.mean() == pytest.approx(white * np.mean((2 * np.sin(omega / 2)) ** 4), rel=0.15)


def test_silence_stays_silent() -> None:
    shaper = Shaper(2)
    shaper.round(np.array([[0.3, 0.4, 0.1], [0.2, 0.2, 0.2]]))
    assert not shaper.round(np.zeros((2, 500))).any()


def test_sixteen_bits_hold_rows_that_magnify_noise(tmp_path: Path) -> None:
    """Six dots alike pass the drive's noise near their resonance on 10^9 times."""
    linked = load_device("linked-6x6")
    device = linked.model_copy(update={"amplifier": linked.amplifier.model_copy(update={"bits": 16})})
    rows = np.array([[1] * 6, [1, 1, 1, 0, 0, 0], [1, 0, 1, 0, 1, 1], [0] * 6, [0.5] * 6, [0, 1, 1, 1, 1, 1]])
    plans = list(plan_scene(Scene(GridShape(6, 6), [Frame(levels(rows), 1.2)]), device).frames)
    write_waveform(Plan(device, plans, {}), tmp_path / "shown.npz")
    steps = np.load(tmp_path / "shown.npz")["volts"] / device.amplifier.volt_step
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
    (felt,) = verify(tmp_path / "shown.npz").frames
    # Plain rounding leaves a half.
    assert felt.amplitude_error < 0.01
