"""The pages that tell most of a device: the shortest list after which any page is expected to be right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome
from encoders import TargetPattern

from ..memory import Memory
from .device_estimate import DeviceEstimate, EstimateError
from .stages import ChainEstimate, ChainPage, SensorNoise

__all__ = ["MOST_PAGES", "PageChoice", "choose_pages", "expected_error"]

Floats = NDArray[np.float64]

# As many pages as are chosen at most, and as many as they are chosen from.
MOST_PAGES, CANDIDATES = 16, 63
SEED = 1


@dataclass(frozen=True)
class PageChoice:
    """Pages to show one after another; all chains show the same.

    Attributes
    ----------
    levels : float64, shape (pages, n), what every chain shows, in units of full scale.
    expected : float64, shape (pages + 1,), the error expected of a page before them and after each, in units of full
        scale: of the largest at any actuator of a chain the mean over all pages that were chosen from.
    """

    levels: Floats
    expected: Floats


def choose_pages(device: Device, noise: SensorNoise, goal: float, *, contrast_db: float) -> PageChoice:
    """Each next page is the one after which the expected error of all pages is least.

    It ends when that is `goal` or less, after `MOST_PAGES`, or when no page makes it less. It is worked out for the
    profile's own numbers and spread, with phases measured; what single actuators are makes little difference to it.

    Parameters
    ----------
    goal : in units of full scale.
    contrast_db : as in `plan_scene`.

    Raises
    ------
    EstimateError
        When the device can make no page, or its chains are rings.
    """
    alone = _alone(device)
    (estimate,) = DeviceEstimate.of(alone).chains
    levels, pages = _candidates(alone, contrast_db)
    chosen, expected = list[int](), [_expected(estimate, pages, device.full_scale)]
    while expected[-1] > goal and len(chosen) < MOST_PAGES:
        after = [estimate.after(page, noise) for page in pages]
        errors = [_expected(one, pages, device.full_scale) for one in after]
        best = int(np.argmin(errors))
        if errors[best] >= expected[-1]:
            break
        chosen.append(best)
        expected.append(errors[best])
        estimate = after[best]
    return PageChoice(levels[chosen], np.array(expected))


def expected_error(estimate: DeviceEstimate, *, contrast_db: float) -> float:
    """The error expected of any page as far as the device is known: as `PageChoice.expected`, mean over chains too.

    Raises
    ------
    EstimateError
        When the device can make no page.
    """
    alone = _alone(estimate.device)
    _, pages = _candidates(alone, contrast_db)
    return float(np.mean([_expected(chain, pages, alone.full_scale) for chain in estimate.chains]))


def _alone(device: Device) -> Device:
    """One chain of the device, as the profile has it."""
    return device.model_copy(update={"rows": 1, "cols": device.chain_length, "actuators": ()})


def _candidates(device: Device, contrast_db: float) -> tuple[Floats, list[ChainPage]]:
    """On/off pages that one chain can make, with what it is set to for each and how it then moves."""
    n = device.chain_length
    if 2**n - 1 <= CANDIDATES:
        wanted = np.array(list(product((0.0, 1.0), repeat=n)))[1:]
    else:
        drawn = np.random.default_rng(SEED).integers(0, 2, (CANDIDATES - 1, n))
        wanted = np.unique(np.concatenate([np.ones((1, n)), drawn[drawn.any(axis=1)]]), axis=0)
    memory = Memory(device, contrast_db)
    targets = [memory.hold(TargetPattern(one[None].astype(np.complex128)), memory.at_rest)[0] for one in wanted]
    states = memory.states(targets)
    made = [at for at, state in enumerate(states) if state.outcome is Outcome.OK and state.epsilon and not state.tones]
    if not made:
        lacking = next((state.lacking for state in states if state.lacking), "no page moves its actuators")
        raise EstimateError(f"{device.name} can show no page to be identified by: {lacking}")
    pages = [
        ChainPage(abs(state.epsilon), state.lam, state.omega, state.phasor * np.exp(-1j * np.angle(state.epsilon)))
        for state in (states[at] for at in made)
    ]
    return wanted[made], pages


def _expected(estimate: ChainEstimate, pages: Sequence[ChainPage], full_scale: float) -> float:
    """Mean over pages of the largest expected deviation at any actuator, in units of full scale."""
    worst = [float(np.max(np.abs(page.phasor) * estimate.expected(page))) for page in pages]
    return float(np.mean(worst)) / full_scale
