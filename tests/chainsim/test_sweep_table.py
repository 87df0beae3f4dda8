"""Tables of sweeps: refused with the place and the cure, and before memory is taken for them."""

from __future__ import annotations

import io
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chainsim import ProfileError, read_sweep
from chainsim.files.sweep_table import read_table

CHAIN = "chain: {n: 3, delta: 6.0e-3, beta: -1.0}\nrung: harmonic_balance\ntol: 1.0e-6\n"


def refused(path: Path) -> str:
    with pytest.raises(ProfileError) as caught:
        read_table(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message.removeprefix(str(path))


CSV = {
    "": ":1: no header; expected epsilon, lam, omega or lam_1, lam_2, ...",
    "epsilon,omega": ": no rows of epsilon, lam, omega",
    "epsilon,omega\n\n\n": ": no rows of epsilon, lam, omega",
    "epsilon,lam_one\n1,2": ":1: unknown column 'lam_one'; expected epsilon",
    "epsilon,lam_0\n1,2": ":1: unknown column 'lam_0'",
    "epsilon,lam_\xb2\n1,2": ":1: unknown column 'lam_\xb2'",
    "epsilon,omgea\n1,2": ":1: unknown column 'omgea'",
    "epsilon,omega,epsilon\n1,2,3": ":1: column epsilon is given twice; keep one",
    "lam_1,lam_1\n1,2": ":1: column lam_1 is given twice; keep one",
    "lam,lam_1\n1,2": ":1: columns lam and lam_1; give lam for all links, or lam_1, lam_2, ...",
    "lam_1,lam_3\n1,2": ":1: column lam_3 but no lam_2; give every link from lam_1 on",
    "lam_2\n1": ":1: column lam_2 but no lam_1; give every link from lam_1 on",
    "epsilon,omega\n1,2\n3,x": ":3: omega: expected a finite number, got 'x'",
    "epsilon,omega\n1,2\n\n3,nan": ":4: omega: expected a finite number, got 'nan'",
    "epsilon,omega\n1,1e999": ":2: omega: expected a finite number, got '1e999'",
    "epsilon,omega\n1,1_0": ":2: omega: expected a finite number, got '1_0'",
    "epsilon,omega\n1,1+2j": ":2: omega: expected a finite number, got '1+2j'",
    "epsilon,omega\n1,2\n3": ":3: expected 2 numbers, got 1",
    "epsilon,omega\n1,2\n3,4,5": ":3: expected 2 numbers, got 3",
    "epsilon,omega\n1,2,3": ":2: expected 2 numbers, got 3",
    "epsilon,omega\n1,": ":2: omega: expected a finite number, got ''",
    "epsilon,omega\n1,2\x00": ":2: omega: expected a finite number, got '2\\x00'",
    "epsilon,ome\x00ga\n1,2": ":1: unknown column 'ome\\x00ga'",
    "epsilon,omega\n1,'2'": ":2: omega: expected a finite number, got \"'2'\"",
    'epsilon,omega\n1,"2': "",
    "epsilon\n" + "9" * 200_000: ": after line 1: not CSV",
    "x" * 200_000: ":1: not CSV",
    "\xff": ":1: unknown column",
}


@pytest.mark.parametrize(("text", "says"), CSV.items(), ids=range(len(CSV)))
def test_csv_that_does_not_fit(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(text, encoding="utf-8")
    if says:
        assert refused(path).startswith(says)


def test_csv_that_is_not_utf_8(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(b"epsilon,omega\n1,2\n3,\xff4")
    assert "not UTF-8" in refused(path)
    path.write_bytes("epsilon,omega\n1,2\n".encode("utf-16"))
    assert "not UTF-8" in refused(path)


def test_csv_as_people_write_it(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(b'\xef\xbb\xbf"lam_2", epsilon ,lam_1\r\n"4", 1e-3 ,5\r\n\r\n6,.5,+7.\r\n')
    found = read_table(path)
    assert found["epsilon"].tolist() == [1e-3, 0.5]
    assert found["lam"].tolist() == [[5, 4], [7, 6]]


def test_a_wide_row_takes_no_memory_for_those_that_may_follow(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("epsilon,lam,omega\n" + ",".join(["1"] * 100_000) + "\n")
    tracemalloc.start()
    assert refused(path) == ":2: expected 3 numbers, got 100000"
    assert tracemalloc.get_traced_memory()[1] < 50_000_000
    tracemalloc.stop()


def test_csv_of_too_many_numbers_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "t.csv"
    path.write_text("epsilon,omega\n" + "1,2\n" * 50)
    monkeypatch.setattr("chainsim.files.sweep_table.MOST_NUMBERS", 99)
    assert "numbers; a table has at most 99; sweep it in parts" in refused(path)
    monkeypatch.setattr("chainsim.files.sweep_table.MOST_NUMBERS", 100)
    assert len(read_table(path)["omega"]) == 50
    with path.open("wb") as file:
        file.truncate(10**12)
    assert "a table has at most 100" in refused(path)


def saved(path: Path, **arrays: Any) -> Path:
    np.savez(path, **arrays)
    return path


ARRAYS: dict[str, tuple[dict[str, object], str]] = {
    "nothing": ({}, ": no rows of epsilon, lam, omega"),
    "empty": ({"omega": np.zeros(0)}, ": no rows"),
    "unknown": ({"omgea": np.ones(3)}, ": unknown array 'omgea'; expected epsilon, lam, omega"),
    "links_apart": (
        {"lam_2": np.ones(3)},
        ": unknown array 'lam_2'; expected epsilon, lam, omega (the links of a chain",
    ),
    "complex": ({"omega": np.ones(3) + 2j}, ": omega: expected real numbers, got complex128; give the real part alone"),
    "text": ({"omega": np.array(["1", "2"])}, ": omega: expected real numbers, got <U1"),
    "objects": ({"omega": np.array([None], dtype=object)}, ": omega: expected real numbers, got object"),
    "truth": ({"omega": np.array([True])}, ": omega: expected real numbers, got bool"),
    "dates": ({"omega": np.array(["2001-01-01"], dtype="M8[D]")}, ": omega: expected real numbers, got datetime64"),
    "records": ({"omega": np.zeros(2, dtype=[("a", "f8")])}, ": not an NPZ of numbers: "),
    "one_number": ({"omega": 1.0}, ": omega: expected one column, got shape ()"),
    "two_columns": ({"omega": np.ones((3, 2))}, ": omega: expected one column, got shape (3, 2)"),
    "deep": ({"lam": np.ones((3, 2, 1))}, ": lam: expected a column, or one for each link, got shape (3, 2, 1)"),
    "lengths": ({"lam": np.ones(3), "omega": np.ones(4)}, ": columns of different lengths: {'lam': 3, 'omega': 4}"),
    "nan": ({"omega": np.array([1, np.nan])}, ": omega: expected finite numbers, got nan in row 1"),
}


@pytest.mark.parametrize(("arrays", "says"), ARRAYS.values(), ids=ARRAYS)
def test_npz_that_does_not_fit(tmp_path: Path, arrays: dict[str, object], says: str) -> None:
    assert refused(saved(tmp_path / "t.npz", **arrays)).startswith(says)


def with_header(path: Path, header: bytes, data: bytes, packed: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", packed) as archive:
        archive.writestr("omega.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + data)
    return path


def of(shape: str) -> bytes:
    return b"{'descr': '<f8', 'fortran_order': False, 'shape': %s, }\n" % shape.encode()


@pytest.mark.parametrize("shape", ["(1000000000000,)", "(3,)", "(-1,)", "(True,)", "(1.0,)", "3", "(" * 5000])
def test_a_header_that_lies_takes_no_memory(tmp_path: Path, shape: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("chainsim.files.sweep_table._numbers", lambda *_: pytest.fail("it was read"))
    assert refused(with_header(tmp_path / "t.npz", of(shape), bytes(16)))


def test_an_archive_that_swells_is_refused_by_its_header(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("chainsim.files.sweep_table._numbers", lambda *_: pytest.fail("it was read"))
    path = with_header(tmp_path / "t.npz", of("(2000000,)"), bytes(16_000_000))
    assert path.stat().st_size < 20_000
    monkeypatch.setattr("chainsim.files.sweep_table.MOST_NUMBERS", 1_999_999)
    assert refused(path) == ": 2000000 numbers; a table has at most 1999999; sweep it in parts"


DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "no_zip": lambda raw: b"words",
    "nothing": lambda raw: b"",
    "cut": lambda raw: raw[: len(raw) // 2],
    "data": lambda raw: raw[:200] + bytes(8) + raw[208:],
}  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_npz_is_one_line(tmp_path: Path, damage: Callable[[bytes], bytes]) -> None:
    path = saved(tmp_path / "t.npz", omega=np.linspace(1, 2, 50))
    raw = damage(path.read_bytes())
    path.write_bytes(raw)
    assert refused(path).startswith(": ")


def test_a_locked_npz_is_one_line(tmp_path: Path) -> None:
    path = saved(tmp_path / "t.npz", omega=np.linspace(1, 2, 50))
    raw = bytearray(path.read_bytes())
    raw[raw.index(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(raw)
    assert refused(path).startswith(": omega: packed in another way than NumPy does")


def test_npz_packed_as_numpy_never_does(tmp_path: Path) -> None:
    path = with_header(tmp_path / "t.npz", of("(2,)"), bytes(16), zipfile.ZIP_LZMA)
    assert refused(path) == ": omega: packed in another way than NumPy does; save it with numpy.savez"


def test_an_array_given_twice(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.ones(2))
    with zipfile.ZipFile(tmp_path / "t.npz", "w") as archive:
        archive.writestr("omega.npy", buffer.getvalue())
        with pytest.warns(UserWarning, match="Duplicate"):
            archive.writestr("omega.npy", buffer.getvalue())
    assert refused(tmp_path / "t.npz") == ": an array is given twice; keep one"


def test_npz_of_any_real_kind(tmp_path: Path) -> None:
    for array in (np.arange(1, 4, dtype="u1"), np.ones(3, dtype=">f4"), np.ones(3, dtype="f2"), np.arange(3)):
        for save in (np.savez, np.savez_compressed):
            save(tmp_path / "t.npz", omega=array, lam=np.asfortranarray(np.arange(6.0).reshape(3, 2)))
            found = read_table(tmp_path / "t.npz")
            assert found["omega"].dtype == np.float64
            assert np.array_equal(found["omega"], array)
            assert found["lam"].tolist() == [[0, 1], [2, 3], [4, 5]]


@pytest.mark.parametrize("name", ["a\0b.csv", "a\0b.npz", "x" * 300 + ".csv", "", ".", "t.txt"])
def test_tables_that_no_file_is(tmp_path: Path, name: str) -> None:
    source = tmp_path / "sweep.yaml"
    source.write_text(CHAIN + f"setting: {{table: {ascii(name)!s}, omega: 1.0}}\n".replace("'", '"'))
    with pytest.raises(ProfileError) as caught:
        read_sweep(source)
    assert "\n" not in str(caught.value)


AXES = {
    "{from: 1, to: 2, steps: 1000000000000}": "at most 10000000 steps, got 1000000000000; take fewer, or sweep a part",
    "{from: -1.0e+308, to: 1.0e+308, steps: 3}": "is too far",
}


@pytest.mark.parametrize(("axis", "says"), AXES.items(), ids=range(len(AXES)))
def test_ranges_that_cannot_be_made(tmp_path: Path, axis: str, says: str) -> None:
    source = tmp_path / "sweep.yaml"
    source.write_text(CHAIN + f"setting:\n  lam: 0.1\n  epsilon: {axis}\n  omega: 1.0\n")
    with pytest.raises(ProfileError, match=r"sweep\.yaml:6: setting\.epsilon\.range: ") as caught:
        read_sweep(source)
    assert says in str(caught.value)


def test_a_product_of_axes_that_is_too_large(tmp_path: Path) -> None:
    source = tmp_path / "sweep.yaml"
    axis = "{from: 1, to: 2, steps: 2000}"
    source.write_text(CHAIN + f"setting: {{epsilon: {axis}, lam: {axis}, omega: {axis}}}\n")
    with pytest.raises(ProfileError, match="2000 x 2000 x 2000 = 8000000000 settings; a sweep has at most 1000000000"):
        read_sweep(source)
    source.write_text(source.read_text().replace("2000", "1000"))
    assert len(read_sweep(source)) == 10**9
