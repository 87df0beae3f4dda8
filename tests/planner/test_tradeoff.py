"""Speed against accuracy: errors against known answers, estimates that bound them, choices, and complaints."""

import itertools
import json
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from chainsim import RUNGS, Chain, Outcome, Rung, Setting, Stats, balance_near, load_device, solve
from encoders import Frame, GridShape, Scene, TextOptions, TextSource, encode_text, levels
from planner import FramePlan, PointTone, plan_scene
from planner.analysis.climbing import _ladder, climb
from planner.analysis.questions import (
    FINEST,
    TOLS,
    Question,
    TradeoffError,
    answer,
    felt,
    questions_of,
    refusal,
    seconds_words,
)
from planner.analysis.requirement import Requirement, Term
from planner.analysis.tradeoff import LONG_S, Tradeoff, TradeoffRow, by_clock, trade_off

SHAPE = GridShape(6, 6)


def frames_of(text, name):
    device = load_device(name)
    return list(plan_scene(encode_text(TextSource.of_text(text), SHAPE, TextOptions()), device).frames), device


def priced(frames, device, prices=None):
    """The trade-off at given prices: without any, each row costs a millisecond more than the one before it."""
    costs = itertools.count(1e-3, 1e-3) if prices is None else iter(prices)
    return trade_off(frames, device, price=lambda run: (run(), next(costs)))


@pytest.fixture(scope="module")
def single():
    return priced(*frames_of("a", "independent-6x6"))


@pytest.fixture(scope="module")
def still():
    return priced(*frames_of("a", "paper-6x6"))


def row_of(found, rung, tol=None):
    return next(row for row in found.rows if (row.rung, row.tol) == (rung, tol))


def test_errors_are_those_of_the_closed_forms(single):
    device = load_device("independent-6x6")
    frames, _ = frames_of("a", "independent-6x6")
    state = next(state for state in frames[0].states if state.moving)
    linear = abs(state.epsilon / (1 - state.omega**2 + 1j * device.delta * state.omega))
    # The same phase to first order, so that the distance is that of the amplitudes.
    away = abs(linear - abs(state.phasor[0])) / abs(state.phasor[0])
    assert row_of(single, "linear").error == pytest.approx(away, rel=1e-2)
    # Physics.md section 5: the third harmonic is beta a^2/32 of the first at resonance, and acts back by less.
    assert 1e-9 < row_of(single, "one_harmonic").error < abs(device.beta) * device.full_scale**2 / 32
    assert row_of(single, "harmonic_balance", 1e-9).error < 1e-9
    assert single.reference_error < 1e-9


def test_estimates_bound_the_errors_and_tolerances_are_kept(single, still):
    for found in (single, still):
        for row in found.rows:
            assert row.error <= row.estimate + found.reference_error, row
            assert row.solved == 1
            if row.rung == "auto":
                assert row.error <= row.tol


@pytest.mark.parametrize("device", ["linked-6x6", "paper-6x6", "independent-6x6"])
def test_auto_asks_only_what_the_scene_asks(device):
    """It does at most twice the work of the cheapest rung that meets the tolerance, and starts no integration."""
    questions, _ = questions_of(*frames_of("Hello world", device))
    for question, tol in itertools.product(questions, TOLS):
        tried = [rung for rung in RUNGS if rung != "ode" and not refusal(rung, question)]
        truth = felt(answer(tried[-2] if "envelope" in tried else tried[0], FINEST, question), question)
        size = np.abs(truth).max(axis=1)

        def met(found, question=question, truth=truth, size=size, tol=tol):
            return (np.abs(felt(found, question) - truth).max(axis=1) <= tol * size).all()

        cheapest = next(found for rung in tried if met(found := answer(rung, tol, question)))
        auto = answer("auto", tol, question)
        assert met(auto)
        assert auto.stats.rhs_evals == auto.stats.periods == 0
        assert auto.stats.oscillators_solved <= 2 * cheapest.stats.oscillators_solved
        # One that is met by less than its own estimate says may take the next.
        assert auto.stats.newton_steps <= max(2 * cheapest.stats.newton_steps, 20 * len(question.setting))


def test_work_grows_along_the_ladder(single):
    steps = [
        row_of(single, rung, tol).work for rung, tol in (("linear", None), ("harmonic_balance", 1e-9), ("ode", 1e-9))
    ]
    assert steps[0].newton_steps == 0 < steps[1].newton_steps
    assert steps[1].rhs_evals == 0 < steps[2].rhs_evals


def test_rows_carry_their_price_and_long_ones_are_not_watched(single):
    assert [row.seconds for row in single.rows] == pytest.approx([1e-3 * (at + 1) for at in range(len(single.rows))])
    assert all(row.memory > 0 for row in single.rows)
    frames, device = frames_of("a", "independent-6x6")
    dear = priced(frames, device, itertools.repeat(1.01 * LONG_S))
    assert all(row.memory is None for row in dear.rows)


def test_choices_on_a_scene_follow_the_prices(single):
    names = [(row.rung, row.tol) for row in single.rows]
    assert names[:3] == [("linear", None), ("one_harmonic", None), ("harmonic_balance", 1e-2)]
    chosen = single.cheapest(1e-3)
    assert (chosen.row.rung, chosen.met) == ("one_harmonic", True)
    # In two milliseconds only the first two rows are ready; in the third the next is.
    assert [single.within(1e-3 * (at + 0.5)).row.rung for at in (1, 2, 3)] == [
        "linear", "one_harmonic", "harmonic_balance",
    ]  # fmt: skip
    # At prices the other way round the first row is the dearest, and the last of all serves both.
    frames, device = frames_of("a", "independent-6x6")
    turned = priced(frames, device, [1e-3 * (len(names) - at) for at in range(len(names))])
    assert turned.cheapest(1e-3).row == turned.within(1.5e-3).row == turned.rows[-1]


def test_the_price_by_the_clock_is_the_best_of_a_few_runs():
    runs = itertools.count()

    def run() -> list[int]:
        return [next(runs)]

    for spent, price, made in (((0.2, 0.1, 0.3), 0.1, 3), ((0.1, 5.0, 0.05), 0.05, 3), ((9.0,), 9.0, 1)):
        readings = iter([each for long in spent for each in (100.0, 100.0 + long)])
        before = next(runs)
        answers, seconds = by_clock(run, partial(next, readings))
        assert seconds == pytest.approx(price)
        assert answers == [before + made]
        assert next(readings, None) is None


def test_equal_chains_are_compared_once(single, still):
    assert single.states == 1
    assert row_of(single, "linear").work.oscillators_solved == 1
    frames, device = frames_of("a", "paper-6x6")
    assert still.states == len({state.bias.tobytes() for state in frames[0].states if state.bias.any()})
    questions, skipped = questions_of(frames * 3, device)
    assert (sum(len(one.setting) for one in questions), skipped) == (still.states, 0)


def test_what_stands_still_needs_no_harmonics(still):
    assert {row.rung for row in still.rows} == {"static", "linear", "ode", "auto"}
    assert set(still.refused) == {"one_harmonic", "harmonic_balance", "envelope"}
    assert row_of(still, "static").error < 1e-10
    assert "static" in {row.rung for row in still.front}


def test_vibrations_beside_deflections_are_one_scene():
    moving, device = frames_of("a", "independent-6x6")
    still = moving[0].states[-1]
    setting = Setting.of(device.chain, epsilon=0.0, lam=0.0, omega=1.0, bias=[0.03])
    mean = solve(device.chain, setting, tol=1e-9, start="rest").mean[0]
    bent = replace(still, bias=np.array([0.03]), mean=mean)
    mixed = replace(moving[0], states=(*moving[0].states[:-1], bent))
    found = trade_off([mixed], device)
    assert found.states == 2
    assert set(found.refused) == {"static"}
    assert row_of(found, "harmonic_balance", 1e-9).error < 1e-9


def test_a_sudden_drive_may_lead_elsewhere():
    frames, device = frames_of("Hi there", "linked-6x6")
    questions, _ = questions_of(frames, device)
    ode = answer("ode", 1e-6, questions[0])
    lost = np.array([outcome is not Outcome.OK for outcome in ode.outcome])
    near = balance_near(questions[0].chain, questions[0].setting, questions[0].planned, tol=1e-9)
    assert all(outcome is Outcome.OK for outcome in near.outcome)
    assert np.abs(felt(near, questions[0]) - questions[0].planned).max() < 1e-6 * device.full_scale
    assert 0 <= lost.sum() < len(lost)


def rows(*values):
    made = [TradeoffRow(str(at), None, error, error, seconds, 1, Stats(), solved) for at, (seconds, error, solved) in
            enumerate(values)]  # fmt: skip
    return Tradeoff("made up", 1, "itself", 0.0, tuple(made), {})


MADE = rows((1e-3, 1e-1, 1), (2e-3, 1e-3, 1), (3e-3, 1e-2, 1), (1e-2, 1e-6, 1), (2e-2, 1e-9, 0.5), (1e-1, 1e-6, 1))


def test_the_front_has_what_no_other_beats():
    assert [row.rung for row in MADE.front] == ["0", "1", "3"]


@pytest.mark.parametrize(
    ("budget_s", "rung", "met"), [(1e-2, "3", True), (9e-3, "1", True), (1.0, "3", True), (1e-4, "0", False)]
)
def test_the_best_in_a_time(budget_s, rung, met):
    choice = MADE.within(budget_s)
    assert (choice.row.rung, choice.met) == (rung, met)
    assert seconds_words(choice.row.seconds) in choice.sentence
    assert ("none" in choice.sentence) is not met


@pytest.mark.parametrize(
    ("tol", "rung", "met"), [(0.5, "0", True), (5e-3, "1", True), (1e-6, "3", True), (1e-7, "3", False)]
)
def test_the_cheapest_to_a_tolerance(tol, rung, met):
    choice = MADE.cheapest(tol)
    assert (choice.row.rung, choice.met) == (rung, met)
    assert f"{choice.row.error:.1e}" in choice.sentence


HARD = Chain(3, 0.05, -1.0)


class Newcomer(Rung):
    """A rung of another package: stands between others, and says all that is to be known of it."""

    name, order, valid, models = "newcomer", "none", "never", frozenset({"nonlinearity"})

    def refusal(self, chain, setting, start):
        return ""

    def steady(self, chain, setting, *, tol, start):
        raise NotImplementedError


def test_a_new_rung_is_an_entry(monkeypatch):
    known = dict(RUNGS)
    question = Question(HARD, Setting.of(HARD, epsilon=1e-3, lam=0.2, omega=1.1), np.ones((1, HARD.n), complex))
    before = _ladder(question, 1e-3)
    assert [rung for rung, _ in before] == ["linear", "one_harmonic", "harmonic_balance", "ode"]
    try:
        RUNGS.clear()
        RUNGS.update({"static": known["static"], "linear": known["linear"], "newcomer": (__name__, "Newcomer")} | known)
        monkeypatch.setitem(sys.modules, __name__, sys.modules[__name__])
        assert _ladder(question, 1e-3) == [before[0], ("newcomer", 1.0), *before[1:]]
        still = Question(HARD, Setting.of(HARD, epsilon=0, lam=0.2, omega=1.1), np.ones((1, HARD.n), complex))
        assert refusal("newcomer", still) == "nothing vibrates; static is exact"
        terms = tuple(Term(name, 0.0, name == "nonlinearity", "", 0) for name in ("nonlinearity", "preload"))
        assert Requirement("made", 1e-2, terms, 0.0, True, 1, 1).rung == "newcomer"
        needs_more = tuple(replace(term, included=True) for term in terms)
        assert Requirement("made", 1e-2, needs_more, 0.0, True, 1, 1).rung == "harmonic_balance"
        assert Requirement("made", 1e-2, terms, 0.0, False, 1, 1).rung == "static"
    finally:
        RUNGS.clear()
        RUNGS.update(known)


def test_climbing_stops_at_the_first_that_will_do():
    question = questions_of(*frames_of("a", "independent-6x6"))[0][0]
    truth = felt(answer("harmonic_balance", 1e-12, question), question)
    for tol, rung in ((1e-2, "linear"), (1e-4, "one_harmonic"), (1e-9, "harmonic_balance")):
        found, words = climb(question, tol=tol)
        assert found.rung == rung
        assert np.abs(felt(found, question) - truth).max() <= tol * np.abs(truth).max()
        assert words.endswith("met")
        assert "not met" not in words


@pytest.mark.parametrize(
    # A step takes 1 s, and the choice of it another: the next is tried while ten times the last one is left.
    ("budget_s", "rung", "spent", "verdict"),
    [(1e-9, "linear", 4, "not met"), (12.9, "linear", 4, "met"), (13.1, "one_harmonic", 6, "met"),
     (1e3, "harmonic_balance", None, "met")],
)  # fmt: skip
def test_climbing_keeps_to_the_time(budget_s, rung, spent, verdict):
    question = questions_of(*frames_of("a", "independent-6x6"))[0][0]
    seconds = itertools.count()
    found, words = climb(question, budget_s=budget_s, clock=lambda: float(next(seconds)))
    assert found.rung == rung
    assert spent is None or f" in {spent} s" in words
    assert words.endswith(f"; budget {seconds_words(budget_s)} {verdict}")


def test_plain_json(single):
    found = json.loads(json.dumps(single.as_dict(), allow_nan=False))
    assert found["device"] == "independent-6x6"
    assert [row["front"] for row in found["rows"]].count(True) == len(single.front)
    assert set(found["rows"][0]["work"]) == {"rhs_evals", "newton_steps", "oscillators_solved", "periods"}


@pytest.mark.parametrize(
    ("seconds", "words"), [(2.0, "2 s"), (0.05, "50 ms"), (2.5e-4, "250 us"), (1e-3, "1 ms"), (123.4, "123 s")]
)
def test_times_in_words(seconds, words):
    assert seconds_words(seconds) == words


def test_complaints():
    device = load_device("paper-6x6")
    silent = Scene(SHAPE, (Frame(levels(np.zeros((6, 6))), 1.0),))
    frames = list(plan_scene(silent, device).frames)
    with pytest.raises(TradeoffError, match="nothing is felt"):
        trade_off(frames, device)
    moving, single = frames_of("a", "independent-6x6")
    beating = [replace(one, tones=(PointTone(1.1, 1e-3 + 0j, np.array([1e-2 + 0j])),)) for one in moving[0].states]
    with pytest.raises(TradeoffError, match="several tones"):
        trade_off([FramePlan(moving[0].frame, 0.0, 0.1, 1.0, tuple(beating), (None,) * 36)], single)
    with pytest.raises(TradeoffError, match="budget: expected a number > 0, got 0"):
        MADE.within(0.0)
    with pytest.raises(TradeoffError, match="tol: expected a number > 0, got nan"):
        MADE.cheapest(float("nan"))
    question = questions_of(moving, single)[0][0]
    assert isinstance(question, Question)
    with pytest.raises(TradeoffError, match="either a tolerance or a budget"):
        climb(question)
    with pytest.raises(TradeoffError, match="tol: expected"):
        climb(question, tol=-1.0)
    assert "vibration" in refusal("static", question)
