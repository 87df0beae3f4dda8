"""Sinks by name, those of other packages among them: what each says, and that the gate stands before every one."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Callable
from pathlib import Path
from textwrap import dedent
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from chainsim import load_device
from drivers import (
    GateLimits,
    GateRefusal,
    SinkError,
    SinkReport,
    WavWriter,
    channels_of,
    open_sink,
    read_waveform,
    sink_names,
)
from drivers.sinks.opening import SINKS
from drivers.waveform.manifest import digest_of

if TYPE_CHECKING:
    from tests.conftest import Ended

DEVICE = load_device("paper-6x6")
RATE = 8000

KEEPER = '''
"""A sink of another package: keeps what it is given."""

from drivers import SinkReport

played = []
closed = []


class Keeper:
    def __init__(self, place, gain=1.0):
        self.place, self.gain = place, gain

    def check(self, manifest, samples):
        return SinkReport(facts={"place": self.place}, lines=(f"would be kept in {self.place}",))

    def play(self, manifest, samples, progress):
        for block in samples.blocks(1000):
            played.append(self.gain * block)
            progress(1000 * len(played) / manifest.rate_hz)
        return SinkReport(facts={"place": self.place, "blocks": len(played)}, lines=(f"kept in {self.place}",))

    def close(self):
        closed.append(self.place)
'''


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Put a package with one module and entry points where Python finds it."""
    site = tmp_path / "site"
    monkeypatch.syspath_prepend(str(site))

    def put(package: str, source: str, **sinks: str) -> None:
        info = site / f"{package}-1.0.dist-info"
        info.mkdir(parents=True)
        (site / f"{package}.py").write_text(dedent(source))
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        points = "".join(f"{name} = {place}\n" for name, place in sinks.items())
        (info / "entry_points.txt").write_text(f"[dotwave.sinks]\n{points}")
        monkeypatch.delitem(sys.modules, package, raising=False)

    return put


def written(folder: Path, height: float = 50.0) -> Path:
    """Half a second of a slow half sine on channel 3."""
    path, channels = folder / "made.wav", channels_of(DEVICE)
    volts = np.zeros((RATE // 2, len(channels)))
    volts[:, 3] = height * np.sin(np.linspace(0, np.pi, len(volts)))
    with path.open("wb") as file:
        writer = WavWriter(file, channels, RATE, "float32")
        writer.write(volts)
        writer.finish()
    manifest = {
        "schema": "dotwave/waveform/1", "samples_file": path.name, "rate_hz": RATE, "samples": len(volts),
        "digest": digest_of(path), "device": DEVICE.as_dict(),
        "channels": [channel.as_dict() for channel in channels], "coupling": [], "frames": [],
    }  # fmt: skip
    path.with_suffix(".json").write_text(json.dumps(manifest))
    return path


def test_a_sink_of_another_package_is_played_to(
    tmp_path: Path, install: Callable[..., None], dotwave: Callable[..., Ended]
) -> None:
    install("keeping", KEEPER, keeper="keeping:Keeper")
    assert sink_names() == (*SINKS, "keeper")
    path = written(tmp_path)
    dry = dotwave("play", path, "--to", "keeper:shelf")
    assert (dry.code, dry.err) == (0, "")
    assert "  would be kept in shelf\n  Give --live to play it." in dry.out
    keeping: Any = importlib.import_module("keeping")
    assert (keeping.played, keeping.closed) == ([], ["shelf"])
    live = dotwave("play", path, "--to", "keeper:shelf", "--live", "--json")
    report = json.loads(live.out)
    assert (report["sink"], report["place"], report["blocks"], report["ok"]) == ("keeper", "shelf", 4, True)
    _, reader = read_waveform(path)
    np.testing.assert_array_equal(np.concatenate(keeping.played), np.concatenate(list(reader.blocks(999))))


def test_it_cannot_forget_the_gate(tmp_path: Path, install: Callable[..., None]) -> None:
    install("keeping", KEEPER, keeper="keeping:Keeper")
    manifest, reader = read_waveform(written(tmp_path, 101.0))
    with open_sink("keeper:shelf") as sink, pytest.raises(GateRefusal, match="nothing was sent: volts of channel 3"):
        sink.play(manifest, reader)
    keeping: Any = importlib.import_module("keeping")
    assert keeping.played == []


def test_samples_that_change_after_the_check_stop_at_the_limit(tmp_path: Path, install: Callable[..., None]) -> None:
    install("keeping", KEEPER, keeper="keeping:Keeper")
    keeping: Any = importlib.import_module("keeping")
    path = written(tmp_path)
    manifest, reader = read_waveform(path)
    with open_sink("keeper:shelf") as sink:
        sink.check(manifest, reader)
        with path.open("r+b") as file:
            file.seek(-42 * 4 * 1500, 2)
            file.write(np.full(42, 2.0, "<f4").tobytes())
        with pytest.raises(
            GateRefusal, match=r"stopped, the samples have changed .*: volts of channel 0 .* is 200 V at 0.3125 s"
        ):
            sink.play(manifest, reader)
    # Sample 2500 is in the third block.
    assert len(keeping.played) == 2
    assert max(np.abs(block).max() for block in keeping.played) <= 100


def test_limits_that_are_known_are_held(tmp_path: Path, install: Callable[..., None]) -> None:
    install("keeping", KEEPER, keeper="keeping:Keeper")
    manifest, reader = read_waveform(written(tmp_path))
    low = GateLimits.of(DEVICE, 42)
    with open_sink("keeper:", limits=low) as sink:
        assert sink.check(manifest, reader).gate.volts == pytest.approx(50, rel=1e-3)
    low = GateLimits(**{**low.__dict__, "volts": 40.0})
    with open_sink("keeper:", limits=low) as sink, pytest.raises(GateRefusal, match="the limit is 40 V"):
        sink.check(manifest, reader)


@pytest.mark.parametrize(
    ("source", "place", "why"),
    [
        ("import nothing_of_that_name", "broken:Sink", "broken cannot be loaded: No module named"),
        ("Sink = 1 +", "broken:Sink", "broken cannot be loaded: invalid syntax"),
        ("", "broken:Sink", "broken cannot be loaded: .* no attribute 'Sink'"),
        ("Sink = 3", "broken:Sink", "broken:Sink makes nothing"),
        ("def sink(place): return place", "broken:sink", "has no check, play and close"),
    ],
    ids=["import", "syntax", "name", "no maker", "no sink"],
)
def test_a_broken_package_is_one_line(
    install: Callable[..., None], dotwave: Callable[..., Ended], tmp_path: Path, source: str, place: str, why: str
) -> None:
    install("broken", source, mine=place)
    with pytest.raises(SinkError, match=f"sink mine: .*{why}.*; reinstall or mend the package"):
        open_sink("mine:here")
    # Others are none the worse for it.
    open_sink("audio:0")
    ended = dotwave("play", written(tmp_path), "--to", "mine:here")
    assert (ended.code, ended.out, ended.err.count("\n")) == (2, "", 1)


def test_a_sink_that_reports_nothing_is_one_line(tmp_path: Path, install: Callable[..., None]) -> None:
    install(
        "silent",
        "class Sink:\n    def __init__(self, place): ...\n    check = play = close = lambda *_: None",
        mine="silent:Sink",
    )
    with (
        open_sink("mine:") as sink,
        pytest.raises(SinkError, match="sink mine: it gives no SinkReport but None; reinstall"),
    ):
        sink.check(*read_waveform(written(tmp_path)))


def test_a_name_that_is_offered_twice_is_refused(install: Callable[..., None]) -> None:
    install("keeping", KEEPER, controller="keeping:Keeper", keeper="keeping:Keeper")
    install("keeping_too", KEEPER, keeper="keeping_too:Keeper")
    with pytest.raises(SinkError, match="sink controller: dotwave and keeping both offer it; uninstall one"):
        open_sink("controller:/dev/ttyACM0")
    with pytest.raises(SinkError, match=r"sink keeper: keeping.* and keeping.* both offer it"):
        open_sink("keeper:")
    open_sink("audio:")


def test_unknown_names_and_options_are_refused() -> None:
    with pytest.raises(SinkError, match="there is no sink 'speaker'; there are controller, drv2667, audio"):
        open_sink("speaker:left")
    with pytest.raises(SinkError, match=r"sink audio: .*'baud'; it has mapping"):
        open_sink("audio:0", baud=9600)


@pytest.mark.parametrize("name", SINKS)
def test_a_sink_is_made_without_its_hardware(name: str) -> None:
    with open_sink(f"{name}:nowhere") as sink:
        assert sink.name == name


@pytest.mark.parametrize("name", ["controller", "drv2667"])
def test_a_port_is_asked_for(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.sinks.board.plan_board", lambda *_: None)
    monkeypatch.setattr("drivers.sinks.board._said", lambda *_: SinkReport())
    with open_sink(f"{name}:") as sink, pytest.raises(SinkError, match=f"as in {name}:/dev/tty"):
        sink.play(*read_waveform(written(tmp_path)))
