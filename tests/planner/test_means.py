"""Scenes of dots on devices whose actuators differ: judged by what was wished, and never worse for a stated spread."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Device, Outcome, load_device
from chainsim.model.calibrated import ActuatorSpread
from encoders import Frame, GridShape, Scene, TargetPattern, TextOptions, TextSource, encode_text
from planner import FramePlan, FrameWish, Plan, YieldError, plan_scene
from planner.closed_forms.links import drive_for, links_for
from planner.means import Means
from planner.operating_point import OperatingPoint
from planner.robustness.dot_search import DotSearch
from planner.robustness.expected import Expectation
from planner.robustness.robust_aim import aim_for
from planner.robustness.robust_search import Trial
from planner.robustness.spread import THRESHOLD, TOLERANCE, FrameTarget, RelativeSpread, drawn_in, motion_of
from planner.targets import DotGoal
from planner.unequal import memory_of

LINKED, SINGLE, PAPER = (load_device(name) for name in ("linked-6x6", "independent-6x6", "paper-6x6"))
GOAL = DotGoal(12.0, 2.0, 10.0)


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path))


def spread(device: Device, frequency: float) -> Device:
    return device.model_copy(update={"spread": ActuatorSpread(frequency=frequency)})


def hello(device: Device, words: str = "Hello", **asked: float) -> Plan:
    scene = encode_text(TextSource.of_text(words), GridShape(device.rows, device.cols), TextOptions())
    return plan_scene(scene, device, **asked)


def truly(frame: FramePlan, frequency: float) -> tuple[float, float]:
    """On devices that no plan was made for: the share that is ok, and the share with no wrong dot."""
    parts = drawn_in(LINKED, RelativeSpread(f0=frequency), range(6), count=2000, seed=77)
    motion = motion_of(frame.states, parts)
    felt = np.where(motion.escaped, np.nan, np.abs(motion.phasor) / LINKED.full_scale).transpose(2, 1, 0)
    assert frame.wish is not None
    verdict = frame.wish.verdict(felt)
    return verdict.share, float(verdict.right.mean())


def contrast_of(frame: FramePlan) -> float:
    assert frame.wish is not None
    found = frame.wish.verdict(np.array([state.target for state in frame.states])).contrast_db
    assert found is not None
    return float(found)


@pytest.mark.parametrize("frequency", [0.001, 0.003])
def test_a_spread_that_the_plain_plan_bears_changes_nothing(frequency: float) -> None:
    plain, aimed = (next(iter(hello(device).frames)) for device in (LINKED, spread(LINKED, frequency)))
    for one, other in zip(plain.states, aimed.states, strict=True):
        np.testing.assert_array_equal(one.lam, other.lam)
        assert one.epsilon == other.epsilon
    assert contrast_of(aimed) == pytest.approx(20, abs=0.01)


@pytest.mark.parametrize(("frequency", "ok", "right"), [(0.01, 0.90, 0.97), (0.03, 0.05, 0.35)])
def test_a_stated_spread_serves_the_wish(frequency: float, ok: float, right: float) -> None:
    """By default 72 % of devices are ok at 1 %, and 21 % have no wrong dot at 3 %; once a spread made that worse."""
    plain, aimed = (next(iter(hello(device).frames)) for device in (LINKED, spread(LINKED, frequency)))
    assert aimed.outcome is Outcome.OK
    before, after = truly(plain, frequency), truly(aimed, frequency)
    assert after[0] >= before[0] + 0.04
    assert after[1] >= before[1] + 0.04
    assert after[0] >= ok
    assert after[1] >= right
    # Nothing of it is bought with the device as it is said to be.
    assert contrast_of(aimed) >= 12
    assert aimed.error < 1e-3
    assert aimed.spread is not None
    assert aimed.spread.yield_ == pytest.approx(after[0], abs=0.04)
    assert aimed.spread.tried[0].share == pytest.approx(before[0], abs=0.04)
    assert aimed.spread.yield_ == max(one.share for one in aimed.spread.tried)


@pytest.mark.slow
def test_the_search_ends_at_the_yield_that_is_asked_for() -> None:
    device = spread(LINKED, 0.01)
    counts = []
    for asked in (0.5, 0.8, 0.999):
        frame = next(iter(hello(device, yield_=asked).frames))
        assert frame.spread is not None
        shares = [one.share for one in frame.spread.tried]
        assert all(share < asked for share in shares[:-1])
        counts.append(len(shares))
    assert counts[0] == 1
    assert counts[0] < counts[1] < counts[2]


@pytest.mark.slow
def test_every_page_of_a_text_can_still_be_reached() -> None:
    device = spread(LINKED, 0.01)
    plain, aimed = (list(hello(one, "Hello my dear").frames) for one in (LINKED, device))
    assert [frame.outcome for frame in aimed] == [Outcome.OK] * len(plain)
    assert len(aimed) == len(plain)


def test_dots_that_no_way_leads_to_are_aimed_at_as_wished(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steeper steps take more volts on the way in than there are: the frame is made as without a spread."""

    device = spread(LINKED, 0.01)
    frame = Frame(TargetPattern(np.array([[1, 0, 1, 0, 1, 0.0]] * 6, dtype=np.complex128)), 1.0)
    means = Means(memory_of(device, 20.0), DotGoal(12.0, 4.0, 1e3))
    change = means.change(means.memory.at_rest, frame)
    assert change.made
    np.testing.assert_allclose(change.states[0].target, change.targets[0].levels)


def test_fewer_draws_lose_a_dot_than_under_the_wished_amplitudes() -> None:
    device, target = spread(LINKED, 0.01).alone(0), np.array([0.1, 1.0, 0.1, 1.0, 0.1, 0.1])
    aim = aim_for(device, target, 1.35, 6, GOAL)
    wish = FrameTarget(target[None] + 0j, device.full_scale)
    trial = Trial(device.chain, wish, RelativeSpread(f0=0.01), TOLERANCE, THRESHOLD, 2000, 99)
    search = DotSearch(device, trial, GOAL)

    def lost(levels: NDArray[np.float64]) -> float:
        amplitude = levels * device.full_scale
        lam = links_for(device.chain, amplitude, 1.35)
        return search.cost(
            search.row(OperatingPoint(float(drive_for(device.chain, amplitude[:1], 1.35)[0]), lam, 1.35))
        )

    assert lost(aim) < 0.6 * lost(target)
    assert aim[target == 1].max() <= GOAL.loudest * 1.02
    assert (aim[1:] / aim[:-1]).max() <= GOAL.steepest * 1.02


def test_the_search_for_dots_knows_its_slopes() -> None:
    device, target = spread(LINKED, 0.01).alone(0), np.array([0.1, 1.0, 0.1, 1.0, 1.0, 0.1])
    wish = FrameTarget(target[None] + 0j, device.full_scale)
    trial = Trial(device.chain, wish, RelativeSpread(f0=0.01), TOLERANCE, THRESHOLD, 10, 0)
    search = DotSearch(device, trial, DotGoal(12.0, 1.05, 8.0))
    amplitude = 1.2 * target * device.full_scale
    start = OperatingPoint(
        float(drive_for(device.chain, amplitude[:1], 1.35)[0]), links_for(device.chain, amplitude, 1.35), 1.35
    )
    x, h = search._logs(start), 1e-6
    _, slope = search._expected(x, start)
    for d in range(len(x) - 1):
        step = h * (np.arange(len(x)) == d)
        ends = [search._expected(x + sign * step, start)[0] for sign in (1, -1)]
        assert slope[d] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("device", [SINGLE, PAPER], ids=lambda device: device.name)
def test_devices_that_bear_it_are_planned_as_they_were(device: Device) -> None:
    plain, aimed = (next(iter(hello(one).frames)) for one in (device, spread(device, 0.01)))
    for one, other in zip(plain.states, aimed.states, strict=True):
        np.testing.assert_array_equal(one.bias, other.bias)
        assert one.epsilon == other.epsilon
    assert aimed.spread is not None
    assert aimed.spread.yield_ == 1.0


@pytest.mark.slow
def test_a_contrast_that_is_asked_for_is_what_devices_must_keep() -> None:
    device = spread(LINKED, 0.003)
    shares = []
    for contrast_db in (12.0, 18.0):
        frame = next(iter(hello(device, contrast_db=contrast_db).frames))
        assert frame.spread is not None
        assert frame.spread.least_db == contrast_db
        assert contrast_of(frame) >= contrast_db - 0.01
        shares.append(frame.spread.tried[0].share)
        assert frame.spread.yield_ > shares[-1] + 0.1
    # A plan that is made for just the contrast that is asked for is missed by about half of the devices.
    assert max(shares) < 0.7


@pytest.mark.parametrize(
    ("device", "asked", "said"),
    [
        (LINKED, 0.9, "says nothing of how its actuators differ; give it a spread"),
        (spread(LINKED, 0.01), 0.0, "expected a share above 0 and at most 1"),
        (spread(LINKED, 0.01), 1.5, "expected a share above 0 and at most 1"),
    ],
)
def test_a_yield_that_is_none_is_refused(device: Device, asked: float, said: str) -> None:
    with pytest.raises(YieldError, match=said):
        hello(device, yield_=asked)


def test_a_frame_is_kept_by_the_same_devices_every_time() -> None:
    device = spread(LINKED, 0.01)
    frame = next(iter(hello(device).frames))
    assert frame.frame is not None
    scene = Scene(GridShape(6, 6), [frame.frame, frame.frame])
    again = list(plan_scene(scene, device).frames)
    assert frame.spread is not None
    for one in again[:2]:
        assert one.spread is not None
        np.testing.assert_array_equal(one.spread.devices, frame.spread.devices)
    assert isinstance(frame.wish, FrameWish)
    assert Expectation(device).wanted == 0.9
