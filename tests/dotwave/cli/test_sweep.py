"""`dotwave sweep`: the file's fields, exactness of both formats, parts that are taken up again, and complaints."""

import csv
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from chainsim import ProfileError, simulate
from dotwave.errors import AppError
from dotwave.figures.sweep_map import draw_map
from dotwave.studies.sweep import FIELDS, run_sweep
from dotwave.studies.sweep_files import SweepParts
from drivers import FileError
from tests.support.sweeps import TEXT


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "sweep.yaml"
    path.write_text(TEXT)
    return path


def load(path):
    with np.load(path, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def test_fields_are_those_of_simulate(source, tmp_path):
    report = run_sweep(source, tmp_path / "out.npz")
    assert (report.settings, report.counts, report.resumed) == (20, {"ok": 20}, 0)
    found = load(tmp_path / "out.npz")
    assert tuple(found) == FIELDS
    assert found["epsilon"].reshape(5, 4)[:, 0] == pytest.approx(np.geomspace(1e-4, 1e-3, 5))
    assert np.array_equal(found["omega"].reshape(5, 4)[0], np.linspace(0.99, 1.01, 4))
    for at in (0, 7, 19):
        question = {
            "chain": {"n": 3, "delta": 6e-3, "beta": -1.0},
            "setting": {"epsilon": float(found["epsilon"][at]), "lam": 6e-3, "omega": float(found["omega"][at])},
            "rung": "harmonic_balance", "tol": 1e-10,
        }  # fmt: skip
        one = simulate(question)
        assert found["outcome"][at] == one["outcome"]
        size = np.abs(found["phasor"][at]).max()
        for name in ("phasor", "third"):
            assert np.allclose(found[name][at], [complex(*pair) for pair in one[name]], rtol=0, atol=2e-8 * size)
        assert np.allclose(found["phase_step_deg"][at], one["phase_step_deg"], rtol=0, atol=1e-5)
        assert np.array_equal(found["branch"][at], one["branch"])
        assert found["multipliers"].shape == (20, len(one["multipliers"]))
        assert found["stable"][at] == one["stable"]
        assert found["locked"][at] == one["locked"]


def test_csv_says_the_same_to_the_last_bit(source, tmp_path):
    run_sweep(source, tmp_path / "out.npz")
    run_sweep(source, tmp_path / "out.csv")
    found = load(tmp_path / "out.npz")
    with (tmp_path / "out.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    assert len(rows) == 20
    for m in range(3):
        read = np.array([complex(float(r[f"phasor_{m + 1}_re"]), float(r[f"phasor_{m + 1}_im"])) for r in rows])
        assert np.array_equal(read, found["phasor"][:, m])
    assert [row["outcome"] for row in rows] == list(found["outcome"])
    assert {row["stable"] for row in rows} == {"true"}


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_the_file_does_not_depend_on_the_chunks(source, tmp_path, suffix, monkeypatch):
    source.write_text(TEXT.replace("harmonic_balance", "auto"))
    monkeypatch.setattr("chainsim.batch.sweep._UNIT", 48)
    whole, cut = tmp_path / f"whole{suffix}", tmp_path / f"cut{suffix}"
    run_sweep(source, whole, units=100)
    run_sweep(source, cut, units=1)
    assert whole.read_bytes() == cut.read_bytes()


@pytest.mark.slow
def test_the_file_does_not_depend_on_the_workers(source, tmp_path):
    source.write_text(TEXT.replace("steps: 5", "steps: 1200"))
    one, two = tmp_path / "one.npz", tmp_path / "two.npz"
    run_sweep(source, one, units=1)
    run_sweep(source, two, units=1, workers=2)
    assert one.read_bytes() == two.read_bytes()


def test_goes_on_where_it_was_stopped(source, tmp_path, monkeypatch):
    monkeypatch.setattr("chainsim.batch.sweep._UNIT", 48)
    run_sweep(source, tmp_path / "whole.npz", units=1)
    import dotwave.studies.sweep as module

    solve, calls = module.answers, []

    def fails_late(sweep, first, *rest):
        calls.append(first)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return solve(sweep, first, *rest)

    monkeypatch.setattr(module, "answers", fails_late)
    out = tmp_path / "out.npz"
    with pytest.raises(KeyboardInterrupt):
        run_sweep(source, out, units=1)
    assert not out.exists()
    report = run_sweep(source, out, units=1)
    assert report.resumed == 3
    assert calls == [0, 3, 6, 9, 9, 12, 15, 18]
    assert out.read_bytes() == (tmp_path / "whole.npz").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.npz", "sweep.yaml", "whole.npz"]


def test_parts_of_another_sweep_are_refused(source, tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("dotwave.studies.sweep.answers", stop)
    with pytest.raises(KeyboardInterrupt):
        run_sweep(source, tmp_path / "out.npz")
    source.write_text(TEXT.replace("1.0e-8", "1.0e-6"))
    with pytest.raises(AppError, match="left by another sweep"):
        run_sweep(source, tmp_path / "out.npz")


def test_one_part_is_read_at_a_time(tmp_path):
    for first in (0, 2):
        np.savez(tmp_path / f"{first:012d}.npz", a=np.array([first, first + 1]))
    parts = SweepParts(tmp_path, range(0, 4, 2)).field("a")
    assert next(parts).tolist() == [0, 1]
    (tmp_path / "000000000002.npz").unlink()
    with pytest.raises(FileNotFoundError):
        next(parts)


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_tables(tmp_path, suffix):
    epsilon, lam = np.array([1e-4, 2e-4]), np.array([[5e-3, 6e-3], [7e-3, 8e-3]])
    if suffix == ".npz":
        np.savez(tmp_path / "table.npz", epsilon=epsilon, lam=lam)
    else:
        rows = [f"{e},{a},{b}" for e, (a, b) in zip(epsilon.tolist(), lam.tolist(), strict=True)]
        (tmp_path / "table.csv").write_text("\n".join(["epsilon,lam_1,lam_2", *rows]))
    source = tmp_path / "sweep.yaml"
    source.write_text(
        "chain: {n: 3, delta: 6.0e-3, beta: -1.0}\n"
        f"setting: {{table: table{suffix}, omega: 1.0}}\nrung: harmonic_balance\ntol: 1.0e-6\n"
    )
    run_sweep(source, tmp_path / "out.npz", only=("lam", "epsilon", "omega"))
    found = load(tmp_path / "out.npz")
    assert list(found) == ["epsilon", "lam", "omega"]
    assert np.array_equal(found["lam"], lam)
    assert np.array_equal(found["epsilon"], epsilon)
    assert found["omega"].tolist() == [1.0, 1.0]


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("steps: 5", "steps: 0", "sweep.yaml:3: setting.epsilon.range.steps: expected a number >= 1, got 0"),
        ("from: 1.0e-4", "from: -1", "sweep.yaml:3: setting.epsilon.range: a log range needs ends > 0"),
        ("lam: 6.0e-3", "lam: high", "sweep.yaml:4: setting.lam.number: expected a number, got 'high'"),
        ("lam: 6.0e-3", "lam: [1, 2, 3]", "sweep.yaml: setting.lam: expected 1 or 2 numbers, got 3"),
        ("from: 0.99", "from: -0.99", "setting.omega: expected a number > 0, got -0.99"),
        ("  lam: 6.0e-3\n", "  lam: 6.0e-3\n  table: t.csv\n", "t.csv: No such file or directory"),
        ("rung: harmonic_balance", "rung: magic", "sweep.yaml:6: rung: expected 'auto' or 'harmonic_balance'"),
        ("rung: harmonic_balance", "start: all", "start: expected"),
    ],
)
def test_complaints_name_the_place(source, tmp_path, old, new, complaint):
    source.write_text(TEXT.replace(old, new, 1))
    with pytest.raises(ProfileError) as caught:
        run_sweep(source, tmp_path / "out.npz")
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.glob("out*"))


def test_output_that_cannot_be(source, tmp_path):
    with pytest.raises(AppError, match=r"\.npz or \.csv"):
        run_sweep(source, tmp_path / "out.txt")
    with pytest.raises(AppError, match="no such field"):
        run_sweep(source, tmp_path / "out.npz", only=("colour",))
    with pytest.raises(AppError, match="Not a directory"):
        run_sweep(source, source / "out.npz")


def test_report(source, tmp_path):
    report = run_sweep(source, tmp_path / "out.npz")
    assert json.loads(json.dumps(report.as_dict()))["outcomes"] == {"ok": 20}
    assert "20 settings" in report.as_text()


def test_map(source, tmp_path):
    from PIL import Image

    run_sweep(source, tmp_path / "out.npz")
    draw_map(source, tmp_path / "out.npz", tmp_path / "map.png")
    with Image.open(tmp_path / "map.png") as image:
        pixels = np.asarray(image)
    assert np.all(pixels[40:45, 90:94] == (38, 102, 148))
    lag = load(tmp_path / "out.npz")["phase_step_deg"][:, -1].reshape(5, 4)
    shown = pixels[40:45, 184:188].astype(int).sum(axis=2)[::-1]
    assert shown.flat[lag.argmin()] == shown.min() < shown.max() == shown.flat[lag.argmax()]


def test_a_map_needs_two_ranges(source, tmp_path):
    source.write_text(TEXT.replace("steps: 4", "steps: 1"))
    run_sweep(source, tmp_path / "out.npz")
    with pytest.raises(AppError, match="exactly two ranges"):
        draw_map(source, tmp_path / "out.npz", tmp_path / "map.png")


def test_a_grid_is_swept_as_it_is_simulated(tmp_path):
    chain = {"grid": {"rows": 2, "cols": 3}, "delta": 0.05, "beta": [-1.0] * 6}
    source = tmp_path / "grid.yaml"
    source.write_text(
        f"chain: {json.dumps(chain)}\n"
        "setting: {epsilon: {from: 1.0e-3, to: 1.0e-2, steps: 3}, lam: {from: 0.05, to: 0.1, steps: 2}, omega: 1.1}\n"
        "rung: harmonic_balance\ntol: 1.0e-8\n"
    )
    run_sweep(source, tmp_path / "same.npz")
    source.write_text(source.read_text().replace("omega", "lam_y: 0.2, omega"))
    run_sweep(source, tmp_path / "apart.npz")
    for name, downs in (("same", 0.1), ("apart", 0.2)):
        setting = {"epsilon": 1e-2, "lam_x": 0.1, "lam_y": downs, "omega": 1.1}
        one = simulate({"chain": chain, "setting": setting, "rung": "harmonic_balance", "tol": 1e-10})
        found = load(tmp_path / f"{name}.npz")
        assert found["outcome"][5] == one["outcome"] == "ok"
        wanted = np.array([complex(*pair) for pair in one["phasor"]])
        assert np.abs(found["phasor"][5] - wanted).max() < 2e-8 * np.abs(wanted).max()


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("n: 3", "n: 3, grid: {rows: 2, cols: 2}", "give either n"),
        ("n: 3", "n: 3, kind: magnet", "chain.kind: expected"),
        ("delta: 6.0e-3", "delta: [6.0e-3, 5.0e-3]", "chain.delta: expected a number or a list of 3"),
        ("lam: 6.0e-3", "lam: 6.0e-3\n  lam_y: 0.1", "setting.lam_y: only a grid"),
        ("n: 3", "grid: {rows: 2000, cols: 2000}", "at most 1000000 oscillators"),
    ],
)
def test_chains_that_do_not_fit_together(source, tmp_path, old, new, complaint):
    source.write_text(TEXT.replace(old, new, 1))
    with pytest.raises(ProfileError, match=complaint):
        run_sweep(source, tmp_path / "out.npz")


def test_no_worker_outlives_a_sweep_that_is_killed(source, tmp_path):
    source.write_text(TEXT.replace("steps: 5", "steps: 100_000"))
    command = [sys.executable, "-m", "dotwave", "sweep", source, "-o", tmp_path / "out.npz", "--workers", "2"]
    with subprocess.Popen(command, env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])}) as running:
        until = time.monotonic() + 120
        # Two workers, and the process that tidies up after all of them.
        while len(workers := psutil.Process(running.pid).children(recursive=True)) < 3:
            assert running.poll() is None
            assert time.monotonic() < until
            time.sleep(0.01)
        running.kill()
    _, alive = psutil.wait_procs(workers, 120)
    for one in alive:
        one.kill()
    assert not alive


def test_a_map_is_there_whole_or_not_at_all(source, tmp_path, monkeypatch):
    from PIL import Image

    def full(self, file, **_):
        file.write(b"half")
        raise OSError(28, "No space left on device")

    run_sweep(source, tmp_path / "out.npz")
    (tmp_path / "map.png").write_bytes(b"old")
    monkeypatch.setattr(Image.Image, "save", full)
    with pytest.raises(FileError, match=r"map\.png: the disk is full"):
        draw_map(source, tmp_path / "out.npz", tmp_path / "map.png")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.png", "out.npz", "sweep.yaml"]
    assert (tmp_path / "map.png").read_bytes() == b"old"
