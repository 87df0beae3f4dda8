"""The harness around the measurements: the problem, the count of errors, the picture and the words."""

import importlib.util
import json
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


FOUND = {
    "load_before": 0.1, "load_after": 0.2,
    "steady": {"settings": 100, "wall_s": 0.01, "cpu_s": 0.02, "largest_error": 1e-8},
    "one_alone": {"wall_s": 1e-3, "cpu_s": 1e-3},
    "transients": [{"steps": 6, "chain_periods_per_s": 2e7, "median_error": 1.1e-6, "share_of_limit": 0.7}],
    "lengths": {"n": [1000, 10_000], "wall_s": [1e-3, 1e-2], "slope": 1.0},
    "peers": {
        "scipy": {"reached": True, "transient_ratio": 1e4, "steady_ratio": 1e6, "extrapolated": True},
        "slow": {"reached": False, "transient_ratio": 10.0, "steady_ratio": 1e3, "extrapolated": True},
        "points": {"steady_ratio": 3e3, "extrapolated": False},
        "absent": {"missing": "not installed"},
    },
}  # fmt: skip


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
    words = [each.text for each in picture.iter("{http://www.w3.org/2000/svg}text")]
    for word in ("scipy", "absent", "not installed", "1e+04", "10"):
        assert word in words, word
    bars = [float(each.get("width")) for each in picture.iter("{http://www.w3.org/2000/svg}rect") if each.get("x")]
    assert bars[0] == 4 * bars[1]


def test_the_report_says_what_is_missing_and_what_is_not_equal(tmp_path):
    report = BenchReport(FOUND, tmp_path)
    words = report.as_text()
    assert "absent: missing: not installed" in words
    assert "points: 3e+03 times to a steady state\n" in words
    assert "10 times slower in transients (does not reach our error)" in words
    assert json.loads(json.dumps(report.as_dict())) == FOUND


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
