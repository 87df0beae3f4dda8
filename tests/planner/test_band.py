"""The drive frequency a device can pay for, and what it lacks when there is none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from chainsim import Coupling, Device, Span, load_device
from planner.amplitudes.band import LONGEST_RAMP_S, choose_band
from planner.closed_forms.links import drive_for, links_for

LINKED = load_device("linked-6x6")
VIBRATING = ["linked-6x6", "linked-40x96", "independent-6x6"]


def altered(device: Device = LINKED, **changes: Any) -> Device:
    """The device with other numbers: `volts`, `lam` and `omega` (pairs), or any plain field."""
    update = dict(changes)
    if "volts" in update:
        update["amplifier"] = device.amplifier.model_copy(update={"volts": update.pop("volts")})
    if "lam" in update:
        low, high = update.pop("lam")
        update["coupling"] = device.coupling.model_copy(update={"lam": Span(min=low, max=high)})
    if "omega" in update:
        low, high = update.pop("omega")
        update["omega"] = Span(min=low, max=high)
    return device.model_copy(update=update)


def steady_volts(device: Device) -> float:
    """Volts that an actuator raised alone takes at the highest frequency."""
    drive = drive_for(device.chain, np.array([device.full_scale]), device.omega.max)
    return float(drive[0]) / device.epsilon_per_volt


@pytest.mark.parametrize("name", VIBRATING)
def test_profiles_have_a_band(name: str) -> None:
    device = load_device(name)
    band = choose_band(device, 20.0)
    assert band.lacking == ""
    assert device.omega.min <= band.omega <= device.omega.max
    assert 0 < band.ramp_s <= LONGEST_RAMP_S
    assert band.floor == (0.0 if device.chain_length == 1 else pytest.approx(0.1))


@pytest.mark.parametrize("contrast_db", [6.0, 10.0, 20.0])
def test_the_floor_is_the_contrast(contrast_db: float) -> None:
    assert -20 * np.log10(choose_band(LINKED, contrast_db).floor) == pytest.approx(contrast_db)


def test_the_highest_frequency_that_can_be_paid_for() -> None:
    """With a wider range the band stays inside it, and no part of the range above it has a band."""
    device = altered(omega=(0.9, 2.0))
    band = choose_band(device, 20.0)
    assert band.lacking == ""
    assert 1.2 < band.omega < 1.9
    step = 1.1 / 40
    above = altered(omega=(band.omega + step, 2.0))
    assert choose_band(above, 20.0).lacking
    links = links_for(device.chain, np.full(6, device.full_scale), band.omega)
    assert np.all(links <= device.coupling.lam.max)


@pytest.mark.parametrize("device", [altered(volts=1e3, lam=(0.0, 50.0)), LINKED])
def test_the_top_of_the_range_when_it_can_be_paid_for(device: Device) -> None:
    assert choose_band(device, 20.0).omega == device.omega.max


LACKING = {
    "slow": (altered(omega=(0.9, 1.1)), "too slow", "omega.max"),
    "slow_at_resonance": (altered(omega=(0.9, 1.0)), "too slow", "omega.max"),
    "step": (altered(f0_hz=5000.0, omega=(0.9, 1.02)), "no link can make a step", "omega.max"),
    "step_contrast": (altered(full_scale=1e-3), "no link can make a step", "omega.max"),
    "steady_volts": (altered(volts=1.9 * steady_volts(LINKED)), "steady drive", "volts"),
    "ramp_volts": (
        # Twelve stages pass the way in on, each steeper than the next: the drive overshoots.
        altered(chain_length=12, cols=12, f0_hz=260.0, volts=4 * steady_volts(LINKED)),
        "the way in needs",
        "volts",
    ),
    "lam_max": (altered(lam=(0.0, 0.5)), "its links must reach", "range of lam"),
    "lam_min": (altered(lam=(0.2, 5.0)), "its links must reach", "range of lam"),
}


@pytest.mark.parametrize("case", LACKING)
def test_what_is_lacking_is_named(case: str) -> None:
    device, symptom, cure = LACKING[case]
    band = choose_band(device, 60.0 if case == "step_contrast" else 20.0)
    assert symptom in band.lacking
    assert cure in band.lacking.split("it lacks", 1)[1]
    assert "\n" not in band.lacking
    # There is a band all the same, for the nearest that can be made.
    assert band.omega == device.omega.max
    assert band.ramp_s == LONGEST_RAMP_S


def test_links_that_cannot_follow_a_change() -> None:
    """Steps that can be held, but not reached in the time: little detuning, much damping, or much contrast."""
    cases = [(altered(f0_hz=5000.0, omega=(0.9, high)), 20.0) for high in np.arange(1.03, 1.12, 0.01)]
    cases += [(altered(delta=0.05), 20.0), (LINKED, 30.0)]
    found = {choose_band(device, contrast_db).lacking for device, contrast_db in cases}
    assert any("cannot follow" in lacking and "omega.max" in lacking for lacking in found)


@pytest.mark.parametrize("case", ["slow", "steady_volts", "ramp_volts", "lam_max", "lam_min", "step"])
def test_giving_what_is_lacking_helps(case: str) -> None:
    device, _, cure = LACKING[case]
    given: dict[str, dict[str, Any]] = {
        "volts": {"volts": 2 * device.amplifier.volts},
        "range of lam": {"lam": (0.0, 1.0)},
        "omega.max": {"omega": (0.9, 1.35)},
    }
    helped = altered(device, **given[cure])
    after = choose_band(helped, 20.0)
    assert cure not in after.lacking


def test_a_single_actuator_needs_no_detuning() -> None:
    """At its resonance a driven actuator is slow, but nothing else hangs on it."""
    single = load_device("independent-6x6")
    assert single.coupling == Coupling(scope="none")
    band = choose_band(altered(single, omega=(0.999, 1.001)), 20.0)
    assert band.floor == 0.0
    assert band.ramp_s == LONGEST_RAMP_S


def test_more_contrast_costs_the_deeper_floor() -> None:
    """At 26 dB no links can idle at half the floor, but all at the floor they can."""
    assert choose_band(LINKED, 20.0).lower == 0.5
    band = choose_band(LINKED, 26.0)
    assert band.lacking == ""
    assert band.lower == 1.0


@pytest.mark.parametrize("changes", [{"chain_length": 2}, {"chain_length": 3}, {"f0_hz": 250.0, "chain_length": 2}])
def test_short_chains_take_the_time_they_need(changes: dict[str, Any]) -> None:
    band = choose_band(altered(**changes), 20.0)
    assert band.lacking == ""
    assert band.ramp_s <= LONGEST_RAMP_S
