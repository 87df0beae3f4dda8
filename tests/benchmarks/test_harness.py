"""The harness around the measurements: the problem, the count of errors, the picture and the words."""

import importlib
import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from dotwave.errors import AppError
from dotwave.studies.bench import BenchReport, run_bench
from tests.support.known import known

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"


def module(name):
    spec = importlib.util.spec_from_file_location(f"benchmarks_{name}", FOLDER / f"{name}.py")
    made = importlib.util.module_from_spec(known(spec))
    known(known(spec).loader).exec_module(made)
    return made


GROWTH = {"n": [1000, 10_000], "cpu_s": [1e-3, 1e-2], "bytes": [1e5, 1e6], "outcome": ["ok", "ok"],
          "slope": 1.0, "memory_slope": 0.99}  # fmt: skip


def integrated(transients, steady, from_rest, reached=True):
    return {
        "transients": {"settings": "lanes 8", "reached": reached, "ratio": transients},
        "steady": {"way": "shooting", "settings": "lanes 16, two steps", "reached": True, "ratio": steady},
        "from_rest": {"periods": 1300, "extrapolated": True, "ratio": from_rest},
    }


PEERS = {
    "SciPy": integrated(1e4, 1e3, 1e6),
    "heyoka": integrated(10.0, 40.0, 2.5e3, reached=False),
    "AUTO-07p": {"steady": {"way": "a point of a branch", "settings": "NTST=8", "reached": True, "ratio": 3e3}},
    "pyHarm-os": {"missing": "not installed"},
    "numbalsoda": {"missing": "not installed either"},
}
FOUND: dict[str, Any] = {
    "quick": False, "load_before": 0.1, "load_after": 0.2,
    "steady": {"settings": 100, "wall_s": 0.01, "cpu_s": 0.02, "largest_error": 1e-8},
    "one_alone": {"wall_s": 2e-3, "cpu_s": 1e-3},
    "transients": [
        {"steps": 5, "chain_periods_per_s": 3e7, "median_error": 1e-5, "share_of_limit": 0.7},
        {"steps": 6, "chain_periods_per_s": 2e7, "median_error": 1.1e-6, "share_of_limit": 0.7},
    ],
    "lengths": {"chain": GROWTH, "grid": GROWTH | {"slope": 1.3}},
    "map": {"settings": 10_000, "wall_s": 2.9, "solved_and_written_s": 1.0},
    "peers": PEERS,
}  # fmt: skip
FOUND["goals"] = module("goals").goals(FOUND)


def test_few_settings_are_the_first_of_many():
    problem = module("problem")
    few, many = problem.settings(5), problem.settings(100)
    for name in ("epsilon", "lam", "omega"):
        assert np.array_equal(getattr(few, name), getattr(many, name)[:5])
    assert many.epsilon.min() > 3e-5
    assert many.epsilon.max() < 6e-4


def test_errors_are_relative_to_each_oscillators_own_radius():
    problem = module("problem")
    wanted = np.array([[3.0, 0.01, 4.0, 0.0]])
    assert problem.states_error(wanted + np.array([[0.0, 0.0, 0.0, 0.001]]), wanted) == pytest.approx([0.1])
    assert problem.states_error(wanted * 1.001, wanted) == pytest.approx([1e-3])


def test_the_picture_shows_every_peer_also_the_missing():
    picture = ElementTree.fromstring(module("chart").draw(FOUND))
    space = "{http://www.w3.org/2000/svg}"
    words = [each.text for each in (*picture.iter(f"{space}text"), *picture.iter(f"{space}tspan"))]
    for word in ("SciPy", "pyHarm-os", "not installed", "1e+04", "10", "40", "grid: n^1.30, 0.01 s at 10,000"):
        assert word in words, word
    bars = [float(each.attrib["width"]) for each in picture.iter(f"{space}rect") if each.get("x")]
    assert bars[0] == 4 * bars[1]
    first, second = (each.attrib["points"].split() for each in list(picture.iter(f"{space}polyline"))[:2])
    assert len(first) == len(second) == 2


def test_the_report_says_what_is_missing_and_what_is_not_equal(tmp_path):
    report = BenchReport(FOUND, tmp_path)
    words = report.as_text()
    assert "pyHarm-os: missing: not installed" in words
    assert "AUTO-07p: 3e+03 times to a steady state, a point of a branch [NTST=8]\n" in words
    assert "heyoka: 10 (does not reach our error) times slower in transients [lanes 8]\n" in words
    assert "heyoka: 40 times to a steady state, shooting [lanes 16, two steps]\n" in words
    assert "heyoka: 2.5e+03 times by 1300 periods from rest (extrapolated)\n" in words
    assert "goal, one chain alone: at most 1 ms; 2 ms, NOT reached" in words
    assert "goal, transients: at least 10 M chain-periods/s; 20 M chain-periods/s, reached" in words
    assert "goal, transients against numbalsoda: at least 100 x; not measured (set against one chain at" in words
    assert "goal, steady state against heyoka: at least 2000 x; 40 x, NOT reached (set against periods" in words
    assert json.loads(json.dumps(report.as_dict())) == FOUND


def test_goals_know_their_sense():
    reached = {each["what"]: each["reached"] for each in FOUND["goals"]}
    assert reached["100,000 steady states"] is True
    assert reached["steady state against heyoka"] is False
    assert reached["steady state against heyoka from rest"] is True
    assert reached["steady state against pyHarm-os, a point"] is None
    assert reached["slope of time, chain to 10^6"] is True
    assert reached["slope of time, grid to 1000 x 1000"] is False
    quick = module("goals").goals(FOUND | {"quick": True})
    assert {each["what"] for each in quick if each["reached"] is None} > {"100,000 steady states"}


def test_the_chain_alone_imports_no_compiler(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    script = module("ours").ALONE.format(folder=str(FOLDER)).replace("range(200)", "range(1)")
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    sys.modules.pop("problem", None)


def test_a_peer_without_its_environment_names_the_command(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(FOLDER))
    peers = module("continuation")
    monkeypatch.setattr(peers, "PYHARM", tmp_path / "here" / "bin" / "python")
    with pytest.raises(peers.Missing, match=r"venv .*here && .*/bin/pip install pyHarm-os"):
        peers.pyharm(1e-6)
    for name in ("problem", "integrators", "chain_rows"):
        sys.modules.pop(name, None)


def test_goals_hold_against_the_quickest_of_all_peers():
    measured = {each["what"]: each["measured"] for each in FOUND["goals"]}
    assert measured["transients against the best peer"] == 10.0
    assert measured["steady state against the best peer"] == 40.0
    assert measured["steady state against SciPy"] == 1e3
    nobody = FOUND | {"peers": {name: {"missing": "none"} for name in PEERS}}
    assert {each["reached"] for each in module("goals").goals(nobody) if "peer" in each["what"]} == {None}
    assert all(each["note"] for each in FOUND["goals"] if "heyoka" in each["what"] and "steady" in each["what"])


@pytest.fixture
def shooting(monkeypatch):
    before = set(sys.modules)
    monkeypatch.syspath_prepend(str(FOLDER))
    yield importlib.import_module("shooting")
    for name in set(sys.modules) - before:
        if (FOLDER / f"{name}.py").exists():
            del sys.modules[name]


def by_hand(shooting):
    """A way that integrates to its own error whatever is asked, by Runge and Kutta."""
    rows, at = importlib.import_module("chain_rows"), 2 * np.pi / 256

    def make(tolerance, size):
        def flow(y, given, periods):
            def slope(phase, now):
                out = np.empty_like(now)
                rows.slope(phase, now, out, given)
                return out

            y = np.array(y)
            for k in range(round(256 * periods)):
                a = slope(k * at, y)
                b = slope((k + 0.5) * at, y + 0.5 * at * a)
                c = slope((k + 0.5) * at, y + 0.5 * at * b)
                y = y + at / 6 * (a + 2 * b + 2 * c + slope((k + 1) * at, y + at * c))
            return y

        return flow

    return importlib.import_module("integrators").Way("by hand", shooting.CHAINS, make)


def test_variations_are_the_derivatives_of_the_end_by_the_start(shooting):
    rows, problem = importlib.import_module("chain_rows"), importlib.import_module("problem")
    flow, given = by_hand(shooting).make(1.0, rows.VARIED), rows.given_of(problem.settings(2), slice(0, 2))
    start = np.random.default_rng(0).uniform(-0.1, 0.1, (2, rows.STATES))
    found = rows.turned(flow(rows.rows_of(start, rows.VARIED), given, 1.0))
    for k in range(rows.STATES):
        step = 1e-5 * np.eye(rows.STATES)[k]
        ends = [rows.states_of(flow(rows.rows_of(start + way * step, rows.STATES), given, 1.0)) for way in (1, -1)]
        np.testing.assert_allclose(found[:, :, k], (ends[0] - ends[1]) / 2e-5, atol=1e-7)


@pytest.mark.slow
def test_shooting_finds_what_a_long_wait_finds(shooting, monkeypatch):
    monkeypatch.setattr(shooting, "TOLERANCES", (1e-6,))
    wanted = module("ours").states_after(shooting.CHAINS, 64, 5000)
    # Runge and Kutta's own error at 256 steps a period, magnified by Q, is 4.5e-6.
    found = shooting.steady_by_shooting([by_hand(shooting)], wanted, 1e-5)
    assert found["reached"]
    assert 1e-7 < found["largest_error"] <= 1e-5
    assert set(found["tried"]) == {f"by hand; {k} Newton steps with variations, {m} with their derivatives kept"
                                   for k, m in shooting.PLANS}  # fmt: skip
    assert 0.5 < found["cold"]["share_found"] <= 1


def test_the_loosest_tolerance_at_equal_error_is_taken(shooting):
    calls, wanted = [], np.ones((shooting.CHAINS, 12))

    def run(tolerance):
        calls.append(tolerance)
        return shooting._Run(1.0, tolerance * wanted)

    found = shooting._loosest("words", run, lambda states: 30 * states[0, 0], 1e-6)
    assert found["reached"]
    assert 30 * found["tolerance"] <= 1e-6 < 30 * found["tolerance"] * 10**0.26
    assert len(calls) <= 6
    lost = shooting._loosest("others", run, lambda states: 1.0, 1e-6)
    assert (lost["reached"], lost["tolerance"]) == (False, shooting.TOLERANCES[-1])
    best = shooting._cheapest([found, lost | {"s_per_chain": 0.1}])
    assert (best["settings"], best["reached"]) == ("words", True)
    assert best["tried"] == {"words": 1.0, "others": 0.1}


def book(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    made = importlib.import_module("book")
    monkeypatch.delitem(sys.modules, "book")
    return made


def test_prose_of_a_page_is_its_blocks_without_listings(monkeypatch):
    prose = book(monkeypatch).Prose()
    prose.feed(
        "<html><head><title>no</title></head><body><h1>A  head</h1><p>some <em>words</em>\nmore"
        "<pre>ls <b>-l</b></pre>after</p><script>x()</script><ul><li>one</li><li>two</li></ul></body></html>"
    )
    blocks = [" ".join(block.split()) for block in prose.blocks if block.strip()]
    assert blocks == ["A head", "some words more", "after", "one", "two"]


def test_a_text_is_measured_by_the_command_itself(monkeypatch):
    made = book(monkeypatch)
    line = made._line("few words", "Hello there", ["-m", "dotwave", "text"], ["--device", "paper-6x6", "--json"])
    assert (line.frames, line.outcomes) == (2, {"ok": 2})
    # The most of all processes that were waited for, those of other tests among them.
    assert line.resident_mb > 0
    coded = made._line("few words", "Hello there", ["-c", made.ENCODED], ["paper-6x6"])
    assert (coded.frames, coded.megabytes) == (2, 11e-6)
    assert "few words" in coded.words(None)


def test_outside_a_source_tree(monkeypatch, tmp_path):
    monkeypatch.setattr("dotwave.studies.bench.HARNESS", tmp_path / "harness.py")
    with pytest.raises(AppError, match="source tree"):
        run_bench(tmp_path, quick=True)


def test_a_harness_that_fails_says_why(monkeypatch, tmp_path):
    broken = tmp_path / "harness.py"
    broken.write_text("raise SystemExit('no room')")
    monkeypatch.setattr("dotwave.studies.bench.HARNESS", broken)
    with pytest.raises(AppError, match="no room"):
        run_bench(tmp_path, quick=True)


@pytest.mark.slow
def test_our_own_measurements_reach_their_accuracy(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    ours = module("ours")
    assert ours.steady(1000, 1)["largest_error"] < 1e-6
    six = ours.transients(128, 1)[0]
    assert six["median_error"] < 1.2e-6
    sys.modules.pop("problem", None)
