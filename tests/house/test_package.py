"""What is handed on: tested versions with digests, a complete source archive, a wheel that runs on every Python."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("chainsim", "drivers", "dotwave", "encoders", "planner")
PYTHONS = ("3.11", "3.12", "3.13", "3.14")


def locked(name: str) -> dict[str, list[tuple[str, int]]]:
    """Package -> its versions in a file of `requirements/`, and how many digests each has."""
    found: dict[str, list[tuple[str, int]]] = {}
    text = (ROOT / "requirements" / name).read_text(encoding="utf-8")
    for block in re.split(r"\n(?=[a-z0-9])", text):
        head = re.match(r"([\w.-]+)(?:\[[\w,]+\])?==([\w.!+]+)", block)
        if head:
            digests = block.count("--hash=sha256:")
            found.setdefault(canonicalize_name(head[1]), []).append((head[2], digests))
    return found


def test_the_lock_holds_what_is_required() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = {"app.txt": project["dependencies"]}
    wanted["dev.txt"] = wanted["app.txt"] + project["optional-dependencies"]["dev"]
    for name, requirements in wanted.items():
        lock = locked(name)
        assert all(digests for versions in lock.values() for _, digests in versions)
        for requirement in map(Requirement, requirements):
            versions = lock[canonicalize_name(requirement.name)]
            assert all(version in requirement.specifier for version, _ in versions), (
                f"{name}: {requirement}; ./run lock"
            )
    assert locked("app.txt").items() <= locked("dev.txt").items(), "two versions of one package: ./run lock"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the source archive, and the wheel that was built from it."""
    folder = tmp_path_factory.mktemp("dist")
    source = folder / "source"
    unwanted = shutil.ignore_patterns(".git", ".venv*", "out", "__pycache__", ".*_cache", ".hypothesis", "*.egg-info")
    shutil.copytree(ROOT, source, ignore=unwanted)
    build = [sys.executable, "-m", "build", "--outdir", str(folder), str(source)]
    made = subprocess.run(build, capture_output=True, text=True)
    if made.returncode and "No matching distribution" in made.stdout + made.stderr:
        pytest.skip("pip cannot fetch setuptools here")
    assert made.returncode == 0, made.stderr
    return folder


@pytest.mark.slow
def test_the_source_archive_is_complete(built: Path) -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("not a clone: nothing to compare with")
    (archive,) = built.glob("dotwave-*.tar.gz")
    with tarfile.open(archive) as files:
        inside = {name.partition("/")[2] for name in files.getnames()}
        files.extractall(built / "unpacked", filter="data")
    assert {name for name in listed.stdout.split("\n") if name} - inside == {".gitignore"}
    (tree,) = (built / "unpacked").iterdir()
    tests = ["tests/house/test_layers.py", "tests/encoders/test_dots.py", "tests/drivers/test_wav.py"]
    run = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests]
    passed = subprocess.run(run, cwd=tree, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(tree)})
    assert passed.returncode == 0, passed.stdout


@pytest.mark.slow
def test_the_wheel_is_complete(built: Path) -> None:
    (wheel,) = built.glob("dotwave-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        inside = set(archive.namelist())
    data = {".py", ".pyi", ".yaml", ".md", ".h", ".c", ".ld", ".xz", ".html", ".css", ".js"}
    wanted = {
        str(path.relative_to(ROOT))
        for name in PACKAGES
        for path in (ROOT / name).rglob("*")
        if path.suffix in data or path.name in {"py.typed", "LICENSE-UNICODE", "Makefile"}
    }
    assert {name for name in inside if ".dist-info/" not in name} == wanted
    assert any(name.endswith("licenses/LICENSE-MIT") for name in inside)


def interpreter(version: str) -> str | None:
    """Where a Python of this version is: on the path, or among pyenv's, whose stand-ins on the path may not run."""
    homes = sorted(map(str, Path.home().glob(f".pyenv/versions/{version}.*/bin/python")))
    for candidate in filter(None, [shutil.which(f"python{version}"), *homes]):
        if subprocess.run([candidate, "--version"], capture_output=True).returncode == 0:
            return candidate
    return None


@pytest.mark.slow
@pytest.mark.parametrize("version", PYTHONS)
def test_the_wheel_runs(built: Path, tmp_path: Path, version: str) -> None:
    python = interpreter(version)
    if python is None:
        pytest.skip(f"no Python {version} here")
    (wheel,) = built.glob("dotwave-*.whl")
    home, env = tmp_path / "venv", os.environ | {"DOTWAVE_CACHE": str(tmp_path / "cache"), "PYTHONPATH": ""}
    subprocess.run([python, "-m", "venv", str(home)], check=True)
    pip = [str(home / "bin" / "python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "--require-hashes", "-r", str(ROOT / "requirements" / "app.txt")], check=True)
    subprocess.run([*pip, "--no-deps", str(wheel)], check=True)

    def dotwave(*words: str) -> str:
        command = [str(home / "bin" / "dotwave"), *words]
        ran = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True)
        assert ran.returncode == 0, ran.stderr
        return ran.stdout

    assert "linked-6x6:" in dotwave("devices")
    dotwave("text", "Hello", "--device", "linked-6x6", "-o", "hello.wav")
    assert "Wrong dots: 0." in dotwave("verify", "hello.wav")
