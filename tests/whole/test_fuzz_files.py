"""Every kind of file that is read, mutated: it is read, or refused in one line that names it.

``python tests/whole/test_fuzz_files.py COUNT SEED`` feeds so many files and prints what became of each kind.
"""

from __future__ import annotations

import contextlib
import copy
import io
import json
import random
import re
import resource
import subprocess
import sys
import tempfile
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from chainsim import Device, load_device, read_model, read_simulation, read_sweep
from dotwave.errors import bad_input
from dotwave.icon_sets.journal import Journal
from dotwave.icon_sets.sources import find_icons, read_icons
from dotwave.jobs.job import read_job
from dotwave.studies.measured_sweeps import read_sweeps
from dotwave.studies.sweep import run_sweep
from drivers import read_exchange, read_waveform, write_exchange
from drivers.channels import channels_of
from drivers.formats.samples import writer_for
from encoders import EncodeError, Frame, GridShape, Scene, TargetPattern, TextSource, encode_picture
from encoders.picture.limits import PictureLimits
from planner import Ramp, plan_scene
from planner.cache import PlanCache, cache_path

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "samples"
SHAPE = GridShape(6, 6)
MEMORY_BYTES, PROCESSOR_S = 4 << 30, 3600
LINKED = load_device("linked-6x6")
SMALL = LINKED.model_copy(update={"rows": 1, "cols": 2, "chain_length": 2})
# What the libraries say where our own words are missing.
LEAKS = re.compile(
    r"Input should|Value error|Assertion failed|Extra inputs|Field required|List should|String should|Tuple should|"
    r"Dictionary should|Unable to|union_tag|Traceback|<[A-Z]\w+[.:]|\w+Error\b|constrained-|function-"
)

ODD: list[Any] = [
    None, True, False, 0, -1, 1, 2, 3, 6, 1023, 1025, 10**12, 10**30, -(10**30), 10**390, 0.5, 1e308, -1e308, 1e-320,
    float("nan"), float("inf"), float("-inf"), "", "x", "1", "nan", "x" * 200, "a\nb", "\0", "\x1b[31m",
    "é漢\u202e\u0300", "..", "/etc/passwd", [], [1], [[]], [[1, 2], [3]], {}, {"a": 1}, [None], ["a", "b"], [0.1] * 5,
    [[0.1] * 6] * 6, {"from": 1, "to": 2, "steps": 3}, {"from": 1e-300, "to": 1e300, "steps": 10**12, "log": True},
    {"min": 0, "max": 1},
]  # fmt: skip
TOKENS = (
    b"nan", b"-inf", b"1e999", b"-1", b"0", b"99999999999999999999", b"1_0", b"0x" + b"f" * 99, b"\0", b"\xff\xfe",
    b"\r", b"\n", b"\n\n", b",", b",,", b'"', b"'", b"#", b": ", b"- ", b"&a ", b"*a", b"<<: *a", b"!!int ", b"!x ",
    b"{", b"}", b"[", b"]", b"[" * 200, b"%", b"\t", b"\xe2\x80\xae", b"\xed\xa0\x80", b"\xf0\x9f\x98\x80",
    "²٣".encode(), b"\xef\xbb\xbf", b"1" * 300,
)  # fmt: skip
Reader = Callable[[Path], object]


@dataclass(frozen=True)
class Kind:
    """A kind of file: its ending, examples, what reads it, and those of its errors that need not name it.

    plain : how to make a structure of it and back; others are mutated as bytes only.
    """

    ending: str
    seeds: list[bytes]
    read: Reader
    plain: tuple[Callable[[bytes], Any], Callable[[Any], bytes]] | None = None
    share: int = 1
    named: bool = True


@dataclass
class Fed:
    """How many were read and refused, and what should not have been."""

    read: int = 0
    refused: int = 0
    wrong: Counter[str] = field(default_factory=Counter)


def _json_bytes(value: Any) -> bytes:
    return json.dumps(value).encode()


def _yaml_bytes(value: Any) -> bytes:
    return yaml.safe_dump(value, sort_keys=False, allow_unicode=True).encode("utf-8", "surrogatepass")


YAML = (yaml.safe_load, _yaml_bytes)
JSON = (json.loads, _json_bytes)


def places_in(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where every key and item of a structure is."""
    parts: Any = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in parts:
        yield (*place, key)
        yield from places_in(part, (*place, key))


def swapped(value: Any, chance: random.Random) -> Any:
    """A structure with a few of its values, keys and types changed."""
    whole = copy.deepcopy(value)
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        places = list(places_in(whole))
        if not places:
            return chance.choice(ODD)
        place = chance.choice(places)
        holder = whole
        for key in place[:-1]:
            holder = holder[key]
        last, kind = place[-1], chance.random()
        if kind < 0.7:
            holder[last] = copy.deepcopy(chance.choice(ODD))
        elif kind < 0.8:
            del holder[last]
        elif kind < 0.9 and isinstance(holder, dict):
            holder[chance.choice(("x", "lam", "", "from", "a.b", "a\nb"))] = holder.pop(last)
        else:
            holder[last] = [holder[last]]
    return whole


def mutated(data: bytes, other: bytes, chance: random.Random) -> bytes:
    """Bytes with a few things done to them; `other` is spliced in."""
    raw = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 3, 8))):
        at = chance.randrange(len(raw) + 1)
        match chance.randrange(7):
            case 0 if at < len(raw):
                raw[at] ^= 1 << chance.randrange(8)
            case 1 if at < len(raw):
                raw[at] = chance.randrange(256)
            case 2:
                del raw[at : at + chance.choice((1, 3, 20, 400))]
            case 3:
                raw[at:at] = raw[at : at + chance.choice((1, 9, 60, 4000))] * chance.choice((1, 2, 30))
            case 4:
                raw[at:] = other[chance.randrange(len(other) + 1) :]
            case 5:
                del raw[at:]
            case _:
                raw[at:at] = chance.choice(TOKENS)
    return bytes(raw)


def feed(kind: Kind, folder: Path, count: int, seed: int) -> Fed:
    """Read so many mutated files of a kind."""
    chance, fed, roots = random.Random(seed), Fed(), bad_input()
    path = folder / f"given{kind.ending}"
    for _ in range(count):
        data = chance.choice(kind.seeds)
        if kind.plain is not None and chance.random() < 0.6:
            load, dump = kind.plain
            data = dump(swapped(load(data), chance))
        else:
            data = mutated(data, chance.choice(kind.seeds), chance)
        path.unlink(missing_ok=True)
        path.write_bytes(data)
        try:
            with warnings.catch_warnings(), contextlib.redirect_stderr(io.StringIO()):
                warnings.simplefilter("error")
                kind.read(path)
        except roots as error:
            fed.refused += 1
            message = str(error)
            if LEAKS.search(message.replace(str(folder), "")):
                fed.wrong[f"leaks: {message[:200]}"] += 1
            if "\n" in message or len(message) > 700:
                fed.wrong[f"long: {message[:200]!r}"] += 1
            if kind.named and path.stem not in message:
                fed.wrong[f"unnamed: {message[:200]}"] += 1
        except Exception as error:
            trace = error.__traceback__
            while trace is not None and trace.tb_next is not None:
                trace = trace.tb_next
            where = f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}" if trace is not None else ""
            fed.wrong[f"{type(error).__name__} at {where}: {str(error)[:120]!r}"] += 1
        else:
            fed.read += 1
    return fed


def _device(path: Path) -> None:
    device = read_model(path, Device)
    for row in range(min(device.rows, 3)):
        device.alone(row)
        device.chain_at(row)


def _job(path: Path) -> None:
    for item in read_job(path).sequence:
        if item.texture is not None:
            # Whoever renders a job says which of its items does not fit the grid.
            with contextlib.suppress(EncodeError):
                next(iter(item.texture.scene(SHAPE).frames))


def _sweep(path: Path) -> None:
    sweep = read_sweep(path)
    sweep.settings(len(sweep) - 3, len(sweep))


def _waveform(path: Path) -> None:
    _, reader = read_waveform(path)
    for block in reader.blocks(32):
        assert np.isfinite(block).all()


def _journal(path: Path) -> None:
    with Journal(path) as journal:
        for key in ("a", "b", "c"):
            record = journal.find(key)
            assert record is None or record["key"] == key
        journal.add({"key": "new", "value": 1})
        assert journal.find("new") == {"key": "new", "value": 1}


def _picture(path: Path) -> None:
    scene = encode_picture(path, SHAPE, limits=PictureLimits(pixels=1_000_000, frames=8))
    assert all(np.isfinite(frame.pattern.amplitude).all() for frame in scene.frames)


def _archive(path: Path) -> None:
    for icon in read_icons(find_icons([str(path)])):
        assert "\n" not in icon.error


def _documents(folder: str, words: str) -> list[bytes]:
    files = sorted((SAMPLES / folder).glob("*.yaml"))
    return [path.read_bytes() for path in files if words in path.read_text(encoding="utf-8")]


FULL_CHAIN = {
    "chain": {
        "grid": {"rows": 2, "cols": 3}, "delta": [0.1] * 6, "beta": -1.0, "stiffness": [1.0] * 6, "closure": "open",
        "kind": "resistor",
    },
    "setting": {
        "epsilon": 0.1, "lam_x": [[0.1, 0.1], [0.1, 0.1]], "lam_y": 0.1, "omega": 1.0, "preload": 0.0,
        "bias": [0.0] * 6, "phase": 0.0,
    },
    "rung": "auto", "tol": 1e-6, "start": "rest",
}  # fmt: skip
FULL_JOB = {
    "schema": "dotwave/job/1",
    "device": {
        "base": "linked-6x6", "name": "a", "grid": {"rows": 3, "cols": 6, "pitch_m": 0.01}, "chain_length": 6,
        "f0_hz": 100.0, "delta": 0.01, "beta": -1.0, "omega": {"min": 0.9, "max": 1.1},
        "coupling": {"scope": "link", "lam": {"min": 0, "max": 0.1}, "bits": 8}, "bias": "none",
        "amplifier": {"volts": 100.0, "slew_v_per_s": 1e6, "rate_hz": 8000, "bits": 8}, "spread": {"frequency": 0.1},
    },
    "tolerance": "fine", "budget": {"planning_s": 1.0}, "contrast_db": 20.0, "presentation": "together",
    "output": "x.wav",
    "sequence": [
        {"text": {"say": "a", "rate": 1.0, "dots": 8, "undefined": "name"}},
        {"image": {"file": "a.png", "style": "auto", "background": "#ffffff", "threshold": "otsu", "levels": 3}},
        {"texture": {"wave": {"lag_deg": 60}}}, {"texture": {"bars": {"width": 1, "gap": 1}}},
        {"texture": {"walking_bars": {"width": 2.0}}}, {"texture": {"levels": [[0.1] * 6] * 6}},
        {"texture": {"regions": [{"top": 0, "bottom": 1, "left": 0, "right": 2, "wave": {"lag_deg": 3}}]}},
        {"texture": {"scroll": {"bars": {"width": 1, "gap": 2}, "columns_per_s": 2.0}, "dwell_s": 2.0}},
        {"texture": {"scroll": {"text": "a", "columns_per_s": 3.0, "table": "en-ueb-g1.ctb", "cell_gap": 1}}},
        {"texture": {"dot": {"path": [[0, 0], [2, 3]], "closed": True, "actuators_per_s": 3.0}}},
        {"texture": {"dot": {"circle": {"radius": 1.0}, "actuators_per_s": 3.0}}},
        {"pause_s": 1.0},
    ],
}  # fmt: skip
SWEEP = {
    "chain": {"n": 3, "delta": 0.006, "beta": -1.0},
    "setting": {
        "epsilon": {"from": 1e-4, "to": 1e-3, "steps": 5, "log": True}, "lam": [0.006, 0.006],
        "omega": {"from": 0.99, "to": 1.01, "steps": 4}, "bias": [0.0] * 3,
    },
    "rung": "harmonic_balance", "tol": 1e-6, "start": "rest",
}  # fmt: skip


def _kinds_of_yaml() -> dict[str, Kind]:
    profiles = [
        (ROOT / "chainsim" / "model" / "profiles" / f"{name}.yaml").read_bytes() for name in ("paper-6x6", "linked-6x6")
    ]
    measured = LINKED.as_dict() | {
        "actuators": [{"row": 0, "col": 0, "f0_hz": 130.0, "plus_minus": {"f0_hz": 1.0}}],
        "spread": {"frequency": 0.1, "lam": 0.1},
    }
    chains = [*_documents("chains", "chain"), _yaml_bytes(FULL_CHAIN)]
    return {
        "device": Kind(".yaml", [*profiles, _yaml_bytes(measured)], _device, YAML, 3),
        "job": Kind(".yaml", [*_documents("jobs", "sequence"), *[_yaml_bytes(FULL_JOB)] * 3], _job, YAML, 4),
        "chain": Kind(".yaml", chains, read_simulation, YAML, 3),
        "sweep": Kind(".yaml", [_yaml_bytes(SWEEP)], _sweep, YAML, 2),
    }


def _kinds_of_tables(folder: Path) -> dict[str, Kind]:
    def beside(ending: str) -> Reader:
        source = folder / f"table-{ending[1:]}.yaml"
        plain = {"chain": SWEEP["chain"], "setting": {"table": f"given{ending}", "omega": 1.0}, "tol": 1e-6}
        source.write_bytes(_yaml_bytes(plain))
        return lambda path: read_sweep(source).settings(0, 3)

    arrays: dict[str, Any] = {"epsilon": np.linspace(1, 2, 40), "lam": np.linspace(1, 2, 80).reshape(40, 2)}
    archives = []
    for save in (np.savez, np.savez_compressed):
        buffer = io.BytesIO()
        save(buffer, **arrays)
        archives.append(buffer.getvalue())
    rows = [f"{a!r},{b!r},{c!r}" for a, (b, c) in zip(arrays["epsilon"].tolist(), arrays["lam"].tolist(), strict=True)]
    lines = "\n".join(["epsilon,lam_1,lam_2", *rows]).encode()
    measured = b"".join((SAMPLES / "calibration" / "sweep.csv").read_bytes().splitlines(keepends=True)[:60])
    return {
        "table_npz": Kind(".npz", archives, beside(".npz"), share=2),
        "table_csv": Kind(".csv", [lines], beside(".csv"), share=2),
        "calibration": Kind(".csv", [measured], lambda path: read_sweeps(str(path), LINKED), share=2),
    }


def _kinds_of_waveforms(folder: Path) -> dict[str, Kind]:
    """Samples beside a manifest that stays, and manifests beside samples that stay."""
    found, volts = {}, np.random.default_rng(0).uniform(-50, 50, (60, 1))
    rate_hz = SMALL.amplifier.rate_hz
    times = {"start_s": 0.0, "settled_s": 30 / rate_hz, "end_s": 60 / rate_hz}
    frame = times | {
        "omega": [1.0], "target": [[1.0, 0.0]], "cells": "\u2801", "text": "a", "outcome": "ok", "page": 0,
        "span": [0, 1], "tones": [[1.0]], "phase": [[0.0, None]], "moving": [True],
    }  # fmt: skip
    for ending in (".wav", ".npz", ".csv", ".raw"):
        buffer = io.BytesIO()
        writer = writer_for(Path(f"x{ending}"), buffer, channels_of(SMALL), rate_hz, "float32")
        writer.write(volts)
        writer.finish()
        raw = buffer.getvalue()
        manifest = {
            "schema": "dotwave/waveform/1", "samples_file": f"given{ending}", "rate_hz": rate_hz,
            "samples": len(volts), "digest": f"sha256:{sha256(raw).hexdigest()}", "device": SMALL.as_dict(),
            "channels": [channel.as_dict() for channel in channels_of(SMALL)],
            "coupling": [{"t_s": 0.0, "row": 0, "lam": [0.006], "ramp_s": 0.0}], "frames": [frame], "encoding": {},
        }  # fmt: skip
        place = folder / ending[1:]
        place.mkdir()
        (place / "given.json").write_bytes(_json_bytes(manifest))
        found[f"samples_{ending[1:]}"] = Kind(ending, [raw], _moved(place, _waveform))
        if ending == ".raw":
            beside = folder / "manifest"
            beside.mkdir()
            (beside / "given.raw").write_bytes(raw)
            found["manifest"] = Kind(".json", [_json_bytes(manifest)], _moved(beside, _waveform), JSON, 4)
    return found


def _moved(place: Path, read: Reader) -> Reader:
    def moved(path: Path) -> object:
        return read(path.replace(place / path.name))

    return moved


def _kinds_of_pictures() -> dict[str, Kind]:
    grey = np.random.default_rng(0).integers(0, 256, (20, 20), np.uint8)
    images = [Image.fromarray(grey), Image.fromarray(grey).convert("P"), Image.fromarray(np.dstack([grey] * 4))]
    rasters = []
    for image, form in [(image, "PNG") for image in images] + [
        (images[0], form) for form in ("GIF", "JPEG", "BMP", "WEBP")
    ]:
        buffer = io.BytesIO()
        image.save(buffer, form)
        rasters.append(buffer.getvalue())
    drawings = [(SAMPLES / "icons" / f"{name}.svg").read_bytes() for name in ("alarm", "cart", "sun")]
    return {
        "svg": Kind(".svg", drawings, _picture, share=2, named=False),
        "raster": Kind(".png", rasters, _picture, share=2, named=False),
    }


def _kinds_of_others(folder: Path) -> dict[str, Kind]:
    plan = plan_scene(Scene(SHAPE, [Frame(TargetPattern(np.eye(6).astype(complex)), 1.0)]), LINKED)
    curves = {}
    for ending in (".hjif", ".ahap", ".haptic"):
        write_exchange(plan, folder / f"x{ending}")
        curves[ending] = (folder / f"x{ending}").read_bytes()
    ramps = [(bytes([index]), Ramp(t_s=np.linspace(0, index, 40))) for index in range(1, 12)]
    PlanCache(LINKED, 20.0).keep(ramps)
    database = cache_path().read_bytes()
    records = [{"key": key, "value": [1, 2, {"x": "y"}]} for key in ("a", "b", "a", "c")]
    journal = b"".join(_json_bytes(record) + b"\n" for record in records)
    zipped = io.BytesIO()
    with zipfile.ZipFile(zipped, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("alarm", "cart"):
            archive.writestr(f"{name}.svg", (SAMPLES / "icons" / f"{name}.svg").read_bytes())

    def cache(path: Path) -> None:
        path.replace(cache_path())
        found = PlanCache(LINKED, 20.0).find([key for key, _ in ramps])
        for one, (_, ramp) in zip(found, ramps, strict=True):
            assert one is None or np.array_equal(one.t_s, ramp.t_s)
        for left in cache_path().parent.glob("*.damaged*"):
            left.unlink()

    texts = [(SAMPLES / "texts" / f"{name}.txt").read_bytes() for name in ("de", "hi", "zh", "paragraph")]
    return {
        "cache": Kind(".sqlite", [database], cache, share=2),
        "journal": Kind(".jsonl", [journal], _journal),
        "text": Kind(".txt", texts, TextSource.of_path),
        "brf": Kind(".brf", [b",HELLO ,WORLD4\r\n  #ABC\r\n\x0c,BYE\r\n\x1a"], TextSource.of_path),
        "icons": Kind(".zip", [zipped.getvalue()], _archive),
        "parts": Kind(".npz", _parts(folder), _resumed(folder)),
        **{ending[1:]: Kind(ending, [data], read_exchange, JSON) for ending, data in curves.items()},
    }


def _parts(folder: Path) -> list[bytes]:
    """The one part of a sweep that was stopped before its end."""
    source = folder / "stopped.yaml"
    source.write_bytes(_yaml_bytes(SWEEP))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dotwave.studies.sweep._counted", _stop)
        with contextlib.suppress(KeyboardInterrupt):
            run_sweep(source, folder / "stopped.npz")
    (part,) = (folder / "stopped.npz.parts").glob("0*.npz")
    return [part.read_bytes()]


def _stop(*_: object) -> None:
    raise KeyboardInterrupt


def _resumed(folder: Path) -> Reader:
    (part,) = (folder / "stopped.npz.parts").glob("0*.npz")
    note = {path.name: path.read_bytes() for path in part.parent.iterdir() if path != part}

    def resumed(path: Path) -> None:
        part.parent.mkdir(exist_ok=True)
        for name, data in note.items():
            (part.parent / name).write_bytes(data)
        path.replace(part)
        run_sweep(folder / "stopped.yaml", folder / "stopped.npz")

    return resumed


def all_kinds(folder: Path) -> dict[str, Kind]:
    """Every kind of file; what stands beside the mutated ones is in `folder`."""
    return (
        _kinds_of_yaml() | _kinds_of_tables(folder) | _kinds_of_waveforms(folder) | _kinds_of_pictures()
        | _kinds_of_others(folder)
    )  # fmt: skip


def feed_all(folder: Path, count: int, seed: int) -> dict[str, Fed]:
    """Feed about `count` files in all."""
    kinds = all_kinds(folder)
    shares = sum(kind.share for kind in kinds.values())
    return {
        name: feed(kind, folder, -(-count * kind.share // shares), seed + index)
        for index, (name, kind) in enumerate(kinds.items())
    }


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path / "kept"))
    (tmp_path / "fuzzed").mkdir()
    return tmp_path / "fuzzed"


def test_the_examples_are_read(folder: Path) -> None:
    for name, kind in all_kinds(folder).items():
        for data in kind.seeds:
            (folder / f"given{kind.ending}").write_bytes(data)
            assert kind.read(folder / f"given{kind.ending}") is not False, name


def test_some_hundred_mutated_files(folder: Path) -> None:
    found = feed_all(folder, 500, seed=1)
    assert {name: dict(fed.wrong) for name, fed in found.items() if fed.wrong} == {}
    assert sum(fed.read for fed in found.values()) > 100
    assert sum(fed.refused for fed in found.values()) > 100


@pytest.mark.slow
def test_twenty_thousand_mutated_files() -> None:
    """In a process of its own, whose memory and work are limited."""
    ran = subprocess.run(
        [sys.executable, __file__, "20000", "2"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr


def main(count: int, seed: int) -> int:
    """Feed under limits of memory and of the processor; how many were neither read nor refused as they should be."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_S, PROCESSOR_S))
    wrong = 0
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setenv("DOTWAVE_CACHE", f"{folder}/kept")
        (Path(folder) / "fuzzed").mkdir()
        for name, fed in feed_all(Path(folder) / "fuzzed", count, seed).items():
            print(f"{name:12} read {fed.read:5} refused {fed.refused:5} wrong {sum(fed.wrong.values()):4}", flush=True)
            for words, times in fed.wrong.most_common(12):
                print(f"    {times} x {words}")
            wrong += sum(fed.wrong.values())
    return wrong


if __name__ == "__main__":
    sys.exit(1 if main(int(sys.argv[1]), int(sys.argv[2])) else 0)
