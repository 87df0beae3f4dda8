"""Samples and manifest as one: written whole or not at all, read back, and refused in one line when damaged."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from hypothesis import given, settings, strategies as st

import drivers.waveform.file
from chainsim import Outcome
from drivers import (
    DriverError,
    FileError,
    LimitError,
    UnreadableWaveform,
    Waveform,
    WaveformError,
    WavWriter,
    atomic_file,
    atomic_files,
    read_manifest,
    read_waveform,
    write_waveform,
)
from planner import FramePlan, Plan
from tests.support.plans import NAMES, frames, load, plan_of


@pytest.mark.parametrize("encoding", ["float32", "pcm24"])
@pytest.mark.parametrize("name", NAMES)
def test_what_is_written_is_read_back(tmp_path: Path, name: str, encoding: Any) -> None:
    plan, path = plan_of(name), tmp_path / "hello.wav"
    written = write_waveform(plan, path, encoding=encoding)
    volts = np.concatenate(list(Waveform.of(plan).blocks(500)))
    manifest, reader = read_waveform(path)
    back = np.concatenate(list(reader.blocks(300)))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["hello.json", "hello.wav"]
    assert np.abs(back - volts).max() <= 100 * 2.0**-24 * 1.001
    assert (written.samples, written.frames, written.duration_s) == (3200, 3, 0.4)
    assert written.digest == manifest.digest
    np.testing.assert_array_equal(written.peak_volts, np.abs(volts).max(axis=0))
    slew = np.abs(np.diff(volts, axis=0, prepend=0.0)).max() * 8000
    assert written.peak_slew_v_per_s == pytest.approx(slew, rel=1e-12)
    assert soundfile.info(path).frames == manifest.samples == reader.samples == 3200
    assert manifest.device == plan.device
    assert manifest.channels == Waveform.of(plan).channels
    assert manifest.duration_s == 0.4
    manifest.check_digest(path)


def test_a_manifest_says_what_the_plan_says(tmp_path: Path) -> None:
    plan = plan_of("linked-6x6", encoding={"tables": ["a", "b"], "gap": 1})
    write_waveform(plan, tmp_path / "x.wav")
    manifest, _ = read_waveform(tmp_path / "x.json")
    assert manifest.encoding == {"tables": ["a", "b"], "gap": 1}
    assert [(m.start_s, m.settled_s, m.end_s, m.page, m.text, m.cells, m.span) for m in manifest.frames] == [
        (f.start_s, f.settled_s, f.end_s, f.frame.page, f.frame.text, f.frame.cells, f.frame.span)
        for f in plan.frames
        if f.frame is not None
    ]
    assert [m.outcome for m in manifest.frames] == [Outcome.OK, Outcome.UNREACHABLE, Outcome.OK]
    np.testing.assert_allclose(manifest.frames[0].target, np.full((6, 6), 1 / 3), rtol=1e-12)
    np.testing.assert_array_equal([mark.wish.level[0, 0] for mark in manifest.frames], [1, 0, 1])
    np.testing.assert_array_equal(manifest.frames[0].omega, [1.25] * 6)
    assert not manifest.frames[0].target.flags.writeable
    lam = manifest.lam_at(np.array([0.0, 0.02, 0.05, 0.11, 0.39]))
    assert lam.shape == (5, 6, 6)
    assert np.all(lam[:, :, 0] == 0)
    np.testing.assert_allclose(lam[:, 2, 3], [0, 1 / 6, 1 / 3, 1 / 3 - 1 / 48, 1 / 4], atol=1e-12)


def test_the_manifest_has_the_keys_of_the_design(tmp_path: Path) -> None:
    write_waveform(plan_of("paper-6x6"), tmp_path / "x.wav")
    data = json.loads((tmp_path / "x.json").read_text(encoding="utf-8"))
    keys = "schema samples_file rate_hz samples digest device channels coupling frames encoding"
    assert list(data) == keys.split()
    assert data["schema"] == "dotwave/waveform/1"
    assert data["samples_file"] == "x.wav"
    assert data["channels"][0] == {"index": 0, "role": "drive", "row": 0, "volts_per_unit": 100.0}
    assert data["channels"][6] == {"index": 6, "role": "bias", "row": 0, "col": 0, "volts_per_unit": 100.0}
    assert {"rows", "cols", "f0_hz", "delta", "beta", "full_scale"} <= set(data["device"])
    assert list(data["coupling"][0]) == ["t_s", "row", "lam", "ramp_s"]
    keys = "start_s settled_s end_s moving omega target wish cells text outcome page span"
    assert list(data["frames"][0]) == keys.split()
    assert "«0»" in (tmp_path / "x.json").read_text(encoding="utf-8")


def test_a_pattern_of_chains_lies_row_by_row_in_the_target(tmp_path: Path) -> None:
    device = load("linked-40x96")
    (one, *_) = frames(device, 1)
    row = np.arange(6, dtype=np.float64)
    states = tuple(replace(state, target=row + 6.0 * k) for k, state in enumerate(one.states))
    out = replace(one, states=states)
    write_waveform(Plan(device, [out], {}), tmp_path / "x.wav")
    target = read_manifest(tmp_path / "x.json").frames[0].target
    np.testing.assert_array_equal(target, np.arange(40 * 96.0).reshape(40, 96))


def test_chains_of_a_row_share_one_omega_or_are_refused(tmp_path: Path) -> None:
    device = load("independent-6x6")
    (one, *_) = frames(device, 1)
    still = replace(one.states[0], epsilon=0j, omega=1.0)
    write_waveform(Plan(device, [replace(one, states=(still, *one.states[1:]))], {}), tmp_path / "x.wav")
    np.testing.assert_array_equal(read_manifest(tmp_path / "x.json").frames[0].omega, [1.25] * 6)
    other = replace(one.states[0], omega=1.1)
    with pytest.raises(WaveformError, match=r"frame 0, row 0: .* omega \[1.1, 1.25\]"):
        write_waveform(Plan(device, [replace(one, states=(other, *one.states[1:]))], {}), tmp_path / "y.wav")


@pytest.mark.parametrize("encoding", ["float32", "pcm24"])
def test_the_same_plan_gives_the_same_bytes_for_any_block(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, encoding: Any
) -> None:
    plan, found = plan_of("paper-6x6"), set()
    for index, block in enumerate((4096, 4096, 1, 777, 10**6)):
        folder = tmp_path / str(index)
        folder.mkdir()
        monkeypatch.setattr(drivers.waveform.file, "BLOCK", block)
        write_waveform(plan, folder / "x.wav", encoding=encoding)
        found.add(((folder / "x.wav").read_bytes(), (folder / "x.json").read_bytes()))
    assert len(found) == 1


def test_no_frames_make_an_empty_waveform(tmp_path: Path) -> None:
    write_waveform(Plan(load("paper-6x6"), [], {}), tmp_path / "x.wav")
    manifest, reader = read_waveform(tmp_path / "x.wav")
    assert (manifest.samples, manifest.frames, list(reader.blocks(10))) == (0, (), [])
    assert np.all(manifest.lam_at(np.array([0.0, 1.0])) == 0)


@settings(deadline=None, max_examples=30)
# Half a surrogate pair is in no frame: sources refuse it.
@given(st.text(max_size=20) | st.text(st.characters(categories=["Cc", "Lo"]), max_size=5), st.floats(0, 1e3))
def test_any_text_and_number_survives_the_manifest(
    tmp_path_factory: pytest.TempPathFactory, text: str, number: float
) -> None:
    path = tmp_path_factory.mktemp("text") / "x.wav"
    device = load("linked-6x6")
    one = next(frames(device, 1))
    assert one.frame is not None
    states = tuple(replace(state, target=np.full(6, number)) for state in one.states)
    write_waveform(Plan(device, [replace(one, frame=replace(one.frame, text=text), states=states)], {}), path)
    (mark,) = read_manifest(path.with_suffix(".json")).frames
    assert mark.text == text
    np.testing.assert_allclose(mark.target, number, rtol=1e-11)


def test_progress_counts_the_seconds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drivers.waveform.file, "BLOCK", 1600)
    seen: list[float] = []
    write_waveform(plan_of("linked-6x6"), tmp_path / "x.wav", progress=seen.append)
    assert seen == [0.2, 0.4]


@pytest.mark.slow
def test_a_long_write_takes_no_more_memory_than_a_short_one(tmp_path: Path) -> None:
    device = load("paper-6x6")

    def peak(count: int) -> int:
        tracemalloc.start()
        try:
            write_waveform(Plan(device, frames(device, count, dwell_s=0.05), {}), tmp_path / "x.wav")
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    peak(3)
    assert peak(1000) < peak(100) + 200_000
    assert len(read_manifest(tmp_path / "x.json").frames) == 100


# Nothing partial


def stop_at_second_block(error: BaseException) -> Callable[[float], None]:
    calls: list[float] = []

    def progress(seconds: float) -> None:
        calls.append(seconds)
        if len(calls) == 2:
            raise error

    return progress


@pytest.mark.parametrize("before", [{}, {"x.wav": b"old", "x.json": b"older"}])
@pytest.mark.parametrize("error", [KeyboardInterrupt(), SystemExit(143), RuntimeError("x"), MemoryError()])
def test_an_interrupted_write_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException, before: dict[str, bytes]
) -> None:
    monkeypatch.setattr(drivers.waveform.file, "BLOCK", 500)
    for name, content in before.items():
        (tmp_path / name).write_bytes(content)
    with pytest.raises(type(error)):
        write_waveform(plan_of("linked-6x6"), tmp_path / "x.wav", progress=stop_at_second_block(error))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_over_the_limit_leaves_no_file(tmp_path: Path) -> None:
    device = load("linked-6x6")
    *_, last = frames(device, 2)
    loud = replace(last, states=(*last.states[:4], replace(last.states[4], epsilon=0.21 + 0j), last.states[5]))
    with pytest.raises(LimitError, match=r"channel 4 \(drive, row 4\): .* over the amplifier's 100 V"):
        write_waveform(Plan(device, [*frames(device, 1), loud], {}), tmp_path / "x.wav")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.ENOSPC, r"x\.wav: the disk is full; free some space"),
        (errno.EDQUOT, r"x\.wav: your disk quota is used up"),
        (errno.EIO, r"x\.wav: Input/output error"),
    ],
)
def test_a_disk_that_refuses_in_mid_write_is_one_line_and_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, words: str
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(WavWriter, "write", refuse)
    with pytest.raises(FileError, match=words) as caught:
        write_waveform(plan_of("linked-6x6"), tmp_path / "x.wav")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


FILLS = """
import sys
sys.path.insert(0, {root!r})
import resource
from planner import FramePlan, Plan
from tests.support.plans import plan_of
from drivers import FileError, write_waveform
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
try:
    write_waveform(plan_of({name!r}), {path!r})
except FileError as error:
    print(error)
"""


@pytest.mark.parametrize(("name", "limit", "suffix"), [("paper-6x6", 40_000, "wav"), ("linked-6x6", 78_000, "json")])
def test_the_kernel_itself_may_refuse(tmp_path: Path, name: str, limit: int, suffix: str) -> None:
    if suffix == "json":  # short of samples, longer than the manifest: give the manifest the longer file
        write_waveform(plan_of(name, encoding={"long": "x" * 90_000}), tmp_path / "x.wav")
        assert (tmp_path / "x.wav").stat().st_size < limit < (tmp_path / "x.json").stat().st_size
        before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    else:
        before = {}
    code = FILLS.format(root=str(Path(__file__).parents[2]), limit=limit, name=name, path=str(tmp_path / "x.wav"))
    if suffix == "json":
        code = code.replace(f"plan_of({name!r})", f"plan_of({name!r}, encoding={{'long': 'x' * 90_000}})")
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.stderr == ""
    assert run.stdout.count("\n") == 1
    assert f"x.{suffix}: the file grows past what may be written here" in run.stdout
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


def test_a_really_full_disk(tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", str(disk)]
    if os.geteuid() or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("only where a small tmpfs can be mounted")
    try:
        with pytest.raises(FileError, match=r"x\.wav: the disk is full"):
            write_waveform(plan_of("paper-6x6"), disk / "x.wav")
        assert list(disk.iterdir()) == []
        with pytest.raises(FileError, match=r"x\.json: the disk is full"):
            write_waveform(plan_of("linked-6x6", encoding={"long": "x" * 150_000}), disk / "x.wav")
        assert list(disk.iterdir()) == []
    finally:
        subprocess.run(["umount", str(disk)], check=True)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("file/x.wav", r"file is not a folder"),
        ("folder.wav", r"folder\.wav: this is a folder"),
        ("x.mp3", r"x\.mp3: expected a name that ends in \.wav"),
        ("x", r"x: expected a name that ends in \.wav"),
        ("x" * 300 + ".wav", "File name too long"),
        ("other.wav", r"other\.json: this is a folder"),
    ],
)
def test_a_path_that_cannot_be_is_refused_before_any_frame_is_drawn(tmp_path: Path, name: str, words: str) -> None:
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "folder.wav").mkdir()
    (tmp_path / "other.json").mkdir()
    before = sorted(tmp_path.iterdir())

    def never() -> Iterator[FramePlan]:
        raise AssertionError("drawn")
        yield

    with pytest.raises(FileError, match=words):
        write_waveform(Plan(load("linked-6x6"), never(), {}), tmp_path / name)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("number", "words"), [(errno.EACCES, "no permission in folder"), (errno.EROFS, "is on a read-only file system")]
)
def test_a_read_only_folder_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, words: str) -> None:
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    plan = plan_of("linked-6x6")
    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(FileError, match=words):
        write_waveform(plan, tmp_path / "x.wav")
    assert list(tmp_path.iterdir()) == []


def test_an_error_of_the_planner_is_not_blamed_on_the_output(tmp_path: Path) -> None:
    def broken() -> Iterator[FramePlan]:
        yield from frames(load("linked-6x6"), 1)
        raise OSError(errno.ENOSPC, "cache")

    with pytest.raises(OSError, match="cache") as caught:
        write_waveform(Plan(load("linked-6x6"), broken(), {}), tmp_path / "x.wav")
    assert not isinstance(caught.value, DriverError)
    assert list(tmp_path.iterdir()) == []


def test_atomic_files_are_out_of_sight_until_all_are_done(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    with atomic_files(one, two) as (a, b):
        a.write(b"1")
        b.write(b"2")
        assert not one.exists()
        assert not two.exists()
    assert (one.read_bytes(), two.read_bytes()) == (b"1", b"2")
    with atomic_file(one) as a:
        a.write(b"3")
    assert one.read_bytes() == b"3"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["one", "two"]


def test_when_the_second_cannot_be_put_in_place_the_first_is_not_either(tmp_path: Path) -> None:
    (tmp_path / "one").write_bytes(b"old")
    with pytest.raises(FileError, match="two"), atomic_files(tmp_path / "one", tmp_path / "two"):
        (tmp_path / "two").mkdir()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["one", "two"]
    assert (tmp_path / "one").read_bytes() == b"old"


def test_an_encoding_that_is_not_json_is_refused(tmp_path: Path) -> None:
    for value in (object(), float("nan")):
        with pytest.raises(WaveformError, match=r"plan\.encoding: .* plain JSON"):
            write_waveform(plan_of("linked-6x6", encoding={"x": value}), tmp_path / "x.wav")
    assert list(tmp_path.iterdir()) == []


# Damaged files


def edited(tmp_path: Path, change: Callable[[Any], object]) -> Path:
    write_waveform(plan_of("linked-6x6"), tmp_path / "hello.wav")
    path = tmp_path / "hello.json"
    data = json.loads(path.read_text(encoding="utf-8"))
    change(data)
    path.write_text(json.dumps(data), encoding="utf-8")
    return path


def put(place: str, value: object) -> Callable[[Any], object]:
    """Set the item at a place such as ``frames.1.start_s``."""

    def change(data: Any) -> None:
        *way, last = [int(part) if part.isdigit() else part for part in place.split(".")]
        for part in way:
            data = data[part]
        data[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda data: data.pop("digest"), "digest: this key is required and missing"),
        (put("schema", "dotwave/waveform/2"), "schema: "),
        (put("rate_hz", "8000"), "rate_hz: .* got '8000'"),
        (put("rate_hz", 4000), "rate_hz: 4000, but hello.wav has 8000"),
        (put("samples", 3199), "samples: 3199, but hello.wav has 3200"),
        (put("samples", 10), r"frames\[2\]\.end_s: .* after the last of the samples"),
        (put("samples_file", "../hello.wav"), "samples_file: expected a name without folders"),
        (put("samples_file", "a\0.wav"), "samples_file: expected a name without folders"),
        (put("samples_file", "hello.mp3"), r"samples_file: expected a name that ends in \.wav, .*, got 'hello.mp3'"),
        (put("samples_file", "x" * 10**5), "samples_file: expected a name that ends in .*, got 'x{56}"),
        (put("rate_hz", 10**400), "rate_hz: expected a number <= 10000000, got 1000"),
        (put("samples", 10**30), "samples: expected a number <= 1152921504606846976, got 1000"),
        (put("frames.1.start_s", 1e300), r"frames\[1\]\.start_s: expected a number <= 1000000000000.0, got 1e\+300"),
        (put("channels", []), "channels: expected 1 items or more, got 0"),
        (put("frames.0.text", "\ud800"), r"frames\[0\]\.text: expected text of whole characters"),
        (put("device.a\nb", 1), r"device\.'a\\nb': unknown key"),
        (put("device.f0_hz", -1), r"device\.f0_hz: expected a number > 0.0, got -1"),
        (put("digest", "md5:0"), "digest: "),
        (put("device.rows", 0), r"device\.rows: "),
        (put("frames.2.target", [[0.0] * 6] * 5), r"frames\[2\]\.target: expected 6 rows of 6 numbers"),
        (put("frames.2.target.1.3", "x"), r"frames\[2\]\.target\[1\]\[3\]: .* got 'x'"),
        (put("frames.0.omega", [1.0]), r"frames\[0\]\.omega: expected 6 numbers"),
        (put("frames.0.outcome", "fine"), r"frames\[0\]\.outcome: "),
        (put("frames.1.settled_s", 0.01), r"frames\[1\]: start_s 0.1, settled_s 0.01"),
        (put("frames.1.start_s", 0.05), r"frames\[1\]\.start_s: 0.05 s is before the frame ahead ends, at 0.1 s"),
        (put("coupling.3.lam", [0.1]), r"coupling\[3\]\.lam: expected 5 numbers, got 1"),
        (put("coupling.3.row", 6), r"coupling\[3\]\.row: expected 0 to 5, got 6"),
        (put("coupling.8.t_s", 1e6), r"coupling\[\d+\]\.t_s: .* is before the event ahead of it"),
        (put("channels.2.index", 5), r"channels\[2\]\.index: expected 2, got 5"),
        (put("channels.2.row", 1), r"channels\[2\]: a second channel"),
        (put("channels.2.role", "bias"), r"channels\[2\]\.col: a bias channel needs a col"),
        (put("channels.2.col", 3), r"channels\[2\]\.col: no chain begins at col 3"),
        (put("channels.2.col", 6), r"channels\[2\]\.col: expected 0 to 5"),
        (put("channels.2.volts_per_unit", 0), r"channels\[2\]\.volts_per_unit: "),
        (lambda data: data["channels"].pop(), "6 channels where 5 are wanted"),
    ],
)
def test_a_damaged_manifest_is_refused_with_the_place(
    tmp_path: Path, change: Callable[[Any], object], words: str
) -> None:
    path = edited(tmp_path, change)
    with pytest.raises(UnreadableWaveform, match=words) as caught:
        read_waveform(path)
    assert "\n" not in str(caught.value)
    assert "hello." in str(caught.value)


@pytest.mark.parametrize(
    "raw", [b"", b"\xff\xfe", b"[1]", b"{", b'{"schema": NaN}', b"[" * 100_000, b'{"samples": ' + b"9" * 5000 + b"}"]
)
def test_what_is_not_a_manifest_is_refused(tmp_path: Path, raw: bytes) -> None:
    (tmp_path / "x.json").write_bytes(raw)
    with pytest.raises(UnreadableWaveform, match=r"x\.json: "):
        read_manifest(tmp_path / "x.json")


def test_keys_of_later_versions_are_passed_over(tmp_path: Path) -> None:
    assert read_manifest(edited(tmp_path, put("marks", [1]))).samples == 3200


def test_a_pair_must_belong_together(tmp_path: Path) -> None:
    write_waveform(plan_of("linked-6x6"), tmp_path / "a.wav")
    raw = (tmp_path / "a.wav").read_bytes()
    (tmp_path / "a.wav").write_bytes(raw[:-1] + bytes([raw[-1] ^ 1]))
    manifest, reader = read_waveform(tmp_path / "a.wav")
    with pytest.raises(UnreadableWaveform, match=r"a\.wav: its digest is sha256:.* was changed"):
        manifest.check_digest(reader.path)
    (tmp_path / "a.wav").rename(tmp_path / "b.wav")
    with pytest.raises(FileError, match=r"a\.wav: no such file"):
        read_waveform(tmp_path / "a.json")
    with pytest.raises(FileError, match=r"b\.json: no such file"):
        read_waveform(tmp_path / "b.wav")
    (tmp_path / "a.json").rename(tmp_path / "b.json")
    with pytest.raises(UnreadableWaveform, match=r"b\.json: samples_file: it belongs to a\.wav, not b\.wav"):
        read_waveform(tmp_path / "b.wav")


def test_importing_the_drivers_is_cheap() -> None:
    code = (
        "import sys, drivers; print([m for m in ('numba', 'scipy', 'matplotlib', 'PIL', 'louis') if m in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
