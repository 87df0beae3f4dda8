"""A device is identified from the pages it shows, and shows the next ones right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Device, load_device
from encoders import TargetPattern
from planner import DeviceEstimate, EstimateError, Measured, OperatingPoint, SensorNoise, choose_pages
from planner.identification import page_choice
from planner.identification.stages import ChainEstimate, ChainPage
from planner.memory import Memory
from planner.unequal import UnequalMemory
from tests.support.hidden_device import HiddenDevice, drawn

Floats = NDArray[np.float64]
LINKED, SINGLE = load_device("linked-6x6"), load_device("independent-6x6")


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path))


def of_rows(device: Device, rows: int) -> Device:
    """As many chains as rows, each a device of its own to the estimate."""
    return device.model_copy(update={"rows": rows})


def planned(device: Device, levels: Floats) -> list[OperatingPoint]:
    memory = (UnequalMemory if device.actuators else Memory)(device, 20.0)
    return memory.states(memory.hold(TargetPattern(levels.astype(np.complex128)), memory.at_rest))


def random_pages(rng: np.random.Generator, device: Device) -> Floats:
    """A page in which no row is empty."""
    levels = rng.integers(0, 2, (device.rows, device.cols)).astype(np.float64)
    levels[~levels.any(axis=1), 0] = 1.0
    return levels


def shown(
    profile: Device, hidden: HiddenDevice, pages: int, *, same: bool, phases: bool = True, seed: int = 3
) -> tuple[list[float], DeviceEstimate]:
    """Mean over chains of the largest error, page by page, and what is known in the end."""
    rng, errors = np.random.default_rng(seed), []
    estimate, levels = DeviceEstimate.of(profile), random_pages(rng, profile)
    for number in range(pages):
        device = estimate.corrected() if number else profile
        states = planned(device, levels)
        errors.append(float(np.mean(hidden.errors(states))))
        measured = hidden.measured(states)
        if not phases:
            measured = Measured(0, measured.mean, np.abs(measured.harmonic) + 0j)
        estimate = estimate.after(states, measured, SensorNoise(hidden.noise), phases=phases)
        levels = levels if same else random_pages(rng, profile)
    return errors, estimate


def hidden_of(profile: Device, *, f0: float = 0.01, noise: float = 0.01, seed: int = 1) -> HiddenDevice:
    return HiddenDevice(drawn(profile, seed, f0=f0), noise, np.random.default_rng(seed + 1))


COUNTS = [20, pytest.param(60, marks=pytest.mark.slow)]


@pytest.mark.parametrize("phases", [True, pytest.param(False, marks=pytest.mark.slow)], ids=["phasors", "amplitudes"])
@pytest.mark.parametrize("count", COUNTS)
def test_the_same_page_again_is_right(count: int, phases: bool) -> None:
    profile = of_rows(LINKED, count)
    blind, second, third = shown(profile, hidden_of(profile), 3, same=True, phases=phases)[0]
    assert blind > 0.15
    assert second < (0.02 if phases else 0.03)
    assert third < 0.012


@pytest.mark.parametrize("phases", [True, False], ids=["phasors", "amplitudes"])
@pytest.mark.parametrize("count", COUNTS)
def test_other_pages_each_time_get_right_too(count: int, phases: bool) -> None:
    profile = of_rows(LINKED, count)
    errors = shown(profile, hidden_of(profile), 9, same=False, phases=phases)[0]
    assert errors[0] > 0.25
    assert errors[1] < 0.1
    assert errors[3] < 0.028
    assert max(errors[6:]) < 0.012


@pytest.mark.parametrize("count", COUNTS)
def test_three_times_the_spread_is_found_as_well(count: int) -> None:
    """Also where the profile still takes it for 1 %."""
    profile = of_rows(LINKED, count)
    errors = shown(profile, hidden_of(profile, f0=0.03), 3, same=True)[0]
    assert errors[0] > 0.6
    assert errors[1] < 0.03
    assert errors[2] < 0.015


@pytest.mark.parametrize("count", COUNTS)
def test_a_coarse_sensor_takes_more_pages(count: int) -> None:
    profile = of_rows(LINKED, count)
    errors = shown(profile, hidden_of(profile, noise=0.05), 6, same=True)[0]
    assert errors[1] < 0.072
    assert errors[5] < 0.035


def test_what_is_expected_is_what_comes() -> None:
    """The deviation the estimate states is that of the amplitudes that are then felt, before any page and after one."""
    profile = of_rows(LINKED, 40)
    hidden, estimate = hidden_of(profile), DeviceEstimate.of(profile)
    levels = np.tile([1.0, 0, 1, 1, 0, 1], (40, 1))
    for number in range(2):
        states = planned(estimate.corrected() if number else profile, levels)
        off = np.abs(np.abs(hidden.motion(states)) / [np.abs(state.phasor) for state in states] - 1)
        pages = [
            ChainPage(abs(s.epsilon), s.lam, s.omega, s.phasor * np.exp(-1j * np.angle(s.epsilon))) for s in states
        ]
        expected = [chain.expected(page) for chain, page in zip(estimate.chains, pages, strict=True)]
        share = np.sqrt(np.mean(off**2, axis=0)) / np.mean(expected, axis=0)
        # Forty draws tell a standard deviation to 11 %; far off, large motions are not linear in the numbers.
        assert np.all((share > 0.6) & (share < 1.6)), (number, share)
        estimate = estimate.after(states, hidden.measured(states), SensorNoise(hidden.noise))


def test_pages_at_two_frequencies_tell_stiffness_from_gain() -> None:
    """At one frequency what a page needs is told, their sum; the rest of both stays as it was known."""
    profile = of_rows(LINKED, 2)
    slower = profile.model_copy(update={"omega": profile.omega.model_copy(update={"max": 1.28})})
    hidden = hidden_of(profile, noise=0.0)
    estimate, pages = DeviceEstimate.of(profile), ([1.0, 0, 1, 0, 1, 0], [0.0, 1, 0, 1, 0, 1], [1.0, 1, 0, 0, 1, 1])
    for page in pages:
        states = planned(profile, np.tile(page, (2, 1)))
        estimate = estimate.after(states, hidden.measured(states), SensorNoise(0.0))
    assert hidden.errors(planned(estimate.corrected(), np.tile([0.0, 0, 1, 1, 0, 1], (2, 1)))).max() < 1e-3
    assert np.median(estimate.deviation[:, 0]) > 0.3 * estimate.prior[0].deviation[0, 0]
    for page in pages:
        states = planned(slower, np.tile(page, (2, 1)))
        estimate = estimate.after(states, hidden.measured(states), SensorNoise(0.0))
    found, truth = estimate.corrected(), hidden.truth
    assert estimate.told[:, [0, 3]].all()
    for row in range(2):
        np.testing.assert_allclose(found.chain_at(row).stiffness, truth.chain_at(row).stiffness, rtol=3e-4)
        np.testing.assert_allclose(found.lam_gain(row), truth.lam_gain(row), rtol=2e-3)
        assert found.drive_per_volt(row) == pytest.approx(truth.drive_per_volt(row), rel=2e-3)


def test_what_no_page_tells_is_said() -> None:
    """Alone and at one frequency, stiffness and what a volt makes cannot be told apart; damping hardly counts."""
    profile = of_rows(SINGLE, 1)
    hidden = hidden_of(profile)
    errors, estimate = shown(profile, hidden, 4, same=True)
    assert errors[3] < 0.012
    stiffness, delta, beta, gain = estimate.told.T
    assert stiffness.any() or gain.any()
    assert not beta.any()
    assert not delta.any()
    assert not (estimate.deviation[:, 0] < 0.3 * estimate.prior[0].deviation[0, 0]).any()


def test_the_device_found_is_where_the_next_estimate_begins() -> None:
    profile = of_rows(LINKED, 2)
    _, estimate = shown(profile, hidden_of(profile), 3, same=False)
    again = DeviceEstimate.of(estimate.corrected())
    np.testing.assert_allclose(np.concatenate([one.mean for one in again.chains]), estimate.mean, rtol=1e-12)
    np.testing.assert_allclose(again.deviation, estimate.deviation, rtol=1e-9)


def test_a_spread_that_is_told_becomes_what_is_left() -> None:
    profile = Device.model_validate(of_rows(LINKED, 3).as_dict() | {"spread": {"frequency": 0.01}})
    _, estimate = shown(profile, hidden_of(profile), 3, same=False)
    spread = estimate.corrected().spread
    assert spread is not None
    assert 0 < spread.frequency < 0.008
    assert spread.damping == 0.0
    assert shown(of_rows(LINKED, 1), hidden_of(of_rows(LINKED, 1)), 1, same=True)[1].corrected().spread is None


def test_what_was_not_measured_stays_as_it_was() -> None:
    profile = of_rows(LINKED, 1)
    estimate, states = DeviceEstimate.of(profile), planned(profile, np.ones((1, 6)))
    phasor = hidden_of(profile).measured(states).harmonic.copy()
    phasor[2] = np.nan
    after = estimate.after(states, Measured(0, np.zeros(6), phasor), SensorNoise(0.01))
    changed = np.any(after.mean != estimate.mean, axis=1)
    assert changed.tolist() == [True, True, False, False, True, True]
    silent = estimate.after(planned(profile, np.zeros((1, 6))), Measured(0, np.zeros(6), phasor), SensorNoise(0.01))
    np.testing.assert_array_equal(silent.mean, estimate.mean)


def test_a_dead_actuator_is_called_strange_and_stays_believable() -> None:
    profile = of_rows(LINKED, 1)
    estimate, states = DeviceEstimate.of(profile), planned(profile, np.ones((1, 6)))
    phasor = hidden_of(profile).measured(states).harmonic.copy()
    phasor[3] *= 0.05
    after = estimate.after(states, Measured(0, np.zeros(6), phasor), SensorNoise(0.01))
    assert after.strange[3]
    assert not after.strange[[0, 1, 2, 5]].any()
    wide = estimate.prior[0].deviation
    assert np.all(np.abs(after.mean - estimate.mean) <= 10.0 * wide + 1e-12)
    assert after.corrected().chain_at(0).n == 6


def test_rings_and_measurements_of_another_device_are_refused() -> None:
    with pytest.raises(EstimateError, match="paper-6x6-ring: its chains are ring; only open chains are identified"):
        DeviceEstimate.of(load_device("paper-6x6-ring"))
    states = planned(LINKED, np.ones((6, 6)))
    with pytest.raises(EstimateError, match="linked-6x6 has 36 actuators, 4 were measured; give its own profile"):
        DeviceEstimate.of(LINKED).after(
            states, Measured(0, np.zeros(4), np.zeros(4, dtype=np.complex128)), SensorNoise(0.01)
        )
    with pytest.raises(ValueError, match="one mean and one harmonic an actuator"):
        Measured(0, np.zeros(4), np.zeros(5, dtype=np.complex128))


def test_pages_are_chosen_until_any_page_is_expected_to_be_right() -> None:
    choice = choose_pages(LINKED, SensorNoise(0.01), 0.02, contrast_db=20.0)
    assert len(choice.expected) == len(choice.levels) + 1
    assert choice.expected[0] > 0.3
    assert choice.expected[-1] <= 0.02 < choice.expected[-2]
    assert len(choice.levels) <= 4
    assert np.all(np.diff(choice.expected) < 0)
    # They tell more than as many pages at random.
    (estimate,) = DeviceEstimate.of(of_rows(LINKED, 1)).chains
    _, pages = page_choice._candidates(of_rows(LINKED, 1), 20.0)
    rng, by_chance = np.random.default_rng(0), []
    for _ in range(20):
        after = estimate
        for at in rng.integers(0, len(pages), len(choice.levels)):
            after = after.after(pages[at], SensorNoise(0.01))
        by_chance.append(page_choice._expected(after, pages, LINKED.full_scale))
    assert choice.expected[-1] < min(by_chance)
    # And what is expected comes: other pages are then right to about that.
    profile = of_rows(LINKED, 10)
    hidden, known = hidden_of(profile), DeviceEstimate.of(profile)
    for levels in choice.levels:
        states = planned(known.corrected(), np.tile(levels, (10, 1)))
        known = known.after(states, hidden.measured(states), SensorNoise(hidden.noise))
    others = [random_pages(np.random.default_rng(seed), profile) for seed in range(4)]
    assert np.mean([hidden.errors(planned(known.corrected(), levels)) for levels in others]) < 0.03


def test_a_single_actuator_needs_one_page() -> None:
    assert choose_pages(SINGLE, SensorNoise(0.01), 0.01, contrast_db=20.0).levels.tolist() == [[1.0]]


def test_a_device_that_can_show_no_page_says_what_it_lacks() -> None:
    slow = LINKED.model_copy(update={"omega": LINKED.omega.model_copy(update={"min": 1.0, "max": 1.0})})
    with pytest.raises(EstimateError, match="linked-6x6 can show no page to be identified by: "):
        choose_pages(slow, SensorNoise(0.01), 0.01, contrast_db=20.0)


def test_a_stage_learns_nothing_where_it_does_not_move() -> None:
    estimate = ChainEstimate(np.array([[1.0, 5e-3, -1.0, 1.0]]), np.diag([4e-4, 1e-6, 1e-2, 1e-3]))
    page = ChainPage(0.01, np.empty(0), 1.3, np.zeros(1, dtype=np.complex128))
    np.testing.assert_array_equal(estimate.after(page, SensorNoise(0.01)).covariance, estimate.covariance)


@pytest.mark.slow
def test_a_sensor_whose_noise_is_the_same_everywhere_tells_less_of_idle_actuators() -> None:
    profile = of_rows(LINKED, 20)
    hidden = HiddenDevice(drawn(profile, 1, f0=0.01), 0.0, np.random.default_rng(2), floor=0.01)
    levels, errors = random_pages(np.random.default_rng(3), profile), list[list[float]]()
    for noise in (SensorNoise(0.0, 0.01 * profile.full_scale), SensorNoise(0.01)):
        estimate = DeviceEstimate.of(profile)
        errors.append([])
        for _ in range(5):
            states = planned(estimate.corrected(), levels)
            estimate = estimate.after(states, hidden.measured(states), noise)
            errors[-1].append(float(np.mean(hidden.errors(states))))
    told, mistaken = errors
    assert told[4] < 0.06
    assert told[4] < 0.6 * mistaken[4]
