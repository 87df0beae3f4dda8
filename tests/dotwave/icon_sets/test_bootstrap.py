"""Two thousand icons of others: none alike, at little loss (npm fetches them)."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from dotwave.icon_sets.build import IconOptions, render_icons


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("needs npm")
    folder = tmp_path_factory.mktemp("npm")
    packed = subprocess.run([npm, "pack", "bootstrap-icons"], cwd=folder, capture_output=True, timeout=120)
    if packed.returncode:
        pytest.skip("npm cannot fetch bootstrap-icons")
    (archive,) = folder.glob("bootstrap-icons-*.tgz")
    return archive


@pytest.mark.slow
def test_no_two_of_two_thousand_icons_are_alike(package: Path, tmp_path: Path) -> None:
    plain = render_icons([str(package)], tmp_path / "plain")
    apart = render_icons([str(package)], tmp_path / "apart", IconOptions(distinct=True))
    assert len(plain.icons) == len(apart.icons) > 2000
    assert all(icon.outcome == "ok" for report in (plain, apart) for icon in report.icons)
    # The sheet of all icons at once is the one file over the limit of an SVG.
    assert {name for report in (plain, apart) for name in report.failed} <= {"package/bootstrap-icons.svg"}
    assert plain.pairs[0] > 0
    assert apart.pairs[0] == 0
    assert apart.neighbours <= 0.02 * len(apart.icons)
    assert apart.similarity >= 0.95 * plain.similarity
