"""Chain files: the exact keys, strict JSON, and complaints that name file, line and field."""

import json
import subprocess
import sys

import pytest

from chainsim import ProfileError, RungError, parse_simulation, simulate

KEYS = [
    "outcome", "rung", "phasor", "phase_step_deg", "third", "mean", "stable", "locked", "multipliers", "branch",
    "error_estimate", "stats",
]  # fmt: skip
SPEC = {
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
    assert list(answer) == [*KEYS, "answers"]
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


def test_a_rung_that_cannot_answer():
    spec = {**SPEC, "chain": {**SPEC["chain"], "closure": "ring"}, "rung": "harmonic_balance", "start": "all"}
    with pytest.raises(RungError, match="ring"):
        simulate(spec)


def test_nothing_heavy_is_imported():
    code = (
        "import sys, chainsim\n"
        f"chainsim.simulate({SPEC!r})\n"
        "print(sorted({'numba', 'scipy', 'matplotlib', 'PIL', 'louis'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
