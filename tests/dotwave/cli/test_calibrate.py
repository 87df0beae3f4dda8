"""From a table of measured sweeps to a device file, and every way in which a table can be wrong."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from chainsim import Device, ProfileError, load_device
from dotwave.errors import AppError
from dotwave.studies.calibrate import CalibrateReport, calibrate
from dotwave.studies.measured_sweeps import COLUMNS, read_sweeps

if TYPE_CHECKING:
    from tests.conftest import Ended

ROOT = Path(__file__).resolve().parents[3]
SAMPLE = ROOT / "samples" / "calibration" / "sweep.csv"
DEVICE = load_device("linked-6x6")
HEADER = ",".join(COLUMNS)
Floats = NDArray[np.float64]


def truth() -> dict[str, Floats]:
    """What went into the sample, from the lines that start with #."""
    lines = [line[2:].split(": ") for line in SAMPLE.read_text(encoding="utf-8").splitlines() if line.startswith("#")]
    return {name: np.array(values.split(), dtype=np.float64) for name, values in lines}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[CalibrateReport, Path]:
    out = tmp_path_factory.mktemp("calibrated") / "my-device.yaml"
    return calibrate(str(SAMPLE), device="linked-6x6", out=out, lam_set=6e-3), out


def test_the_sample_gives_its_actuators_back(written: tuple[CalibrateReport, Path]) -> None:
    report, out = written
    assert report.ok
    assert report.path == str(out)
    assert [(one.row, one.col) for one in report.actuators] == [(0, col) for col in range(6)]
    for name, values in truth().items():
        for one, value in zip(report.actuators, values, strict=True):
            if np.isfinite(value):
                # 95 % intervals reach to two standard errors: here to four and a half.
                assert abs(one.values[name] - value) < 2.3 * one.plus_minus[name], (name, one.col)
                assert name in one.left_out or one.plus_minus[name] < 0.25 * abs(value)
    assert not {"f0_hz", "delta", "lam", "epsilon_per_volt"} & {
        name for one in report.actuators for name in one.left_out
    }
    assert {"beta"} <= set(report.actuators[5].left_out)


def test_the_file_written_is_a_device_that_knows_its_actuators(written: tuple[CalibrateReport, Path]) -> None:
    report, out = written
    device = load_device(str(out))
    assert device.name == "my-device"
    assert device.model_dump(exclude={"name", "actuators"}) == DEVICE.model_dump(exclude={"name", "actuators"})
    real = truth()
    chain = device.chain_at(0)
    np.testing.assert_allclose(np.sqrt(chain.stiffness) * device.f0_hz, real["f0_hz"], rtol=3e-4)
    np.testing.assert_allclose(chain.deltas, real["delta"], rtol=0.05)
    assert chain.betas[5] == DEVICE.beta
    np.testing.assert_allclose(device.lam_gain(0), real["lam"][1:] / 6e-3, rtol=0.02)
    assert device.drive_per_volt(0) == pytest.approx(2e-3, rel=0.02)
    for one, entry in zip(report.actuators, device.actuators, strict=True):
        assert entry.f0_hz == pytest.approx(one.values["f0_hz"], rel=1e-6)
        assert entry.plus_minus.f0_hz == pytest.approx(one.plus_minus["f0_hz"], rel=1e-6)
        assert (entry.beta is None) is ("beta" in one.left_out)
    other = device.chain_at(1)
    assert (other.delta, other.beta, other.spread) == (DEVICE.delta, DEVICE.beta, None)
    assert device.lam_gain(1).tolist() == [1.0] * 5
    assert device.drive_per_volt(1) == DEVICE.epsilon_per_volt


def test_the_report_says_it_in_words_and_in_json(written: tuple[CalibrateReport, Path]) -> None:
    report, out = written
    lines = report.as_text().splitlines()
    assert "f0_hz" in lines[0]
    assert lines[1].split()[:3] == ["0", "0", f"{report.actuators[0].values['f0_hz']:.6g}"]
    assert "Row 0, column 5: the sweep hardly determines beta; the profile's value stays." in report.as_text()
    assert lines[-1] == f"Written: {out}"
    plain = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    assert plain["outcome"] == "ok"
    assert plain["actuators"][1]["values"].keys() == {"f0_hz", "delta", "beta", "lam"}


def test_the_sample_is_what_its_script_makes(tmp_path: Path) -> None:
    script = tmp_path / "make_sweep.py"
    script.write_text((SAMPLE.parent / "make_sweep.py").read_text(encoding="utf-8"), encoding="utf-8")
    subprocess.run([sys.executable, str(script)], check=True, cwd=ROOT)
    made, kept = (np.genfromtxt(path / "sweep.csv", delimiter=",", skip_header=5) for path in (tmp_path, SAMPLE.parent))
    np.testing.assert_allclose(made, kept, atol=2e-4)


def some(change: Callable[[list[list[str]]], object] = lambda rows: None) -> str:
    """A small table of two actuators, changed."""
    rows = [
        [str(part) for part in (0, col, f, 0.2, 0.01 * (1 + col), -0.5)]
        for col in (0, 1)
        for f in np.linspace(130, 136, 12)
    ]
    change(rows)
    return "\n".join([HEADER, *(",".join(row) for row in rows)]) + "\n"


def put(place: int, column: str, value: str) -> Callable[[list[list[str]]], None]:
    def change(rows: list[list[str]]) -> None:
        rows[place][COLUMNS.index(column)] = value

    return change


def test_a_table_is_read_as_it_stands(tmp_path: Path) -> None:
    path = tmp_path / "sweep.csv"
    text = some(put(3, "amplitude", "")).replace("0.2,,-0.5", "0.2,,")
    path.write_text("\ufeff# measured by hand\n\n" + text, encoding="utf-8")
    ((place, sweep),) = read_sweeps(str(path), DEVICE).items()
    assert (place.row, place.chain) == (0, 0)
    assert sweep.phasor.shape == (12, 2)
    np.testing.assert_allclose(sweep.omega * DEVICE.f0_hz, np.linspace(130, 136, 12))
    assert np.isnan(sweep.phasor[3, 0])
    assert sweep.phasor[4, 1] == pytest.approx(0.02 * np.exp(-0.5j))


def test_columns_may_come_in_any_order_and_with_others(tmp_path: Path) -> None:
    rows = [line.split(",") for line in some().splitlines()]
    path = tmp_path / "sweep.csv"
    path.write_text("\n".join(",".join([*reversed(row), "note"]) for row in rows), encoding="utf-8")
    plain = tmp_path / "plain.csv"
    plain.write_text(some(), encoding="utf-8")
    for one, other in zip(
        read_sweeps(str(path), DEVICE).values(), read_sweeps(str(plain), DEVICE).values(), strict=True
    ):
        np.testing.assert_array_equal(one.phasor, other.phasor)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"sweep\.csv: empty; expected a header with row, col"),
        (HEADER + "\n", r"sweep\.csv: no line with numbers below the header"),
        (some().replace("drive_v", "volts", 1), r"sweep\.csv:1: column drive_v is missing; the header needs row, col"),
        (some().replace("col,", "row,", 1), r"sweep\.csv:1: column row is given twice"),
        (some(put(2, "amplitude", "high")), r"sweep\.csv:4: column amplitude: expected a number >= 0, got 'high'"),
        (some(put(2, "amplitude", "")), r"sweep\.csv:4: column amplitude: expected a number >= 0, got ''"),
        (some(put(2, "amplitude", "-1")), r"sweep\.csv:4: column amplitude: expected a number >= 0, got '-1'"),
        (some(put(2, "phase_rad", "nan")), r"sweep\.csv:4: column phase_rad: expected a number, got 'nan'"),
        (some(put(0, "frequency_hz", "0")), r"sweep\.csv:2: column frequency_hz: expected a number > 0, got 0"),
        (some(put(0, "frequency_hz", "inf")), r"sweep\.csv:2: column frequency_hz: expected a number, got 'inf'"),
        (some(put(2, "amplitude", "1e308")), r"sweep\.csv:4: column amplitude: 1e\+308 is nothing that was measured"),
        (some(put(2, "phase_rad", "-1e99")), r"sweep\.csv:4: column phase_rad: -1e\+99 is nothing that was measured"),
        (some(put(1, "row", "6")), r"sweep\.csv:3: column row: expected a whole number 0\.\.5, got '6'"),
        (some(put(1, "col", "1.5")), r"sweep\.csv:3: column col: expected a whole number 0\.\.5, got '1\.5'"),
        (some(put(14, "drive_v", "0.3")), r"sweep\.csv:16: column drive_v: 0\.3 where line 4 of the chain's first"),
        (some(lambda rows: rows.pop()), r"column col: actuator 1 of row 0 has 11 lines, the first of its chain 12"),
        (some(lambda rows: [row.__setitem__(1, "2") for row in rows[12:]]), "column 2 but not column 1"),
        (some(lambda rows: rows.__delitem__(slice(0, 12))), "column 1 but not column 0"),
        ("row\x00" + some(), r"sweep\.csv:1: "),
    ],
)
def test_a_wrong_table_is_refused_with_its_place(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "sweep.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(AppError, match=message):
        read_sweeps(str(path), DEVICE)


def test_what_is_no_table_is_refused(tmp_path: Path) -> None:
    with pytest.raises(AppError, match="No such file"):
        read_sweeps(str(tmp_path / "none.csv"), DEVICE)
    with pytest.raises(AppError, match="Is a directory"):
        read_sweeps(str(tmp_path), DEVICE)
    (tmp_path / "sweep.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(AppError, match="not UTF-8 at byte 0; save it as CSV in UTF-8"):
        read_sweeps(str(tmp_path / "sweep.csv"), DEVICE)


def test_more_points_than_memory_is_good_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sweep.csv").write_text(some(), encoding="utf-8")
    monkeypatch.setattr("dotwave.studies.measured_sweeps.MOST_POINTS", 24)
    read_sweeps(str(tmp_path / "sweep.csv"), DEVICE)
    monkeypatch.setattr("dotwave.studies.measured_sweeps.MOST_POINTS", 23)
    with pytest.raises(AppError, match=r"sweep\.csv: more than 23 points; sweep fewer, or a row at a time"):
        read_sweeps(str(tmp_path / "sweep.csv"), DEVICE)


def test_points_that_do_not_determine_a_chain_name_it(tmp_path: Path) -> None:
    path = tmp_path / "sweep.csv"
    path.write_text("\n".join(some().splitlines()[:4]), encoding="utf-8")
    with pytest.raises(AppError, match=r"sweep\.csv: row 0, chain 0: actuator 0 of the chain: at least 8 points"):
        calibrate(str(path), device="linked-6x6", out=None, lam_set=None)


def test_devices_and_files_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    with pytest.raises(AppError, match="paper-6x6-ring: its chains are ring; only open chains are fitted"):
        calibrate(str(SAMPLE), device="paper-6x6-ring", out=None, lam_set=None)
    with pytest.raises(ProfileError, match="not a built-in profile"):
        calibrate(str(SAMPLE), device="nothing", out=None, lam_set=None)
    with pytest.raises(AppError, match=r"my\.txt: a device profile ends in \.yaml"):
        calibrate(str(SAMPLE), device="linked-6x6", out=tmp_path / "my.txt", lam_set=None)
    with pytest.raises(AppError, match="lam 0: expected a number > 0"):
        calibrate(str(SAMPLE), device="linked-6x6", out=None, lam_set=0.0)
    assert list(tmp_path.iterdir()) == []


def altered(path: Path, change: Callable[[list[str]], None]) -> str:
    """The sample's table with every line changed, in a file."""
    rows = [line.split(",") for line in SAMPLE.read_text(encoding="utf-8").splitlines()[5:]]
    for row in rows:
        change(row)
    path.write_text("\n".join([HEADER, *(",".join(row) for row in rows)]), encoding="utf-8")
    return str(path)


def test_points_that_fit_no_chain_write_nothing(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    source = altered(
        tmp_path / "sweep.csv", lambda row: row.__setitem__(4, f"{float(row[4]) * rng.lognormal(0, 1.5):.4g}")
    )
    out = tmp_path / "my.yaml"
    report = calibrate(source, device="linked-6x6", out=out, lam_set=None)
    assert not report.ok
    assert report.as_dict()["outcome"] == "no_convergence"
    assert "Row 0, chain 0: no chain of this kind fits the points" in report.as_text()
    assert report.as_text().endswith("Not written.")
    assert not out.exists()


@pytest.mark.parametrize("mistake", [pytest.param(np.degrees, marks=pytest.mark.slow), np.negative])
def test_phases_in_degrees_or_turned_round_write_nothing(tmp_path: Path, mistake: np.ufunc) -> None:
    source = altered(tmp_path / "sweep.csv", lambda row: row.__setitem__(5, f"{mistake(float(row[5])):.4f}"))
    out = tmp_path / "my.yaml"
    with pytest.raises(AppError, match="see that phases are radians"):
        calibrate(source, device="linked-6x6", out=out, lam_set=None)
    assert not out.exists()


def test_a_sensor_that_slips_spoils_nothing(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)

    def slip(row: list[str]) -> None:
        if row[1] == "1" and rng.random() < 0.3:
            row[5] = f"{rng.uniform(-3, 3):.3f}"

    report = calibrate(altered(tmp_path / "sweep.csv", slip), device="linked-6x6", out=None, lam_set=None)
    assert report.ok
    assert report.actuators[1].outliers > 10
    assert sum(one.outliers for one in report.actuators) == report.actuators[1].outliers
    for name in ("f0_hz", "delta"):
        for one, value in zip(report.actuators, truth()[name], strict=True):
            assert abs(one.values[name] - value) < 2.3 * one.plus_minus[name]


def profile(tmp_path: Path, actuators: list[dict[str, object]]) -> Path:
    path = tmp_path / "device.yaml"
    path.write_text(yaml.safe_dump(DEVICE.as_dict() | {"actuators": actuators}), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("actuator", "message"),
    [
        ({"row": 6, "col": 0}, r"actuators\.0: row 6, col 0 is outside the grid of 6 x 6"),
        ({"row": 0, "col": 0, "lam": 0.1}, "is the first of its chain and has no lam; remove it"),
        ({"row": 0, "col": 1, "epsilon_per_volt": 0.1}, "is not driven and has no epsilon_per_volt; remove it"),
        ({"row": 0, "col": 1, "delta": 0}, r"actuators\.0\.delta: expected a number > 0.*, got 0"),
        ({"row": 0, "col": 1, "f0": 133.0}, "unknown key"),
    ],
)
def test_a_wrong_actuator_is_refused(tmp_path: Path, actuator: dict[str, object], message: str) -> None:
    with pytest.raises(ProfileError, match=message):
        load_device(str(profile(tmp_path, [actuator])))


def test_an_actuator_given_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match="row 1, col 2 is given twice; keep one"):
        load_device(str(profile(tmp_path, [{"row": 1, "col": 2}, {"row": 1, "col": 2}])))


def test_a_profile_without_actuators_is_a_device_too(tmp_path: Path) -> None:
    device = load_device(str(profile(tmp_path, [])))
    assert isinstance(device, Device)
    assert device.chain_at(5) == DEVICE.chain


def test_another_row_is_added_to_what_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows can be measured one at a time: entries of other actuators stay, those measured again are replaced."""
    before: list[dict[str, object]] = [
        {"row": 0, "col": 1, "f0_hz": 99.0},
        {"row": 3, "col": 2, "f0_hz": 140.0, "delta": 0.004, "plus_minus": {"f0_hz": 0.1}},
    ]
    known = load_device(str(profile(tmp_path, before)))
    monkeypatch.setattr("dotwave.studies.calibrate.load_device", lambda name: known)
    out = tmp_path / "both.yaml"
    calibrate(str(SAMPLE), device="known", out=out, lam_set=6e-3)
    device = load_device(str(out))
    assert [(one.row, one.col) for one in device.actuators] == [*((0, col) for col in range(6)), (3, 2)]
    assert device.actuators[1].f0_hz == pytest.approx(truth()["f0_hz"][1], rel=1e-3)
    assert device.actuators[6] == known.actuators[1]


def test_the_command_writes_and_prints(dotwave: Callable[..., Ended], tmp_path: Path) -> None:
    out = tmp_path / "my-device.yaml"
    ended = dotwave("calibrate", SAMPLE, "--device", "linked-6x6", "--lam", "0.006", "-o", out)
    assert ended.code == 0
    assert f"Written: {out}" in ended.out
    assert len(load_device(str(out)).actuators) == 6
    ended = dotwave("calibrate", SAMPLE, "--json")
    assert ended.code == 0
    assert json.loads(ended.out)["path"] == ""
    (tmp_path / "bad.csv").write_text(some(put(0, "col", "x")), encoding="utf-8")
    ended = dotwave("calibrate", tmp_path / "bad.csv")
    assert ended.code == 2
    assert ended.err.count("\n") == 1
    assert "bad.csv:2: column col" in ended.err


def test_the_command_reads_standard_input(dotwave: Callable[..., Ended], monkeypatch: pytest.MonkeyPatch) -> None:
    class Stream:
        buffer = io.BytesIO(SAMPLE.read_bytes())

    monkeypatch.setattr(sys, "stdin", Stream())
    ended = dotwave("calibrate", "-", "--json")
    assert len(json.loads(ended.out)["actuators"]) == 6
