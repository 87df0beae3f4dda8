"""What a set of icons is read from: the same pictures, whatever they are packed in."""

from __future__ import annotations

import os
import tarfile
import zipfile
from pathlib import Path
from typing import Literal

import pytest

from dotwave.errors import AppError
from dotwave.icon_sets.sources import find_icons, read_icons

PICTURES = {"a/one.svg": b"<svg/>", "a/b/two.png": b"PNG", "three.GIF": b"GIF"}
OTHERS = {"a/readme.txt": b"", ".hidden/x.svg": b"", "a/._one.svg": b"", "__MACOSX/a/one.svg": b""}


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    for name, data in (PICTURES | OTHERS).items():
        path = tmp_path / "tree" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    return tmp_path / "tree"


def packed(tree: Path, suffix: str) -> Path:
    archive = tree.with_name(f"set{suffix}")
    if suffix == ".zip":
        with zipfile.ZipFile(archive, "w") as out:
            for path in tree.rglob("*"):
                out.write(path, path.relative_to(tree))
    else:
        modes: dict[str, Literal["w:gz", "w:", "w:xz"]] = {".tgz": "w:gz", ".tar": "w:", ".tar.xz": "w:xz"}
        with tarfile.open(archive, modes[suffix]) as tar:
            tar.add(tree, ".")
    return archive


def contents(*sources: Path | str) -> dict[str, bytes]:
    return {file.name: file.data for file in read_icons(find_icons([str(source) for source in sources]))}


@pytest.mark.parametrize("suffix", [".zip", ".tgz", ".tar", ".tar.xz"])
def test_a_folder_and_its_archives_hold_the_same(tree: Path, suffix: str) -> None:
    assert contents(tree) == PICTURES
    assert contents(packed(tree, suffix)) == PICTURES


def test_a_glob_and_single_files(tree: Path) -> None:
    assert set(contents(f"{tree}/**/*.svg")) == {"one.svg"}
    assert contents(tree / "a/one.svg", tree / "three.GIF") == {"one.svg": b"<svg/>", "three.GIF": b"GIF"}


def test_order_and_repetition_change_nothing(tree: Path) -> None:
    zipped = packed(tree, ".zip")
    both = find_icons([str(tree), str(zipped)])
    assert find_icons([str(zipped), str(tree), str(tree)]) == both
    assert {place.name for place in both} == {f"{top}/{name}" for top in ("tree", "set.zip") for name in PICTURES}


def test_names_are_unique_and_stay_below_the_output(tmp_path: Path) -> None:
    archive = tmp_path / "evil.tar"
    with tarfile.open(archive, "w") as out:
        for name in ("../../x.svg", "/x.svg", "x.svg"):
            out.addfile(tarfile.TarInfo(name))
    names = [place.name for place in find_icons([str(archive)])]
    assert len(set(names)) == len(names) == 3
    assert not any(".." in name.split("/") or name.startswith("/") for name in names)


def test_what_is_not_there_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "broken.zip").write_bytes(b"PK\3\4 not really")
    for source, words in (("nowhere", "no such file"), ("broken.zip", "cannot be read"), (".", "no pictures found")):
        with pytest.raises(AppError, match=words) as caught:
            find_icons([str(tmp_path / source)])
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["", "a", "a/b"])
def test_a_folder_that_cannot_be_read_is_said(name: str, tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scandir, closed = os.scandir, {str(tree / name), str(tree / ".hidden")}

    def scan(path: str):
        if os.fspath(path) in closed:
            raise PermissionError(13, "Permission denied", os.fspath(path))
        return scandir(path)

    # Permissions do not stop root, who may run this.
    monkeypatch.setattr(os, "scandir", scan)
    with pytest.raises(AppError) as caught:
        find_icons([str(tree)])
    assert str(caught.value) == (f"{tree / name}: the folder cannot be read: Permission denied; change its permissions")
    closed.remove(str(tree / name))
    assert len(find_icons([str(tree)])) == len(PICTURES)


def test_a_damaged_member_is_reported_and_the_rest_read(tmp_path: Path) -> None:
    archive = tmp_path / "set.zip"
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_STORED) as out:
        out.writestr("a.svg", b"<svg>good</svg>")
        out.writestr("b.svg", b"<svg>spoiled</svg>")
    archive.write_bytes(archive.read_bytes().replace(b"spoiled", b"SPOILED", 1))
    found = {file.name: file for file in read_icons(find_icons([str(archive)]))}
    assert found["a.svg"].data == b"<svg>good</svg>"
    assert "CRC" in found["b.svg"].error


def test_a_file_that_went_away_is_reported(tree: Path) -> None:
    places = find_icons([str(tree)])
    (tree / "a/one.svg").unlink()
    errors = {file.name: file.error for file in read_icons(places)}
    assert "No such file" in errors.pop("a/one.svg")
    assert set(errors.values()) == {""}
