"""Every file format of samples: one body of tests for all, and what each loses."""

import tracemalloc

import numpy as np
import pytest

from chainsim import load_device
from drivers import SUFFIXES, FileError, UnreadableWaveform, Waveform, WaveformError, read_waveform, write_waveform
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import plan_scene

# What a value may be off by, relative to the volts of a full scale.
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
    for frames in (4, 24):
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
