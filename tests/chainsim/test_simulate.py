"""Chain files: the exact keys, strict JSON, and complaints that name file, line and field."""

import cmath
import json
import math
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chainsim import ProfileError, RungError, parse_simulation, simulate

KEYS = [
    "outcome", "rung", "phasor", "phase_step_deg", "third", "mean", "stable", "locked", "multipliers", "branch",
    "error_estimate", "stats",
]  # fmt: skip
SPEC: dict[str, Any] = {
    "chain": {"n": 6, "delta": 5.3006e-3, "beta": -1.0, "closure": "open"},
    "setting": {"epsilon": 1.175e-4, "lam": 6.131e-3, "omega": 1.0},
    "rung": "auto",
    "tol": 1e-6,
    "start": "rest",
}
TEXT = """\
chain:   {n: 6, delta: 5.3006e-3, beta: -1.0, closure: open}
setting: {epsilon: 1.175e-4, lam: 6.131e-3, omega: 1.0}
rung: auto
tol: 1.0e-6
start: rest
"""


def test_keys_and_shapes(tmp_path):
    path = tmp_path / "chain.yaml"
    path.write_text(TEXT)
    answer = json.loads(json.dumps(simulate(path), allow_nan=False))
    assert list(answer) == KEYS
    assert answer["outcome"] == "ok"
    assert [len(answer[key]) for key in ("phasor", "third", "mean", "branch", "phase_step_deg", "multipliers")] == [
        6, 6, 6, 6, 5, 12,
    ]  # fmt: skip
    assert answer["stable"] is True
    assert answer["locked"] is True
    assert "seconds" in answer["stats"]
    assert simulate(SPEC)["phasor"] == answer["phasor"]


def test_every_branch():
    spec = {**SPEC, "chain": {"n": 1, "delta": 5e-3, "beta": -1.0}, "start": "all"}
    spec["setting"] = {"epsilon": 1.5e-3, "omega": 0.985}
    answer = simulate(spec)
    assert list(answer) == [*KEYS, "answers", "complete"]
    assert answer["complete"] is True
    assert [list(each) for each in answer["answers"]] == [KEYS] * 3
    assert [each["outcome"] for each in answer["answers"]] == ["ok", "unstable", "ok"]
    assert answer["phasor"] == answer["answers"][0]["phasor"]


def test_what_is_not_known_is_null():
    spec = {**SPEC, "chain": {"n": 1, "delta": 0.05, "beta": -1.0}, "setting": {"epsilon": 5.0, "omega": 1.0}}
    answer = json.loads(json.dumps(simulate(spec), allow_nan=False))
    assert answer["outcome"] == "escaped"
    assert answer["phasor"] == [[None, None]]
    assert answer["error_estimate"] is None
    assert answer["stable"] is False


def test_links_bias_preload_and_phase():
    spec = {**SPEC, "chain": {"n": 3, "delta": 0.05, "beta": 1.0}}
    spec["setting"] = {
        "epsilon": 0.01, "lam": [0.1, 0.2], "omega": 1.2, "preload": 0.01, "bias": [0, 0.1, 0], "phase": 0.5
    }  # fmt: skip
    answer = simulate(spec)
    assert answer["outcome"] == "ok"
    assert answer["mean"][1] == pytest.approx(0.1 / 1.1, rel=0.05)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("delta: 5.3006e-3", "delta: high", "c.yaml:1: chain.delta: expected a number, got 'high'"),
        ("n: 6", "n: 0", "c.yaml:1: chain.n: expected a number >= 1, got 0"),
        ("omega: 1.0", "omega: 0", "c.yaml:2: setting.omega: expected a number > 0"),
        ("lam: 6.131e-3", "lam: [1, 2]", "c.yaml:2: setting: setting.lam: expected a number or a list of 5"),
        ("rung: auto", "rung: magic", "c.yaml:3: rung: expected 'auto', 'static'"),
        ("tol: 1.0e-6", "tol: 0", "c.yaml:4: tol: expected a number >= 1e-12, got 0"),
        ("tol: 1.0e-6\n", "", "tol: this key is required and missing"),
        ("start: rest", "start: jump", "c.yaml:5: start: expected 'rest', 'ramp' or 'all', got 'jump'"),
        ("start: rest", "colour: red", "c.yaml:5: colour: unknown key"),
        ("epsilon: 1.175e-4", "epsilon: .nan", "c.yaml:2: setting.epsilon: expected a finite number"),
    ],
)
def test_complaints_name_the_place(old, new, complaint):
    with pytest.raises(ProfileError) as caught:
        parse_simulation(TEXT.replace(old, new), "c.yaml")
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)


GRID = {"grid": {"rows": 2, "cols": 3}, "delta": 0.05, "beta": -1.0}


def test_a_grid():
    spec = {**SPEC, "chain": GRID, "setting": {"epsilon": 0.01, "lam_x": 0.1, "lam_y": 0.2, "omega": 1.1}}
    answer = simulate(spec)
    assert list(answer) == KEYS
    assert answer["outcome"] == "ok"
    assert len(answer["phasor"]) == 6
    each = {**spec["setting"], "lam_x": [[0.1, 0.1], [0.1, 0.1]], "lam_y": [[0.2, 0.2, 0.2]]}
    assert simulate({**spec, "setting": each})["phasor"] == answer["phasor"]
    # Lower left and upper right differ by the two links; the paths to the lower right end add up.
    assert answer["phasor"][3] != answer["phasor"][1]
    alike = {"epsilon": 0.01, "lam": 0.1, "omega": 1.1}
    assert simulate({**spec, "setting": alike})["phasor"][3] == pytest.approx(
        simulate({**spec, "setting": alike})["phasor"][1]
    )


def test_unequal_oscillators_both_ways_and_amplifiers():
    spec = {**SPEC, "chain": {"n": 3, "delta": [0.05, 0.06, 0.05], "beta": -1.0, "stiffness": [1.0, 1.01, 0.99]}}
    spec["setting"] = {"epsilon": 0.01, "lam": [0.1, 0.2], "omega": 1.1}
    plain, two_way, amplified = (
        simulate({**spec, "chain": {**spec["chain"], **more}})
        for more in ({}, {"closure": "bidirectional"}, {"kind": "amplifier"})
    )
    assert plain["outcome"] == two_way["outcome"] == amplified["outcome"] == "ok"
    assert len({str(answer["phasor"]) for answer in (plain, two_way, amplified)}) == 3


@pytest.mark.parametrize(
    ("chain", "setting", "complaint"),
    [
        ({"delta": 0.1, "beta": -1.0}, {}, "chain: give either n, the length of a chain, or grid"),
        ({**GRID, "n": 6}, {}, "chain: give either n"),
        ({**GRID, "delta": [0.1]}, {}, "chain: chain.delta: expected a number or a list of 6"),
        ({**GRID, "closure": "ring"}, {}, "chain: chain.closure: a grid is open"),
        ({**GRID, "closure": "knot"}, {}, "chain.closure: expected 'open', 'ring' or 'bidirectional', got 'knot'"),
        ({**GRID, "delta": "high"}, {}, "chain.delta: expected a number"),
        ({"n": 6, "delta": 0.1, "beta": -1.0}, {"lam_x": 0.1}, "setting: setting.lam_x, lam_y: these are the links of"),
        (GRID, {"lam_x": [[0.1]]}, "setting: setting.lam_x: expected a number or 2 lists of 2 numbers"),
        (GRID, {"lam": [0.1]}, "setting: setting.lam: a grid takes a number"),
    ],
)
def test_complaints_about_systems(chain, setting, complaint):
    with pytest.raises(ProfileError) as caught:
        simulate({**SPEC, "chain": chain, "setting": {"epsilon": 0.01, "omega": 1.1, **setting}})
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("closure", "count"), [("open", 3), ("ring", 5), ("bidirectional", 5)])
def test_every_branch_of_any_closure(closure, count):
    chain = {"n": 2, "delta": 5.3006e-3, "beta": -1.0, "closure": closure}
    spec = {**SPEC, "chain": chain, "setting": {"epsilon": 4e-3, "lam": 1e-2, "omega": 0.985}, "start": "all"}
    answer = json.loads(json.dumps(simulate(spec), allow_nan=False))
    assert list(answer) == [*KEYS, "answers", "complete"]
    assert answer["complete"] is True
    assert len(answer["answers"]) == count
    assert answer["outcome"] == "ok"
    first = next(each for each in answer["answers"] if each["outcome"] == "ok")
    assert answer["phasor"] == first["phasor"]


def test_every_branch_of_a_grid():
    spec = {**SPEC, "chain": {**GRID, "delta": 5e-3}, "start": "all"}
    spec["setting"] = {"epsilon": 1.5e-3, "lam": 0.0, "omega": 0.985}
    answer = simulate(spec)
    assert answer["complete"] is True
    assert [each["stable"] for each in answer["answers"]] == [True, False, True]


def test_constant_forces_leave_the_list_open():
    spec = {**SPEC, "chain": {"n": 2, "delta": 5e-3, "beta": -1.0, "closure": "ring"}, "start": "all"}
    for closure in ("open", "ring"):
        spec["chain"]["closure"] = closure
        setting = {"epsilon": 4e-3, "lam": 1e-2, "omega": 0.985, "bias": [0.0, 1e-3]}
        assert simulate({**spec, "setting": setting})["complete"] is False


def test_a_motion_that_does_not_lock_says_how_it_beats():
    spec = {**SPEC, "chain": {"n": 3, "delta": 5.3006e-3, "beta": 1.0, "closure": "ring"}}
    spec["setting"] = {"epsilon": 5e-5, "lam": 1e-2, "omega": 1.0}
    answer = json.loads(json.dumps(simulate(spec), allow_nan=False))
    assert list(answer) == [*KEYS, "beat"]
    assert (answer["outcome"], answer["locked"]) == ("not_locked", False)
    assert list(answer["beat"]) == ["omega", "depth", "phasor", "phase_step_deg"]
    assert answer["beat"]["omega"] == pytest.approx(0.016, rel=0.02)
    assert len(answer["beat"]["phase_step_deg"]) == 2


def test_without_damping_no_beat_is_looked_for():
    spec = {**SPEC, "chain": {"n": 2, "delta": 0.0, "beta": 0.0}}
    spec["setting"] = {"epsilon": 1e-3, "lam": 0.1, "omega": 1.3}
    answer = simulate(spec)
    assert answer["outcome"] == "not_locked"
    assert answer["beat"] is None


BOUC_WEN = {"kind": "bouc_wen", "gain": 0.2, "loading": 60, "unloading": 20}
RINGED = {**SPEC, "chain": {"n": 2, "delta": 0.1, "beta": -1.0, "closure": "ring"}, "tol": 1e-3}
RINGED["setting"] = {"epsilon": 0.01, "lam": 0.1, "omega": 1.0, "bias": 0.02, "preload": 0.01}
TERMS = {
    "bouc_wen": {"hysteresis": BOUC_WEN},
    "play": {"hysteresis": {"kind": "play", "radius": [1e-3], "weight": [0.2], "base": 0.8}},
    "creep": {"creep": {"per_decade": 0.02, "first": 50, "last": 5000}},
    "modes": {"modes": [{"omega": 5.0, "delta": 0.1, "gain": 3.0}]},
    "amplifier": {"amplifier": {"bandwidth": 2.0}},
    "clipped": {"amplifier": {"bandwidth": 2.0, "slew": 5e-3, "limit": 8e-3}},
    "tones": {"tones": [{"epsilon": 0.01, "omega": 1.2, "phase": 0.3}]},
}


@pytest.mark.parametrize("name", TERMS)
def test_every_term_is_reached_and_does_something(name):
    plain = simulate(RINGED)
    answer = json.loads(json.dumps(simulate({**RINGED, "terms": TERMS[name]}), allow_nan=False))
    more = {"creep": ["drift"], "tones": ["lines"]}
    assert list(answer) == [*KEYS, *more.get(name, [])]
    assert (answer["outcome"], answer["stable"], answer["rung"]) == ("ok", True, "ode")
    assert answer["error_estimate"] <= 1e-3
    assert answer["multipliers"] == [[None, None]] * 4
    changed = answer["mean"] if name == "creep" else [re for re, _ in answer["phasor"]]
    before = plain["mean"] if name == "creep" else [re for re, _ in plain["phasor"]]
    assert changed != pytest.approx(before, rel=1e-2)


def test_no_term_is_none_at_all():
    assert simulate({**RINGED, "terms": None})["phasor"] == simulate(RINGED)["phasor"]
    empty = simulate({**RINGED, "terms": {}})
    assert empty["rung"] == "ode"
    assert np.ravel(empty["phasor"]) == pytest.approx(np.ravel(simulate(RINGED)["phasor"]), rel=1e-3)


def test_lines_name_the_tones_by_their_count():
    answer = simulate({**RINGED, "chain": {**RINGED["chain"], "beta": 0.0}, "terms": TERMS["tones"]})
    first, second = answer["lines"][:2]
    assert (first["k"], first["omega"], first["phasor"]) == ([1, 0], 1.0, answer["phasor"])
    assert (second["k"], second["omega"]) == ([0, 1], 1.2)
    alone = simulate({**RINGED, "setting": {**RINGED["setting"], "omega": 1.2, "phase": 0.3},
                      "chain": {**RINGED["chain"], "beta": 0.0}})  # fmt: skip
    assert np.ravel(second["phasor"]) == pytest.approx(np.ravel(alone["phasor"]), rel=1e-3)


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("terms: {hysteresis: {kind: rubber}}", "terms.hysteresis.kind: expected 'bouc_wen' or 'play', got 'rubber'"),
        ("terms: {hysteresis: {kind: play, gain: 1}}", "terms.hysteresis: kind play takes radius, weight, base, got"),
        ("terms: {hysteresis: {kind: bouc_wen, gain: 1, loading: 1, unloading: 2}}",
         "terms.hysteresis: hysteresis.loading: expected at least"),
        ("terms: {hysteresis: {kind: play, radius: [-1], weight: [1], base: 1}}",
         "terms.hysteresis.radius.0: expected a number >= 0.0, got -1"),
        ("terms: {creep: {per_decade: 0.1, first: 5, last: 1}}", "terms.creep: creep.last: expected 0 < first < last"),
        ("terms: {creep: {per_decade: 0.1, first: 1, last: 1.0e+15}}", "terms.creep: creep.last: expected at most 12"),
        ("terms: {modes: [{omega: 0, delta: 0, gain: 1}]}", "terms.modes.0.omega: expected a number > 0.0, got 0"),
        ("terms: {amplifier: {bandwidth: .inf}}", "terms.amplifier.bandwidth: expected a finite number"),
        ("terms: {tones: [{epsilon: 1, omega: 1.0}]}", "terms: tones: expected frequencies other than the setting's 1"),
        ("terms: {warmth: 3}", "terms.warmth: unknown key"),
        ("terms: loud", "terms: expected keys and values, got 'loud'"),
    ],
)  # fmt: skip
def test_complaints_about_terms_name_the_place(line, complaint):
    with pytest.raises(ProfileError) as caught:
        parse_simulation(TEXT + line + "\n", "c.yaml")
    assert str(caught.value).startswith(f"c.yaml:6: {complaint}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (
            {"rung": "linear", "terms": TERMS["creep"]},
            "rung linear: it does not carry creep; use rung ode or auto",
        ),
        (
            {"rung": "harmonic_balance", "terms": TERMS["tones"]},
            "does not carry two tones of a ring chain; use rung ode or auto",
        ),
        ({"start": "all", "terms": TERMS["modes"]}, "start all: branches are listed without terms"),
        ({"start": "all", "rung": "envelope"}, "use rung harmonic_balance"),
        ({"start": "all", "rung": "ode"}, "rung harmonic_balance"),
    ],
)
def test_a_rung_that_cannot_answer(more, words):
    with pytest.raises(RungError, match=words):
        simulate({**RINGED, **more})


SAMPLES = sorted((Path(__file__).resolve().parents[2] / "samples" / "chains").glob("*.yaml"))


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_samples(path):
    assert path.read_text().startswith("# ")
    answer = json.loads(json.dumps(simulate(path), allow_nan=False))
    assert answer["outcome"] == ("not_locked" if path.stem == "ring" else "ok")
    if path.stem == "ring":
        assert answer["beat"] is not None
    if path.stem == "tones":
        # Both tones pass with unit gain, at lags of 60 and 120 degrees.
        for line, lag in zip(answer["lines"], (-60, -120), strict=False):
            phasor = [complex(*pair) for pair in line["phasor"]]
            assert [abs(each) for each in phasor] == pytest.approx([0.01] * 6, rel=0.02)
            steps = [math.degrees(cmath.phase(b / a)) for a, b in pairwise(phasor)]
            assert steps == pytest.approx([lag] * 5, abs=1.5)


def test_there_are_samples():
    assert {"ring", "grid", "both-ways", "creep", "hysteresis", "ring-branches"} <= {path.stem for path in SAMPLES}


def test_nothing_heavy_is_imported():
    code = (
        "import sys, chainsim\n"
        f"chainsim.simulate({SPEC!r})\n"
        "print(sorted({'numba', 'scipy', 'matplotlib', 'PIL', 'louis'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
