"""`./run`: what it installs and when, with a stand-in for Python that writes down how it is called."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# Answers like Python to what `run` asks, and writes pip and dotwave calls into a log.
STAND_IN = """#!/bin/sh
log={log}
case $1 in
-c) case $2 in *version_info*) exit {too_old} ;; *) exit 0 ;; esac ;;
-m) case $2 in
    venv) mkdir -p "$3/bin"; cp "$0" "$3/bin/python" ;;
    pip) echo "pip $*" >>"$log"; [ ! -e "$log.broken" ] ;;
    dotwave) shift 2; printf '%s|' "$PWD" "$@" >>"$log"; echo >>"$log"; exit {code} ;;
    *) echo "tool $2 $*" >>"$log"; case "$2" in {failing}) exit 1 ;; esac ;;
    esac ;;
esac
"""


class House:
    """A clone of the two files `run` needs, in a folder with a space in its name."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "a clone"
        self.root.mkdir()
        shutil.copy(ROOT / "run", self.root / "run")
        (self.root / "pyproject.toml").write_text("[project]\n")
        (self.root / "requirements").mkdir()
        for name in ("app.txt", "dev.txt"):
            (self.root / "requirements" / name).write_text("numpy==2.4.6\n")
        self.log = folder / "log"
        self.log.touch()
        self.python = folder / "python"
        self.stand_in()

    def stand_in(self, *, too_old: int = 0, code: int | str = 0, failing: str = "nothing") -> None:
        self.python.write_text(STAND_IN.format(log=self.log, too_old=too_old, code=code, failing=failing))
        self.python.chmod(0o755)

    def run(self, *arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
        environment = os.environ | {"PYTHON": str(self.python)}
        command = [str(self.root / "run"), *arguments]
        return subprocess.run(command, cwd=cwd or self.root, env=environment, capture_output=True, text=True)

    def called(self, what: str) -> list[str]:
        return [line for line in self.log.read_text().splitlines() if line.startswith(what)]

    def installed(self) -> list[str]:
        """What was installed, after the versions it needs."""
        return [line.split()[-1] for line in self.called("pip") if "--editable" in line]


@pytest.fixture
def house(tmp_path: Path) -> House:
    return House(tmp_path)


def test_installs_once(house: House) -> None:
    assert house.run("dotwave", "doctor").returncode == 0
    assert len(house.installed()) == 1
    second = house.run("dotwave", "doctor")
    assert second.returncode == 0
    assert second.stderr == ""
    assert len(house.installed()) == 1


def test_installs_again_when_the_requirements_change(house: House) -> None:
    house.run("dotwave", "doctor")
    (house.root / "pyproject.toml").write_text("[project]\nname = 'other'\n")
    house.run("dotwave", "doctor")
    assert len(house.installed()) == 2


def test_installs_again_after_the_folder_moved(house: House) -> None:
    house.run("dotwave", "doctor")
    house.root = house.root.rename(house.root.parent / "moved")
    house.run("dotwave", "doctor")
    assert len(house.installed()) == 2


def test_rebuilds_an_environment_without_its_python(house: House) -> None:
    house.run("dotwave", "doctor")
    (house.root / ".venv" / "bin" / "python").unlink()
    assert house.run("dotwave", "doctor").returncode == 0
    assert len(house.installed()) == 2


def test_an_installation_that_failed_is_tried_again(house: House) -> None:
    broken = Path(f"{house.log}.broken")
    broken.touch()
    failed = house.run("dotwave", "doctor")
    assert failed.returncode == 1
    assert "pip could not install" in failed.stderr
    assert "the Python package registry (PyPI)" in failed.stderr
    broken.unlink()
    assert house.run("dotwave", "doctor").returncode == 0
    assert house.installed() == ["."]


def test_tools_are_installed_for_the_tests_only(house: House) -> None:
    house.run("dotwave", "doctor")
    assert [line for line in house.called("pip") if "--require-hashes" in line and "requirements/app.txt" in line]
    assert not [line for line in house.called("pip") if "requirements/dev.txt" in line]
    house.run("test")
    assert [line for line in house.called("pip") if "--require-hashes" in line and "requirements/dev.txt" in line]
    house.run("dotwave", "doctor")
    house.run("test")
    assert len(house.installed()) == 2


def test_installs_again_when_a_tested_version_changes(house: House) -> None:
    house.run("dotwave", "doctor")
    (house.root / "requirements" / "app.txt").write_text("numpy==2.4.7\n")
    house.run("dotwave", "doctor")
    assert len(house.installed()) == 2


def test_the_notebook_is_made_of_the_tutorial_and_opened(house: House) -> None:
    assert house.run("notebook").returncode == 0
    assert house.installed() == [".[notebook]"]
    made, opened = house.called("tool")
    assert made == "tool jupytext -m jupytext --quiet --to notebook --output out/tutorial.ipynb docs/tutorial.py"
    assert opened == "tool jupyterlab -m jupyterlab out/tutorial.ipynb"
    house.run("dotwave", "doctor")
    assert len(house.installed()) == 1


def test_a_notebook_that_cannot_be_made_is_said(house: House) -> None:
    house.stand_in(failing="jupytext")
    ended = house.run("notebook")
    assert ended.returncode == 1
    assert "jupytext could not make the notebook" in ended.stderr
    assert [line.split()[1] for line in house.called("tool")] == ["jupytext"]


def test_the_pages_are_built_with_tools_of_their_own(house: House) -> None:
    assert house.run("docs", "--dirty").returncode == 0
    assert house.installed() == [".[docs]"]
    assert house.called("tool mkdocs")[0].endswith("mkdocs build --quiet --strict --dirty")
    assert house.run("docs").returncode == 0
    assert len(house.installed()) == 1


def test_pages_with_a_fault_are_a_failure(house: House) -> None:
    house.stand_in(failing="mkdocs")
    ended = house.run("docs")
    assert ended.returncode == 1
    assert "the pages are in" not in ended.stderr


def test_arguments_folder_and_exit_code_pass_through(house: House, tmp_path: Path) -> None:
    house.stand_in(code=7)
    elsewhere = tmp_path / "else where"
    elsewhere.mkdir()
    ended = house.run("dotwave", "text", "two words", "", "-o", "x.wav", cwd=elsewhere)
    assert ended.returncode == 7
    assert house.called(str(elsewhere)) == [f"{elsewhere}|text|two words||-o|x.wav|"]


def test_an_old_python_is_refused_with_the_cure(house: House) -> None:
    house.stand_in(too_old=1)
    ended = house.run("dotwave", "doctor")
    assert ended.returncode == 1
    assert "Python 3.11 or newer" in ended.stderr
    assert len(ended.stderr.splitlines()) == 1


@pytest.mark.parametrize("failing", ["ruff", "mypy", "pytest"])
def test_one_failed_check_fails_the_run_after_all_have_run(house: House, failing: str) -> None:
    house.stand_in(failing=failing)
    ended = house.run("test")
    assert ended.returncode == 1
    assert [line.split()[1] for line in house.called("tool")] == ["ruff", "ruff", "mypy", "pytest"]
    assert f"failed: {failing}" in ended.stderr


def test_all_adds_the_slow_tests_and_the_rest_goes_to_pytest(house: House) -> None:
    assert house.run("test", "tests/a b.py", "-x").returncode == 0
    assert house.run("test", "-x", "--all").returncode == 0
    usual, everything = (line for line in house.called("tool") if " pytest " in line)
    assert "-m not slow" in usual
    assert usual.endswith("tests/a b.py -x")
    assert "not slow" not in everything
    assert "--all" not in everything


def test_how_long_the_tests_take_is_said_before(house: House) -> None:
    usual, everything, some = (house.run("test", *arguments) for arguments in ([], ["--all"], ["tests/test_x.py"]))
    assert "run: the tests take about 8 minutes on two cores; here they use " in usual.stderr
    assert "run: the tests take about 40 minutes on two cores" in everything.stderr
    assert "minutes" not in some.stderr
    cores = re.search(r"here they use (\d+)$", usual.stderr, flags=re.MULTILINE)
    assert cores is not None
    assert int(cores[1]) == min(os.cpu_count() or 2, 8)
    assert all(f" -n {cores[1]}" in line for line in house.called("tool") if " pytest " in line)


@pytest.mark.parametrize(
    ("failing", "code", "steps"),
    [("", 0, ["text", "verify", "preview"]), ("verify", 1, ["text", "verify", "preview"]), ("text", 1, ["text"])],
)
def test_demo_shows_also_what_failed_to_verify(house: House, failing: str, code: int, steps: list[str]) -> None:
    house.stand_in(code=f'$([ "$1" = "{failing}" ] && echo 1 || echo 0)')
    (house.root / "samples" / "texts").mkdir(parents=True)
    (house.root / "samples" / "texts" / "paragraph.txt").write_text("Hello")
    ended = house.run("demo", cwd=house.root.parent)
    assert ended.returncode == code
    calls = [line.split("|") for line in house.called(str(house.root))]
    assert [call[1] for call in calls] == steps
    assert all(f"$ dotwave {' '.join(call[1:-1])}" in ended.stdout for call in calls)


def test_demo_without_its_text_says_so(house: House) -> None:
    ended = house.run("demo")
    assert ended.returncode == 1
    assert "samples/texts/paragraph.txt is missing" in ended.stderr


def test_usage(house: House) -> None:
    assert house.run("--help").returncode == 0
    unknown = house.run("frobnicate")
    assert unknown.returncode == 2
    assert "usage:" in unknown.stderr
    assert not (house.root / ".venv").exists()


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="shellcheck is not installed")
def test_shellcheck() -> None:
    subprocess.run(["shellcheck", "-s", "sh", ROOT / "run", ROOT / ".ci" / "run"], check=True)


def test_scripts_can_be_started() -> None:
    for script in (ROOT / "run", ROOT / ".ci" / "run"):
        assert os.access(script, os.X_OK)
        assert script.read_text().startswith("#!/bin/sh\n")
