"""Odd names and odd members: one never ends a set, all of them are safe to show and to write."""

from __future__ import annotations

import gzip
import io
import json
import os
import struct
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import unquote_to_bytes

import pytest

from dotwave.errors import AppError
from dotwave.icon_sets.archives import LONGEST_HEADER
from dotwave.icon_sets.build import IconOptions, render_icons
from dotwave.icon_sets.names import shown_name
from dotwave.icon_sets.sources import find_icons, read_icons

HEART = (Path(__file__).resolve().parents[3] / "samples" / "icons" / "heart.svg").read_bytes()
ONE = IconOptions(workers=1, waveforms=True)


def tarred(archive: Path, *entries: tarfile.TarInfo) -> Path:
    with tarfile.open(archive, "w:gz") as out:
        for entry in entries:
            entry.size = len(HEART) if entry.isreg() else 0
            out.addfile(entry, io.BytesIO(HEART))
    return archive


def found(*sources: Path) -> dict[str, str]:
    """Names with their errors, empty where the bytes are the heart's."""
    files = {file.name: file for file in read_icons(find_icons([str(source) for source in sources]))}
    assert all(file.data == HEART for file in files.values() if not file.error)
    return {name: file.error for name, file in files.items()}


@pytest.mark.parametrize(
    ("raw", "shown"),
    [
        (b"plain name (2).svg", "plain name (2).svg"),
        ("Grüße/שלום.svg".encode(), "Grüße/שלום.svg"),
        (b"100%.svg", "100%.svg"),
        (b"\xff\xfe.svg", "%FF%FE.svg"),
        (b"a\nb\tc\x1b[m\x7f.svg", "a%0Ab%09c%1B[m%7F.svg"),
        ("x\u202egvs.svg".encode(), "x%E2%80%AEgvs.svg"),
        (b"C:\\x\\..\\y.svg", "C%3A%5Cx%5C..%5Cy.svg"),
        (b"/abs/../../up.svg", "abs/up.svg"),
        (b"//./a/./b.svg", "a/b.svg"),
    ],
)
def test_names_are_shown_and_kept(raw: bytes, shown: str) -> None:
    name = shown_name(os.fsdecode(raw))
    assert name == shown
    if b".." not in raw and b"/." not in raw and b"%" not in raw:
        assert unquote_to_bytes(name) == raw


def test_one_odd_name_does_not_end_a_set(tmp_path: Path) -> None:
    folder, out = tmp_path / "set", tmp_path / "out"
    folder.mkdir()
    raw = [
        b"\xff\xfe.svg",
        b"a\nb.svg",
        b"tab\t.svg",
        b"%FF%FE.svg",
        b"plain.svg",
        "\u202egvs.svg".encode(),
        b"c:d.svg",
    ]
    for name in raw:
        (folder / os.fsdecode(name)).write_bytes(HEART)
    report = render_icons([str(folder)], out, ONE)
    assert report.ok
    names = {icon.name for icon in report.icons}
    assert len(names) == len(raw)
    assert {"%FF%FE.svg", "%FF%FE.svg (2)", "a%0Ab.svg", "plain.svg"} <= names
    for path in out.rglob("*"):
        assert path.name.encode()  # whole UTF-8
        assert path.name.isprintable()
        if path.suffix in {".html", ".csv", ".json", ".jsonl"}:
            path.read_text(encoding="utf-8", errors="strict")
    for icon in report.icons:
        assert json.loads((out / icon.waveform).with_suffix(".json").read_text(encoding="utf-8"))
    assert render_icons([str(folder)], out, ONE).worked == 0


def test_a_set_can_lie_below_an_odd_folder(dotwave: Callable[..., Any], tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"\xff\n\x1b[31m")
    folder.mkdir()
    (folder / "a.svg").write_bytes(HEART)
    for given in ((folder,), (folder, tmp_path / "*.svg"), (folder / "a.svg",)):
        (tmp_path / "b.svg").write_bytes(HEART)
        ended = dotwave("icons", *given, "-o", folder / "out", "--workers", 1)
        assert ended.code == 0
        assert "\x1b" not in ended.out


def test_names_stay_below_the_output(tmp_path: Path) -> None:
    names = [
        "../../up.svg",
        "/abs.svg",
        "a/../../b.svg",
        "C:\\w.svg",
        "w\\..\\..\\x.svg",
        "\\\\host\\share.svg",
        "nul\0.svg",
    ]
    archive = tarred(tmp_path / "set.tgz", *map(tarfile.TarInfo, names[:-1]))
    with tarfile.open(tmp_path / "nul.tar", "w", format=tarfile.PAX_FORMAT) as out:
        entry = tarfile.TarInfo("x")
        entry.size, entry.pax_headers = len(HEART), {"path": names[-1]}
        out.addfile(entry, io.BytesIO(HEART))
    before = set(tmp_path.iterdir())
    report = render_icons([str(archive), str(tmp_path / "nul.tar")], tmp_path / "deep" / "er" / "out", ONE)
    assert report.ok
    assert len(report.icons) == len(names)
    assert set(tmp_path.iterdir()) - before == {tmp_path / "deep"}
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["er"]
    assert [path.name for path in (tmp_path / "deep" / "er").iterdir()] == ["out"]
    for icon in report.icons:
        assert ".." not in icon.name.split("/")
        assert not {"\\", ":", "\0"} & set(icon.name)
        assert (tmp_path / "deep/er/out" / icon.waveform).is_file()


@pytest.mark.parametrize("length", [240, 249, 300, 5000])
def test_a_name_too_long_is_its_own_failure(tmp_path: Path, length: int) -> None:
    long = "/".join(["d" * 200] * (length // 201) + ["e" * (length % 201)]) if length > 300 else "n" * length
    archive = tarred(tmp_path / "set.tgz", tarfile.TarInfo("heart.svg"), tarfile.TarInfo(f"{long}.svg"))
    report = render_icons([str(archive)], tmp_path / "out", ONE)
    assert len(report.icons) == 2
    assert [icon.waveform for icon in report.icons if icon.name == "heart.svg"] == ["waveforms/heart.svg.wav"]
    assert set(report.failed) == {f"{long}.svg"}
    assert "shorten it" in report.failed[f"{long}.svg"]


def test_a_folder_named_as_a_waveform_is_its_own_failure(tmp_path: Path) -> None:
    names = ("x.svg", "x.svg.wav/y.svg", "z.svg")
    archive = tarred(tmp_path / "set.tgz", *map(tarfile.TarInfo, names))
    report = render_icons([str(archive)], tmp_path / "out", ONE)
    assert len(report.icons) == 3
    assert set(report.failed) <= {"x.svg", "x.svg.wav/y.svg"}
    assert len(report.failed) == 1
    assert (tmp_path / "out" / "waveforms" / "z.svg.wav").is_file()


def test_sources_with_long_and_odd_names_are_refused_in_one_line(dotwave: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "heart.svg").write_bytes(HEART)
    for source, output in (
        ("n" * 5000, "out"),
        ("a\nb\x1b[31m", "out"),
        ("heart.svg", "n" * 300),
        ("heart.svg", "heart.svg"),
    ):
        ended = dotwave("icons", tmp_path / source, "-o", tmp_path / output)
        assert ended.code == 2
        assert ended.err.count("\n") == 1
        assert "\x1b" not in ended.err


def zipped(archive: Path, *names: str, **kept: Any) -> Path:
    with zipfile.ZipFile(archive, "w", **kept) as out:
        for name in names:
            out.writestr(name, HEART)
    return archive


def test_zip_names_that_are_not_what_they_say(tmp_path: Path) -> None:
    """A name that is said to be UTF-8 and is not, which ends zipfile; and a name of code page 437."""
    archive = zipped(tmp_path / "set.zip", "é.svg", "a.svg", "ü.svg")
    data = archive.read_bytes()
    archive.write_bytes(data.replace("é".encode(), b"\xff\xfe"))
    errors = found(archive)
    assert "pack the archive again" in errors.pop("\u00a0■.svg")
    assert errors == {"a.svg": "", "ü.svg": ""}
    old = zipped(tmp_path / "old.zip", "qq.svg")
    old.write_bytes(old.read_bytes().replace(b"qq", b"\x81\x1b"))
    assert found(old) == {"ü%1B.svg": ""}


def test_a_member_that_cannot_be_read_stops_no_other(tmp_path: Path) -> None:
    """Encrypted, packed in a way nobody knows, spoiled, with another name inside; and one in good order after them."""
    names = ["crypt.svg", "kind.svg", "spoilt.svg", "other.svg", "zgood.svg"]
    archive = zipped(tmp_path / "set.zip", *names)
    data = bytearray(archive.read_bytes())
    with zipfile.ZipFile(archive) as packed:
        local = {info.filename: info.header_offset for info in packed.infolist()}
    place = data.index(b"PK\1\2")
    for name in names:
        if name == "crypt.svg":
            struct.pack_into("<H", data, place + 8, 1)
        if name == "kind.svg":
            struct.pack_into("<H", data, place + 10, 77)
        place += 46 + len(name)
    data[local["spoilt.svg"] + 60] ^= 0xFF
    data[local["other.svg"] + 30] ^= 0x01
    archive.write_bytes(data)
    errors = found(archive)
    assert errors.pop("zgood.svg") == ""
    assert "encrypted; pack the archive without a password" in errors["crypt.svg"]
    assert set(errors) == set(names[:4])
    assert all(error.startswith("cannot be read: ") and "\n" not in error for error in errors.values())


def test_links_devices_and_folders_in_a_tar_are_left_out(tmp_path: Path) -> None:
    entries = [tarfile.TarInfo("good.svg")]
    for kind in (tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.CHRTYPE, tarfile.BLKTYPE, tarfile.FIFOTYPE, tarfile.DIRTYPE):
        entry = tarfile.TarInfo(f"{kind.decode()}.svg")
        entry.type, entry.linkname = kind, "/etc/passwd"
        entries.append(entry)
    assert found(tarred(tmp_path / "set.tgz", *entries)) == {"good.svg": ""}


def test_a_name_twice_counts_once(tmp_path: Path) -> None:
    archive = tmp_path / "set.tar"
    with tarfile.open(archive, "w") as out:
        for data in (HEART, b"later"):
            entry = tarfile.TarInfo("a.svg")
            entry.size = len(data)
            out.addfile(entry, io.BytesIO(data))
    assert found(archive) == {"a.svg": ""}


@pytest.mark.parametrize("kind", [tarfile.XHDTYPE, tarfile.XGLTYPE, tarfile.GNUTYPE_LONGNAME])
def test_a_header_that_unpacks_to_much_is_not_read(tmp_path: Path, kind: bytes) -> None:
    header = tarfile.TarInfo("x")
    header.type, header.size = kind, LONGEST_HEADER + 1
    archive = tmp_path / "bomb.tgz"
    with gzip.open(archive, "wb") as out:
        out.write(header.tobuf() + bytes(LONGEST_HEADER + 1024))
    with pytest.raises(AppError, match=f"a header of {LONGEST_HEADER + 1} bytes") as caught:
        find_icons([str(archive)])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", [".zip", ".tgz"])
def test_a_member_that_unpacks_to_much_is_read_in_part(tmp_path: Path, suffix: str) -> None:
    size = 66_000_000
    archive = tmp_path / f"bomb{suffix}"
    if suffix == ".zip":
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as out, out.open("a.svg", "w") as file:
            for _ in range(size // 1_000_000):
                file.write(bytes(1_000_000))
    else:
        with tarfile.open(archive, "w:gz") as tar, (tmp_path / "zeros").open("wb+") as zeros:
            zeros.truncate(size)
            tar.addfile(tar.gettarinfo(arcname="a.svg", fileobj=zeros), zeros)
    (icon,) = read_icons(find_icons([str(archive)]))
    assert not icon.error
    assert len(icon.data) == 64_000_001


@pytest.mark.parametrize("suffix", [".zip", ".tar", ".tgz", ".tar.xz"])
@pytest.mark.parametrize("content", [b"", b"PK\5\6" + bytes(18), bytes(10240)])
def test_empty_archives_are_refused_in_one_line(tmp_path: Path, suffix: str, content: bytes) -> None:
    archive = tmp_path / f"empty{suffix}"
    archive.write_bytes(content)
    with pytest.raises(AppError) as caught:
        find_icons([str(archive)])
    assert "\n" not in str(caught.value)
    assert "empty" in str(caught.value)


def test_an_archive_of_very_many_members(tmp_path: Path) -> None:
    archive = tmp_path / "many.zip"
    with zipfile.ZipFile(archive, "w") as out:
        for number in range(3_000):
            out.writestr(f"{number}.svg", b"")
    places = find_icons([str(archive)])
    assert len(places) == len({place.name for place in places}) == 3_000
    assert sum(1 for _ in read_icons(places)) == 3_000
