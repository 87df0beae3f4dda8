"""The harness around the measurements: the problem, the count of errors, the picture and the words."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from dotwave.bench import BenchReport, run_bench
from dotwave.errors import AppError

FOLDER = Path(__file__).resolve().parent.parent / "benchmarks"


def module(name):
    spec = importlib.util.spec_from_file_location(f"benchmarks_{name}", FOLDER / f"{name}.py")
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


GROWTH = {"n": [1000, 10_000], "cpu_s": [1e-3, 1e-2], "bytes": [1e5, 1e6], "outcome": ["ok", "ok"],
          "slope": 1.0, "memory_slope": 0.99}  # fmt: skip
PEERS = {
    "scipy DOP853": {"reached": True, "transient_ratio": 1e4, "steady_ratio": 1e6, "extrapolated": True},
    "heyoka batch 8": {"reached": False, "transient_ratio": 10.0, "steady_ratio": 1e3, "extrapolated": True},
    "AUTO-07p": {"steady_ratio": 3e3, "extrapolated": False},
    "pyHarm-os": {"missing": "not installed"},
    "numbalsoda dop853": {"missing": "not installed either"},
}
FOUND = {
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
    for word in ("scipy DOP853", "pyHarm-os", "not installed", "1e+04", "10", "grid: n^1.30, 0.01 s at 10,000"):
        assert word in words, word
    bars = [float(each.get("width")) for each in picture.iter(f"{space}rect") if each.get("x")]
    assert bars[0] == 4 * bars[1]
    first, second = (each.get("points").split() for each in list(picture.iter(f"{space}polyline"))[:2])
    assert len(first) == len(second) == 2


def test_the_report_says_what_is_missing_and_what_is_not_equal(tmp_path):
    report = BenchReport(FOUND, tmp_path)
    words = report.as_text()
    assert "pyHarm-os: missing: not installed" in words
    assert "AUTO-07p: 3e+03 times to a steady state\n" in words
    assert "10 times slower in transients (does not reach our error)" in words
    assert "goal, one chain alone: at most 1 ms; 2 ms, NOT reached" in words
    assert "goal, transients: at least 10 M chain-periods/s; 20 M chain-periods/s, reached" in words
    assert "goal, transients against numbalsoda: at least 100 x; not measured" in words
    assert json.loads(json.dumps(report.as_dict())) == FOUND


def test_goals_know_their_sense():
    reached = {each["what"]: each["reached"] for each in FOUND["goals"]}
    assert reached["100,000 steady states"] is True
    assert reached["steady state against heyoka batch"] is False
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
    peers = module("peers")
    monkeypatch.setattr(peers, "PYHARM", tmp_path / "here" / "bin" / "python")
    with pytest.raises(peers.Missing, match=r"venv .*here && .*/bin/pip install pyHarm-os"):
        peers.pyharm(np.zeros((1, 12)), 1e-6)
    sys.modules.pop("problem", None)


def test_outside_a_source_tree(monkeypatch, tmp_path):
    monkeypatch.setattr("dotwave.bench.HARNESS", tmp_path / "harness.py")
    with pytest.raises(AppError, match="source tree"):
        run_bench(tmp_path, quick=True)


def test_a_harness_that_fails_says_why(monkeypatch, tmp_path):
    broken = tmp_path / "harness.py"
    broken.write_text("raise SystemExit('no room')")
    monkeypatch.setattr("dotwave.bench.HARNESS", broken)
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
