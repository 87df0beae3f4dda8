"""Every file format of samples: one body of tests for all, and what each loses."""

import tracemalloc
import zipfile

import numpy as np
import pytest

from chainsim import load_device
from drivers import SUFFIXES, FileError, UnreadableWaveform, Waveform, WaveformError, read_waveform, write_waveform
from drivers.channels import Channel, Role
from drivers.formats.npz import NpzReader
from drivers.formats.raw import RawReader
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import plan_scene

# What a value may be off by, relative to the volts of a full scale.
ONE_CHANNEL = [Channel(0, Role.DRIVE, 0, None, 100.0)]
LOSES = {".wav": 2.0**-24, ".npz": 0.0, ".csv": 0.5e-8, ".raw": 2.0**-24}


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path / "cache"))


def plan(device="linked-6x6", frames=3):
    rng = np.random.default_rng(1)
    shown = [Frame(TargetPattern((rng.random((6, 6)) < 0.5).astype(complex)), 0.6, page=k) for k in range(frames)]
    return plan_scene(Scene(GridShape(6, 6), shown), load_device(device))


def samples(path, block=1000):
    manifest, reader = read_waveform(path)
    manifest.check_digest(reader.path)
    return np.concatenate(list(reader.blocks(block)))


def test_every_format_has_its_loss_stated():
    assert set(LOSES) == set(SUFFIXES)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("device", ["linked-6x6", "paper-6x6"])
def test_what_is_written_is_read(tmp_path, suffix, device):
    out = tmp_path / f"x{suffix}"
    written = write_waveform(plan(device), out)
    exact = np.concatenate(list(Waveform.of(plan(device)).blocks(777)))
    for path in (out, out.with_suffix(".json")):
        back = samples(path)
        assert back.shape == exact.shape == (written.samples, len(written.peak_volts))
        assert np.abs(back - exact).max() <= LOSES[suffix] * 100
    assert (np.abs(back - exact).max() == 0) == (suffix == ".npz")
    assert np.array_equal(samples(out, 1), back) if len(back) < 3000 else np.array_equal(samples(out, 4097), back)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_same_plan_same_bytes(tmp_path, suffix):
    for name in "ab":
        (tmp_path / name).mkdir()
        write_waveform(plan(), tmp_path / name / f"x{suffix}")
    for end in (suffix, ".json"):
        assert (tmp_path / "a" / f"x{end}").read_bytes() == (tmp_path / "b" / f"x{end}").read_bytes()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_cut_short_is_refused(tmp_path, suffix):
    out = tmp_path / f"x{suffix}"
    write_waveform(plan(frames=1), out)
    whole = out.read_bytes()
    for kept in (0, 7, len(whole) // 2, len(whole) - 3):
        out.write_bytes(whole[:kept])
        with pytest.raises(UnreadableWaveform) as caught:
            samples(out)
        assert str(tmp_path) in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", [".npz", ".csv", ".raw"])
def test_only_wav_has_other_encodings(tmp_path, suffix):
    with pytest.raises(WaveformError, match="pcm24"):
        write_waveform(plan(frames=1), tmp_path / f"x{suffix}", encoding="pcm24")
    assert [path.name for path in tmp_path.iterdir() if path.name != "cache"] == []


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(FileError, match=r"\.wav, \.npz, \.csv, \.raw"):
        write_waveform(plan(), tmp_path / "x.mp3")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_memory_does_not_grow_with_the_length(tmp_path, suffix):
    peaks = []
    for frames in (2, 12):
        tracemalloc.start()
        write_waveform(plan("independent-6x6", frames), tmp_path / f"x{suffix}")
        for _ in read_waveform(tmp_path / f"x{suffix}")[1].blocks(4096):
            pass
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.5 * peaks[0] + 2e6


def test_numpy_reads_the_npz_and_the_raw(tmp_path):
    write_waveform(plan(), tmp_path / "x.npz")
    write_waveform(plan(), tmp_path / "x.raw")
    with np.load(tmp_path / "x.npz", allow_pickle=False) as archive:
        assert int(archive["rate_hz"]) == 24000
        volts = archive["volts"]
    raw = np.fromfile(tmp_path / "x.raw", dtype="<f4").reshape(-1, 6)
    np.testing.assert_allclose(raw * 100, volts, atol=1e-5)


def test_a_csv_edited_by_hand_names_the_line(tmp_path):
    out = tmp_path / "x.csv"
    write_waveform(plan(frames=1), out)
    lines = out.read_text().splitlines(keepends=True)
    assert lines[0].startswith("time_s,drive r0 (V),")
    for number, line, says in (
        (5, "1,2\n", "x.csv:6"),
        (9, "9,0,0,0,0,0,0\n", "x.csv:10"),
        (3, "0,a,0,0,0,0,0\n", "line"),
    ):
        out.write_text("".join([*lines[:number], line, *lines[number + 1 :]]))
        with pytest.raises(UnreadableWaveform, match=says):
            list(read_waveform(out)[1].blocks(100))


def archived(path, volts, rate, packed=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", packed) as archive:
        archive.writestr("volts.npy", volts)
        archive.writestr("rate_hz.npy", rate)
    return path


def npy(shape, data=b"", descr="<f8"):
    header = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + data


RATE = npy("()", (8000).to_bytes(8, "little"), "<i8")
NOT_VOLTS = {
    "shape_below_0": (npy("(-5, 1)"), RATE),
    "nested_header": (npy("(" * 5000), RATE),
    "records": (npy("(1, 1)", bytes(8), "V8"), RATE),
    "rate_of_a_million_million": (npy("(1, 1)", bytes(8)), npy("(1000000000000,)", b"", "<i8")),
    "rate_0": (npy("(1, 1)", bytes(8)), npy("()", bytes(8), "<i8")),
    "rate_cut": (npy("(1, 1)", bytes(8)), npy("()", bytes(7), "<i8")),
    "rate_of_text": (npy("(1, 1)", bytes(8)), npy("()", bytes(8), "<U2")),
    "no_array": (b"words", RATE),
}


@pytest.mark.parametrize(("volts", "rate"), NOT_VOLTS.values(), ids=NOT_VOLTS)
def test_an_npz_of_something_else_is_refused_by_its_headers(tmp_path, volts, rate):
    with pytest.raises(UnreadableWaveform, match=r"x\.npz: "):
        NpzReader.open(archived(tmp_path / "x.npz", volts, rate), ONE_CHANNEL, 8000)


def test_a_damaged_npz_is_refused_where_it_is_read(tmp_path):
    data = np.random.default_rng(0).normal(size=4000)
    path = archived(tmp_path / "x.npz", npy("(4000, 1)", data.tobytes()), RATE, zipfile.ZIP_DEFLATED)
    assert np.array_equal(np.concatenate(list(NpzReader.open(path, ONE_CHANNEL, 8000).blocks(300)))[:, 0], data)
    raw = bytearray(path.read_bytes())
    raw[2000:2200] = bytes(200)
    path.write_bytes(raw)
    with pytest.raises(UnreadableWaveform, match=r"x\.npz: "):
        list(NpzReader.open(path, ONE_CHANNEL, 8000).blocks(300))
    longer = archived(tmp_path / "x.npz", npy("(10000000000000, 1)", data.tobytes()), RATE)
    with pytest.raises(UnreadableWaveform, match="ends early"):
        list(NpzReader.open(longer, ONE_CHANNEL, 8000).blocks(300))


def test_volts_beyond_all_numbers_are_refused(tmp_path):
    """A stored 3e38 of 1e300 volts each."""
    channels = [Channel(0, Role.DRIVE, 0, None, 1e300)]
    (tmp_path / "x.raw").write_bytes(np.full(3, 3e38, dtype="<f4").tobytes())
    with pytest.raises(UnreadableWaveform, match=r"x\.raw: channel 0 at 0 s is inf"):
        list(RawReader.open(tmp_path / "x.raw", channels, 8000).blocks(3))


@pytest.mark.slow
def test_an_hour_is_streamed_in_the_memory_of_a_minute():
    """42 channels at 8 kHz, a new page every second out of eight."""
    rng = np.random.default_rng(1)
    pages = [TargetPattern((rng.random((6, 6)) < 0.5).astype(complex)) for _ in range(8)]
    peaks = []
    for minutes in (1, 60):
        shown = [Frame(pages[k % 8], 1.0, page=k) for k in range(60 * minutes)]
        waveform = Waveform.of(plan_scene(Scene(GridShape(6, 6), shown), load_device("paper-6x6")))
        tracemalloc.start()
        assert sum(len(block) for block in waveform.blocks(4096)) >= minutes * 60 * 8000
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.1 * peaks[0] + 1e6
