"""The command line as a person or a script meets it: exit codes, one line per error, JSON that parses."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import chainsim
import drivers
import encoders
import planner
from chainsim import device_names
from dotwave.errors import AppError
from dotwave.reports.text import FrameCheck, TextReport, VerifyReport
from dotwave.source import text_source
from planner import FrameWish

ROOT = Path(__file__).resolve().parents[3]
BRIEF = TextReport(
    device="paper-6x6", tables=("en-ueb-g2.ctb",), text="Hello", frames=1, pages=1, duration_s=1.0, files=(),
    peak_volts=10.0, limit_volts=100.0, ramp_s=0.1, error=0.0, outcomes={"ok": 1},
)  # fmt: skip


def frame(target: list[list[float]], felt: list[list[float]]) -> FrameCheck:
    wanted, got = np.array(target), np.array(felt)
    wrong = int(np.sum((wanted >= 0.5) != (got >= 0.5)))
    error = float(np.abs(wanted - got).max())
    return FrameCheck(0, 0.0, 0.3, 1.0, "ok", wanted, FrameWish(wanted), got, wrong, 20.0, error)


GOOD = VerifyReport("x.wav", "paper-6x6", (frame([[1, 0]], [[1, 0]]),), 8000, 8000, "a", "a", True)
BAD = replace(GOOD, frames=(frame([[1, 0]], [[0.2, 0]]),))


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Put functions in the place of a module of `dotwave`."""

    def install(module: str, **functions: Callable[..., object]) -> None:
        fake = ModuleType(f"dotwave.{module}")
        vars(fake).update(functions)
        monkeypatch.setitem(sys.modules, fake.__name__, fake)

    return install


def test_text_gives_everything_to_the_pipeline(dotwave, stand_in) -> None:
    given: dict[str, Any] = {}

    def scene(source, device, options):
        given.update(source=source.text, options=options)
        return "scene"

    def render(shown, device, out, request):
        given.update(scene=shown, device=device, out=out, encoding=request.encoding)
        return BRIEF

    stand_in("api.scenes", text=scene, device=lambda name: name)
    stand_in("rendering.render", render=render)
    ended = dotwave(
        "text", "Hello", "-d", "linked-6x6", "-o", "x.wav", "--table", "language:de grade:2", "--undefined", "drop",
        "--cell-gap", 1, "--line-gap", 2, "--rate", 3.5, "--presentation", "by-row", "--dots", 6, "--blank-between",
        "--sample-format", "pcm24",
    )  # fmt: skip
    assert ended.code == 0
    assert (given["source"], given["scene"]) == ("Hello", "scene")
    assert (given["device"], given["out"], given["encoding"]) == ("linked-6x6", Path("x.wav"), "pcm24")
    options = given["options"]
    assert options.table == "language:de grade:2"
    assert (options.cell_gap, options.line_gap, options.rate, options.blank_between) == (1, 2, 3.5, True)
    assert options.undefined == encoders.Undefined.DROP
    assert options.presentation == encoders.Presentation.BY_ROW
    assert options.dots == 6


def test_text_leaves_unsaid_options_to_the_encoder(dotwave, stand_in) -> None:
    given: dict[str, Any] = {}
    stand_in("api.scenes", text=lambda _, device, options: given.update(options=options), device=lambda name: name)
    stand_in("rendering.render", render=lambda *_: BRIEF)
    dotwave("text", "Hello")
    assert given["options"] == encoders.TextOptions()


@pytest.mark.parametrize(("outcomes", "code"), [({"ok": 2}, 0), ({"ok": 1, "unreachable": 1}, 1)])
def test_text_exit_code_and_json(dotwave, stand_in, outcomes, code) -> None:
    stand_in("rendering.render", render=lambda *_: replace(BRIEF, outcomes=outcomes, error=float("nan")))
    ended = dotwave("text", "Hello", "--json")
    assert ended.code == code
    answer = json.loads(ended.out, parse_constant=pytest.fail)
    assert answer["outcomes"] == outcomes
    assert answer["error"] is None


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_a_text_cannot_send_commands_to_the_terminal(dotwave, stand_in, options) -> None:
    sly = replace(BRIEF, undefined=("\x1b[2J named", "\x9b2J named"), notes=("\u2801 déjà\u00a0vu",))
    stand_in("rendering.render", render=lambda *_: sly)
    out = dotwave("text", "Hello", *options).out
    assert "\x1b" not in out
    assert "\x9b" not in out
    assert "\u2801 déjà\u00a0vu" in out
    if options:
        assert json.loads(out)["undefined"] == list(sly.undefined)


@pytest.mark.parametrize(("report", "code"), [(GOOD, 0), (BAD, 1), (replace(GOOD, text_equal=False), 1)])
def test_verify_exit_code(dotwave, stand_in, report, code) -> None:
    stand_in("api.felt", verify=lambda path, icon: report)
    assert dotwave("verify", "x.wav").code == code
    assert json.loads(dotwave("verify", "x.wav", "--json").out)["ok"] is (code == 0)


@pytest.mark.parametrize(
    "root", [AppError, chainsim.ChainError, drivers.DriverError, encoders.EncodeError, planner.PlanError]
)
def test_bad_input_is_one_line_and_exit_code_2(dotwave, stand_in, root) -> None:
    def fail(path: Path, icon: str | None) -> VerifyReport:
        raise root(f"{path}: what is wrong\nand the cure")

    stand_in("api.felt", verify=fail)
    ended = dotwave("verify", "x.wav")
    assert (ended.code, ended.out, ended.err) == (2, "", "dotwave: x.wav: what is wrong and the cure\n")


def test_ctrl_c_is_130(dotwave, stand_in) -> None:
    def interrupt(path: Path, icon: str | None) -> VerifyReport:
        raise KeyboardInterrupt

    stand_in("api.felt", verify=interrupt)
    assert dotwave("verify", "x.wav").code == 130


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_command_and_cleans_up(tmp_path: Path, number: int) -> None:
    partial = tmp_path / "partial"
    code = f"""
import signal, sys, types
signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell in the background had ignored
from pathlib import Path
from dotwave.cli.app import main
def verify(path, icon):
    partial = Path({str(partial)!r})
    try:
        partial.touch()
        print("ready", flush=True)
        signal.pause()
    finally:
        partial.unlink()
sys.modules["dotwave.verification"] = types.ModuleType("dotwave.verification")
sys.modules["dotwave.verification"].verify = verify
sys.argv = ["dotwave", "verify", "x.wav"]
main()
"""
    with subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(number)
        assert process.wait(timeout=300) == 128 + number
    assert not partial.exists()


@pytest.mark.parametrize(
    "arguments",
    [["text"], ["text", "a", "--dots", "7"], ["text", "a", "--cell-gap", "-1"], ["nonsense"], ["verify", "--colour"]],
)
def test_wrong_usage_is_2(dotwave, arguments) -> None:
    ended = dotwave(*arguments)
    assert (ended.code, ended.out) == (2, "")
    assert "Usage: dotwave" in ended.err


def test_devices(dotwave) -> None:
    listed = dotwave("devices")
    assert all(f"{name}:" in listed.out for name in device_names())
    answer = json.loads(dotwave("devices", "linked-6x6", "--json").out)
    assert answer["devices"] == [chainsim.load_device("linked-6x6").as_dict()]
    one = dotwave("devices", "linked-6x6").out
    assert re.search(r"delta: 0.0053006 +\(assumed: .*Q = 189", one)
    unknown = dotwave("devices", "nonsense")
    assert unknown.code == 2
    assert len(unknown.err.splitlines()) == 1


def test_tables(dotwave) -> None:
    answer = json.loads(dotwave("tables", "en-ueb", "--json").out)
    files = [table["file"] for table in answer["tables"]]
    assert "en-ueb-g2.ctb" in files
    assert "de-g2.ctb" not in files
    assert {"file", "language", "grade", "recommended", "name"} == set(answer["tables"][0])
    lines = dotwave("tables", "en-ueb").out.splitlines()
    assert [line.split()[0] for line in lines] == files
    assert dotwave("tables", "no such language").code == 2


def test_simulate_prints_strict_json_and_says_ok_by_its_exit_code(dotwave, tmp_path: Path, monkeypatch) -> None:
    chain = tmp_path / "chain.yaml"
    setting = "chain: {n: 2, delta: 0.05, beta: 0.0}\nsetting: {epsilon: 0.01, lam: 0.02, omega: 1.1}\n"
    chain.write_text(setting + "rung: linear\ntol: 1.0e-6\nstart: rest\n")
    ended = dotwave("simulate", chain)
    assert ended.code == 0
    answer = json.loads(ended.out, parse_constant=pytest.fail)
    first = 0.01 / (1 - 1.1**2 + 1j * 0.05 * 1.1)
    assert complex(*answer["phasor"][0]) == pytest.approx(first, rel=1e-9)
    assert dotwave("simulate", tmp_path / "missing.yaml").code == 2
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(chain.read_bytes())))
    assert json.loads(dotwave("simulate", "-").out)["phasor"] == answer["phasor"]
    chain.write_text(setting.replace("beta: 0.0", "beta: -1.0").replace("0.01", "9.0") + "tol: 1.0e-6\n")
    escaped = dotwave("simulate", chain)
    assert escaped.code == 1
    assert json.loads(escaped.out, parse_constant=pytest.fail)["outcome"] == "escaped"


def test_text_argument_is_stdin_file_or_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "story").write_text("Once")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO("upon".encode("utf-8-sig"))))
    assert text_source("-").text == "upon"
    assert text_source("story").text == "Once"
    for words in ("Hello", "either / or", "and so on .txt", "x" * 5000, "see notes.txt please"):
        assert text_source(words).text == words


@pytest.mark.parametrize("argument", ["missing.txt", "folder/missing", "/", "and/or", "B.BRF"])
def test_text_argument_that_cannot_be_meant(argument: str) -> None:
    with pytest.raises(AppError, match="dotwave text -"):
        text_source(argument)


@pytest.mark.parametrize("argument", ["", " ", "a\0b", "\udcff"])
def test_text_argument_that_is_not_text(argument: str) -> None:
    with pytest.raises(encoders.EncodeError):
        text_source(argument)


def modules_after(*arguments: str, cwd: Path) -> set[str]:
    """Top-level modules a command imported, from a process of its own."""
    code = "import atexit, sys; atexit.register(lambda: print(*sys.modules, file=sys.stderr)); "
    code += "from dotwave.cli.app import main; main()"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code, *arguments]
    ran = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr[:2000]
    return {name.split(".")[0] for name in ran.stderr.split()}


def test_help_is_light(tmp_path: Path) -> None:
    assert not modules_after("--help", cwd=tmp_path) & {"numpy", "rich", "pydantic", "yaml", "PIL", "numba", "scipy"}


def test_text_on_a_static_device_imports_no_compiler(tmp_path: Path) -> None:
    heavy = {"numba", "llvmlite", "scipy", "matplotlib", "dask", "PIL", "rich"}
    loaded = modules_after("text", "Hello", "-o", "x.wav", cwd=tmp_path)
    assert not loaded & heavy
    assert (tmp_path / "x.wav").stat().st_size > 1000
    assert (tmp_path / "x.json").is_file()
