"""The wheel holds the five packages with their data, and its command starts without the tools of the tests."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("chainsim", "drivers", "dotwave", "encoders", "planner")


@pytest.mark.slow
def test_wheel(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, source / name)
    for name in PACKAGES:
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", str(tmp_path), str(source)]
    built = subprocess.run(build, capture_output=True, text=True)
    if built.returncode and "setuptools" in built.stderr:
        pytest.skip("pip cannot fetch setuptools here")
    assert built.returncode == 0, built.stderr
    (wheel,) = tmp_path.glob("dotwave-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        inside = set(archive.namelist())
        archive.extractall(tmp_path / "site")
    wanted = {
        str(path.relative_to(source))
        for name in PACKAGES
        for path in (source / name).rglob("*")
        if path.suffix in {".py", ".pyi", ".yaml", ".md", ".h"} or path.name == "py.typed"
    }
    assert {name for name in inside if ".dist-info" not in name} == wanted
    start = f"import sys; sys.path.insert(0, {str(tmp_path / 'site')!r}); import dotwave; print(dotwave.__file__); "
    start += "from dotwave.cli.app import main; sys.argv = ['dotwave', 'devices']; main()"
    ran = subprocess.run([sys.executable, "-I", "-c", start], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert ran.stdout.startswith(str(tmp_path / "site"))
    assert "linked-6x6:" in ran.stdout
