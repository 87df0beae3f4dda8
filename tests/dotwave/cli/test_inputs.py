"""Inputs without an end, names that none can have, and a locale that knows ASCII only."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from chainsim import ProfileError, read_model
from chainsim.model.device import Device
from drivers import FileError
from drivers.formats.table import check_suffix
from encoders import TextSource, UnsupportedSource
from encoders.braille.readers import sources

ROOT = Path(__file__).resolve().parents[3]
MEMORY = 4 << 30


def run(
    folder: Path, *arguments: str, stdin: int = subprocess.DEVNULL, **environment: str
) -> subprocess.CompletedProcess[bytes]:
    given = os.environ | {"PYTHONPATH": str(ROOT)} | environment
    command = [sys.executable, "-m", "dotwave", *arguments]
    return subprocess.run(command, cwd=folder, env=given, stdin=stdin, capture_output=True, timeout=300, check=False)


def test_a_text_is_read_up_to_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "MAX_BYTES", 10)
    (tmp_path / "fits.txt").write_bytes(b"x" * 10)
    (tmp_path / "long.txt").write_bytes(b"x" * 11)
    assert TextSource.of_path(tmp_path / "fits.txt").text == "x" * 10
    with pytest.raises(UnsupportedSource, match=r"long\.txt: more than 10 bytes; give it in parts"):
        TextSource.of_path(tmp_path / "long.txt")


class Endless:
    """Gives as many bytes as are asked for; to ask for all of them would never end."""

    def read(self, most: int) -> bytes:
        assert 0 < most < 1 << 30
        return b" " * most


def test_standard_input_without_an_end(dotwave, monkeypatch: pytest.MonkeyPatch) -> None:
    stream = type("Stream", (), {"buffer": Endless()})()
    monkeypatch.setattr(sys, "stdin", stream)
    for arguments in (["text", "-"], ["simulate", "-"], ["calibrate", "-"]):
        ended = dotwave(*arguments)
        assert (ended.code, ended.err.count("\n")) == (2, 1)
        assert "000000 bytes" in ended.err


def test_standard_input_that_is_closed(dotwave, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    for arguments in (["text", "-"], ["simulate", "-"], ["calibrate", "-"]):
        ended = dotwave(*arguments)
        assert (ended.code, ended.err.count("\n")) == (2, 1)
        assert "standard input: is closed" in ended.err


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="there is no /dev/zero")
@pytest.mark.parametrize("endless", ["/dev/zero", "/dev/urandom"])
def test_files_without_an_end(tmp_path: Path, dotwave, monkeypatch: pytest.MonkeyPatch, endless: str) -> None:
    import resource

    monkeypatch.chdir(tmp_path)
    for name in ("x.yaml", "x.csv", "x.png"):
        (tmp_path / name).symlink_to(endless)
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, before[1]))
    try:
        for arguments in (
            ["text", endless], ["simulate", "x.yaml"], ["render", "x.yaml"], ["devices", "x.yaml"],
            ["text", "a", "-d", "x.yaml"], ["sweep", "x.yaml", "-o", "x.npz"], ["calibrate", "x.csv"],
            ["image", "x.png"],
        ):  # fmt: skip
            ended = dotwave(*arguments)
            assert (ended.code, ended.err.count("\n")) == (2, 1), arguments
            assert "memory" not in ended.err
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def test_a_yaml_file_that_is_too_long(tmp_path: Path) -> None:
    (tmp_path / "x.yaml").write_bytes(b"#" * 4_000_001)
    with pytest.raises(ProfileError, match=r"x\.yaml: more than 4000000 bytes"):
        read_model(tmp_path / "x.yaml", Device)


LONG = "y" * 5000
NAMES = {
    "text: {file: NAME}": "3: sequence.0.text.file: ",
    "text: {say: a, table: NAME}": "3: sequence.0.text: table",
    "image: NAME": "3: sequence.0.image.file: ",
    "icon: {file: NAME}": "3: sequence.0.icon.file: ",
}


@pytest.mark.parametrize("name", [r'"a\0b.txt"', LONG, r'"\ud800.txt"', '""'], ids=["nul", "long", "surrogate", "none"])
@pytest.mark.parametrize("item", NAMES)
def test_names_in_jobs_that_none_can_have(tmp_path: Path, dotwave, item: str, name: str) -> None:
    job = tmp_path / "job.yaml"
    job.write_text(f"device: paper-6x6\nsequence:\n  - {item.replace('NAME', name)}\n", encoding="utf-8")
    ended = dotwave("render", job)
    assert (ended.code, ended.out, ended.err.count("\n")) == (2, "", 1)
    # Half a character is none: the parser of YAML stops there.
    assert f"job.yaml:{NAMES[item] if 'ud800' not in name else '3: not YAML'}" in ended.err
    assert len(ended.err) < 600


@pytest.mark.parametrize("name", [r'"a\0b.yaml"', LONG + ".yaml", LONG], ids=["nul", "long", "long word"])
@pytest.mark.parametrize("key", ["device", "output"])
def test_names_of_devices_and_outputs_that_none_can_have(tmp_path: Path, dotwave, key: str, name: str) -> None:
    job = tmp_path / "job.yaml"
    job.write_text(f"sequence: [{{text: a}}]\n{key}: {name}\n", encoding="utf-8")
    ended = dotwave("render", job)
    assert (ended.code, ended.out, ended.err.count("\n")) == (2, "", 1)
    assert f"job.yaml:2: {key}" in ended.err
    assert len(ended.err) < 600


@pytest.mark.parametrize(
    "arguments",
    [
        ["devices", LONG], ["devices", LONG + ".yaml"], ["text", "a", "-d", LONG], ["text", "a", "--table", LONG],
        ["text", "a/" + LONG], ["text", "a", "-o", LONG + ".wav"], ["verify", LONG + ".wav"], ["verify", LONG],
        ["simulate", LONG], ["render", LONG], ["calibrate", LONG], ["image", LONG], ["icons", LONG, "-o", "out"],
    ],
)  # fmt: skip
def test_names_of_arguments_that_are_too_long(tmp_path: Path, dotwave, monkeypatch, arguments: list[str]) -> None:
    monkeypatch.chdir(tmp_path)
    ended = dotwave(*arguments)
    assert (ended.code, ended.out, ended.err.count("\n")) == (2, "", 1), ended
    assert len(ended.err) < 600
    assert not list(tmp_path.glob("*.wav"))


def test_a_name_that_is_no_text_is_not_written() -> None:
    with pytest.raises(FileError, match="its name is not UTF-8"):
        check_suffix(Path("\udcff.wav"))


@pytest.fixture(scope="module")
def ascii_only(tmp_path_factory: pytest.TempPathFactory):
    """Call the command line where locale and file system know ASCII only; gives its output."""
    folder = tmp_path_factory.mktemp("c")
    (folder / "pictures").mkdir()
    (folder / "pictures" / "hérz.svg").write_bytes((ROOT / "samples" / "icons" / "heart.svg").read_bytes())
    (folder / "grüße.txt").write_text("Grüße", encoding="utf-8")
    (folder / "jöb.yaml").write_text(
        "output: nëu/ü.wav\nsequence: [{text: {file: grüße.txt}}, {icon: pictures/hérz.svg}]", encoding="utf-8"
    )

    def call(*arguments: str, code: int = 0) -> str:
        ended = run(folder, *arguments, LC_ALL="C", PYTHONCOERCECLOCALE="0", PYTHONUTF8="0")
        assert ended.returncode == code, ended.stderr.decode()
        assert ended.stderr.count(b"\n") == (code == 2)
        return (ended.stdout + ended.stderr).decode()

    return call


@pytest.mark.slow
def test_an_ascii_locale_keeps_nothing_from_working(ascii_only) -> None:
    ascii_only("text", "Grüße", "-o", "ü.wav")
    assert json.loads(ascii_only("verify", "ü.wav", "--json"))["felt_text"] == "Grüße"
    assert "ü.preview.txt" in ascii_only("preview", "ü.wav")
    assert "öut/index.html" in ascii_only("icons", "pictures", "-o", "öut", "--waveforms", "--workers", "1")
    assert "nëu/ü.wav" in ascii_only("render", "jöb.yaml")


def test_an_ascii_locale_lists_and_complains(ascii_only) -> None:
    assert len(json.loads(ascii_only("devices", "--json"))["devices"]) > 5
    assert len(json.loads(ascii_only("tables", "--json"))["tables"]) > 100
    assert "nö/such.txt: no such file" in ascii_only("text", "nö/such.txt", code=2)
    assert "'grüße.ctb': no such table" in ascii_only("text", "a", "--table", "grüße.ctb", code=2)


def test_icons_whose_names_are_no_text(tmp_path: Path, dotwave) -> None:
    folder = tmp_path / "icons"
    folder.mkdir()
    name = os.fsencode(folder) + b"/\xfe.svg"
    with open(name, "wb") as file:
        file.write((ROOT / "samples" / "icons" / "heart.svg").read_bytes())
    ended = dotwave("icons", folder, "-o", tmp_path / "out", "--workers", 1)
    assert ended.code == 0, ended.err
    assert json.loads((tmp_path / "out" / "manifest.json").read_text(encoding="utf-8"))


def test_a_waveform_that_is_not_there_is_named_as_it_was_asked_for(tmp_path: Path, dotwave, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert dotwave("text", "a", "-o", "x.wav").code == 0
    for command in ("verify", "preview", "play"):
        assert dotwave(command, "none.wav").err == "dotwave: none.wav: no such file; check the name\n"
        assert dotwave(command, "none.json").err == "dotwave: none.json: no such file; check the name\n"
    (tmp_path / "y.wav").write_bytes((tmp_path / "x.wav").read_bytes())
    assert dotwave("verify", "y.wav").err == "dotwave: y.json: no such file; check the name\n"
    (tmp_path / "x.wav").unlink()
    assert dotwave("verify", "x.json").err == "dotwave: x.wav: no such file; check the name\n"
    assert dotwave("verify", "x.wav").err == "dotwave: x.wav: no such file; check the name\n"
