"""WAV writer and reader: against soundfile and scipy, against each other, and against damaged files."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np
import pytest
import soundfile
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy.io import wavfile

from drivers import Channel, DriverError, LimitError, Role, UnreadableWaveform, WavReader, WavWriter
from drivers.formats.wav import RIFF_LIMIT

RATE = 8000
VOLTS = 100.0


def channels(count: int, volts: float = VOLTS) -> tuple[Channel, ...]:
    return tuple(Channel(index, Role.DRIVE, index, None, volts) for index in range(count))


def wav_bytes(volts: NDArray[np.float64], encoding: str, riff_limit: int = RIFF_LIMIT, block: int = 7) -> bytes:
    file = io.BytesIO()
    writer = WavWriter(file, channels(volts.shape[1]), RATE, encoding, riff_limit=riff_limit)  # type: ignore[arg-type]
    for first in range(0, len(volts), block):
        writer.write(volts[first : first + block])
    writer.finish()
    return file.getvalue()


def noise(samples: int, count: int, seed: int = 1) -> NDArray[np.float64]:
    return np.random.default_rng(seed).uniform(-99.9, 99.9, (samples, count))


def read_all(path: Path, volts: float = VOLTS, block: int = 5) -> NDArray[np.float64]:
    return np.concatenate(list(WavReader.open(path, volts).blocks(block)))


@pytest.mark.parametrize("riff_limit", [RIFF_LIMIT, 0])
@pytest.mark.parametrize(("encoding", "subtype"), [("float32", "FLOAT"), ("pcm24", "PCM_24")])
@pytest.mark.parametrize(("samples", "count"), [(100, 1), (101, 3), (33, 42)])
def test_soundfile_and_scipy_read_what_is_written(
    tmp_path: Path, encoding: str, subtype: str, samples: int, count: int, riff_limit: int
) -> None:
    volts, path = noise(samples, count), tmp_path / "x.wav"
    path.write_bytes(wav_bytes(volts, encoding, riff_limit))
    info = soundfile.info(path)
    assert (info.channels, info.samplerate, info.frames, info.subtype) == (count, RATE, samples, subtype)
    assert info.format == ("RF64" if riff_limit == 0 else "WAVEX")
    ours = read_all(path)
    np.testing.assert_array_equal(soundfile.read(path, always_2d=True)[0] * VOLTS, ours)
    rate, theirs = wavfile.read(path)
    scale = 1.0 if encoding == "float32" else 2.0**-31
    assert rate == RATE
    np.testing.assert_array_equal(theirs.astype(np.float64).reshape(samples, count) * scale * VOLTS, ours)


@pytest.mark.parametrize("encoding", ["float32", "pcm24"])
def test_the_header_says_no_speaker_positions_and_true_sizes(encoding: str) -> None:
    raw = wav_bytes(noise(3, 1), encoding)
    size = {"float32": 4, "pcm24": 3}[encoding]
    assert raw[:4] == b"RIFF"
    assert raw[8:16] == b"WAVEJUNK"
    assert struct.unpack("<I", raw[4:8])[0] == len(raw) - 8
    assert len(raw) % 2 == 0
    tag, count, rate, byte_rate, align, bits, extra, valid, mask = struct.unpack("<HHIIHHHHI", raw[56:80])
    assert (tag, count, rate, byte_rate, align) == (0xFFFE, 1, RATE, RATE * size, size)
    assert (bits, extra, valid, mask) == (8 * size, 22, 8 * size, 0)
    assert raw[96:108] == b"fact" + struct.pack("<II", 4, 3)
    assert raw[108:116] == b"data" + struct.pack("<I", 3 * size)


def test_beyond_the_riff_limit_the_true_sizes_stand_in_ds64() -> None:
    volts = noise(10, 2)
    plain, large = wav_bytes(volts, "float32"), wav_bytes(volts, "float32", riff_limit=8)
    assert len(plain) == len(large)
    assert plain[116:] == large[116:]
    assert large[:20] == b"RF64\xff\xff\xff\xffWAVEds64" + struct.pack("<I", 28)
    assert struct.unpack("<QQQI", large[20:48]) == (len(large) - 8, 80, 10, 0)
    limit = len(plain) - 8
    assert wav_bytes(volts, "float32", riff_limit=limit)[:4] == b"RIFF"
    assert wav_bytes(volts, "float32", riff_limit=limit - 1)[:4] == b"RF64"


@settings(deadline=None)
@given(
    st.sampled_from(["float32", "pcm24"]),
    st.integers(1, 9),
    st.integers(0, 40),
    st.integers(1, 50),
    st.integers(0, 2**32 - 1),
)
def test_round_trip_loses_what_is_stated(
    tmp_path_factory: pytest.TempPathFactory, encoding: str, count: int, samples: int, block: int, seed: int
) -> None:
    volts = noise(samples, count, seed)
    path = tmp_path_factory.mktemp("wav") / "x.wav"
    raw = wav_bytes(volts, encoding, block=block)
    assert raw == wav_bytes(volts, encoding, block=samples + 1)
    path.write_bytes(raw)
    reader = WavReader.open(path, VOLTS)
    assert (reader.channels, reader.samples, reader.rate_hz, reader.encoding) == (count, samples, RATE, encoding)
    back = np.concatenate([np.empty((0, count)), *reader.blocks(block)])
    # float32: half an ulp of 24 bits, relative; PCM24: half a step of VOLTS / 2^23. The factor allows for
    # the rounding of the division and the product by VOLTS.
    lost = {"float32": np.abs(volts) * 2.0**-24, "pcm24": np.full(volts.shape, VOLTS * 2.0**-24)}[encoding]
    assert np.all(np.abs(back - volts) <= lost * (1 + 1e-6) + 1e-13)


@pytest.mark.parametrize(
    ("volts", "fits"),
    [(VOLTS * (1 - 2.0**-23), True), (VOLTS, False), (VOLTS * (1 - 2.0**-25), False), (-VOLTS, True), (-100.1, False)],
)
def test_pcm24_refuses_what_it_cannot_hold(volts: float, fits: bool) -> None:
    block = np.zeros((9, 2))
    block[8, 1] = volts
    if fits:
        assert wav_bytes(block, "pcm24")
        return
    with pytest.raises(LimitError, match=r"channel 1 \(drive, row 1\): .* V at 0.001 s .* PCM24") as caught:
        wav_bytes(block, "pcm24")
    assert caught.value.channel.index == 1
    assert caught.value.time_s == 8 / RATE
    assert caught.value.limit == VOLTS * (1 - 2.0**-23)


def test_channels_a_header_cannot_say_and_unknown_encodings_are_refused() -> None:
    with pytest.raises(DriverError, match="20000 channels"):
        WavWriter(io.BytesIO(), channels(20000), RATE, "float32")
    with pytest.raises(DriverError, match="expected float32 or pcm24, got 'mp3'"):
        WavWriter(io.BytesIO(), channels(1), RATE, "mp3")  # type: ignore[arg-type]


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize(
    ("form", "subtype", "encoding"),
    [
        ("WAV", "PCM_16", "pcm16"),
        ("WAV", "PCM_24", "pcm24"),
        ("WAV", "PCM_32", "pcm32"),
        ("WAV", "FLOAT", "float32"),
        ("WAV", "DOUBLE", "float64"),
        ("WAVEX", "PCM_24", "pcm24"),
        ("WAVEX", "FLOAT", "float32"),
        ("RF64", "PCM_16", "pcm16"),
        ("RF64", "PCM_24", "pcm24"),
        ("RF64", "FLOAT", "float32"),
    ],
)
def test_files_of_soundfile_are_read(tmp_path: Path, form: str, subtype: str, encoding: str, count: int) -> None:
    path = tmp_path / "x.wav"
    soundfile.write(path, noise(101, count) / VOLTS, RATE, format=form, subtype=subtype)
    reader = WavReader.open(path, VOLTS)
    assert reader.encoding == encoding
    np.testing.assert_array_equal(read_all(path), soundfile.read(path, always_2d=True)[0] * VOLTS)


def test_volts_per_unit_may_differ_between_channels(tmp_path: Path) -> None:
    path = tmp_path / "x.wav"
    path.write_bytes(wav_bytes(np.full((2, 3), 50.0), "float32"))
    (block,) = WavReader.open(path, [1.0, 2.0, 4.0]).blocks(10)
    np.testing.assert_array_equal(block, [[0.5, 1.0, 2.0]] * 2)
    with pytest.raises(UnreadableWaveform, match="3 channels where 2 are wanted"):
        WavReader.open(path, [1.0, 2.0])


def test_every_cut_and_every_addition_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "x.wav"
    for raw in (wav_bytes(noise(5, 2), "pcm24"), wav_bytes(noise(5, 1), "float32", riff_limit=0)):
        for length in range(len(raw)):
            path.write_bytes(raw[:length])
            with pytest.raises(UnreadableWaveform, match=r"x\.wav: not a readable WAV"):
                WavReader.open(path)
        path.write_bytes(raw + b"\0")
        with pytest.raises(UnreadableWaveform, match="cut short or added to"):
            WavReader.open(path)


def test_a_file_that_shrinks_while_it_is_read_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "x.wav"
    raw = wav_bytes(noise(50, 2), "float32")
    path.write_bytes(raw)
    reader = WavReader.open(path)
    path.write_bytes(raw[:-80])
    with pytest.raises(UnreadableWaveform, match="ends early, at sample 40 of 50"):
        list(reader.blocks(20))


def test_a_value_that_is_not_finite_is_refused_with_its_place(tmp_path: Path) -> None:
    volts, path = noise(20, 3), tmp_path / "x.wav"
    volts[16, 2] = np.nan
    path.write_bytes(wav_bytes(volts, "float32"))
    with pytest.raises(UnreadableWaveform, match=r"channel 2 at 0\.002 s is nan"):
        list(WavReader.open(path).blocks(6))


@settings(deadline=None, max_examples=300)
@given(st.data())
def test_no_bytes_make_the_reader_crash(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    whole = bytearray(wav_bytes(noise(4, 2), "float32", riff_limit=data.draw(st.sampled_from([0, RIFF_LIMIT]))))
    if data.draw(st.booleans()):
        whole = bytearray(data.draw(st.binary(max_size=200)))
    else:
        for _ in range(data.draw(st.integers(1, 4))):
            at = data.draw(st.integers(0, len(whole) - 1))
            new = data.draw(st.binary(min_size=1, max_size=8))
            whole[at : at + len(new)] = new
    path = tmp_path_factory.mktemp("fuzz") / "x.wav"
    path.write_bytes(whole)
    try:
        reader = WavReader.open(path)
        blocks = list(reader.blocks(3))
    except UnreadableWaveform as error:
        assert "\n" not in str(error)  # noqa: PT017 - most examples raise, some are still whole files
        return
    assert sum(len(block) for block in blocks) == reader.samples
    assert all(np.isfinite(block).all() for block in blocks)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(DriverError, match=r"none\.wav: no such file"):
        WavReader.open(tmp_path / "none.wav")


@pytest.mark.parametrize("block", [0, -1])
def test_a_block_has_at_least_one_sample(tmp_path: Path, block: int) -> None:
    path = tmp_path / "x.wav"
    path.write_bytes(wav_bytes(noise(4, 2), "float32"))
    with pytest.raises(ValueError, match="block: expected"):
        WavReader.open(path).blocks(block)
