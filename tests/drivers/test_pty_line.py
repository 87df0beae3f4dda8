"""The name of an emulator's port: only a link that an emulator made is ever replaced or taken away."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from drivers import FileError
from drivers.protocol.pty_line import PtyLine, make_link

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")

GONE = "/dev/pts/987654321"


def regular(link: Path) -> None:
    link.write_bytes(b"precious")


def folder(link: Path) -> None:
    link.mkdir()


def to_a_file(link: Path) -> None:
    link.with_name("target").write_bytes(b"precious")
    link.symlink_to(link.with_name("target"))


def to_nothing(link: Path) -> None:
    """Such as a board that is not plugged in."""
    link.symlink_to("/dev/ttyUSB987654321")


def to_a_terminal(link: Path) -> None:
    link.symlink_to(os.ttyname(os.openpty()[1]))


def pipe(link: Path) -> None:
    os.mkfifo(link)


def seen(link: Path) -> tuple[int, int, str | None]:
    state = link.lstat()
    return state.st_ino, state.st_mtime_ns, os.readlink(link) if link.is_symlink() else None


@pytest.mark.parametrize("there", [regular, folder, to_a_file, to_nothing, to_a_terminal, pipe])
def test_what_no_emulator_made_is_refused_and_stays(tmp_path: Path, there: Callable[[Path], None]) -> None:
    link = tmp_path / "port"
    there(link)
    before, names = seen(link), sorted(tmp_path.iterdir())
    with pytest.raises(FileError, match=r"port: this is .*; move it away, or give --link another name") as caught:
        PtyLine(link)
    assert "\n" not in str(caught.value)
    assert (seen(link), sorted(tmp_path.iterdir())) == (before, names)


def test_the_command_says_it_in_one_line(tmp_path: Path, dotwave: Callable[..., object]) -> None:
    link = tmp_path / "notes.txt"
    link.write_bytes(b"precious")
    ended = dotwave("emulate", "--device", "independent-6x6", "--link", link, "--seconds", "0.01")
    assert ended.code == 2  # type: ignore[attr-defined]
    assert ended.err.count("\n") == 1  # type: ignore[attr-defined]
    assert link.read_bytes() == b"precious"


def test_the_link_of_a_dead_emulator_is_replaced(tmp_path: Path) -> None:
    link = tmp_path / "port"
    link.symlink_to(GONE)
    line = PtyLine(link)
    own = os.readlink(link)
    assert own != GONE
    # The system may give the number of the dead one's pty to the next.
    make_link(link, own)
    assert os.readlink(link) == own
    line.close()
    assert list(tmp_path.iterdir()) == []


def test_only_its_own_link_is_taken_away(tmp_path: Path) -> None:
    link = tmp_path / "port"
    for there in (regular, to_nothing):
        line = PtyLine(link)
        link.unlink()
        there(link)
        before = seen(link)
        line.unplug()
        assert seen(link) == before
        with pytest.raises(FileError, match="not a port that dotwave made"):
            line.plug()
        assert not line.plugged
        line.close()
        assert seen(link) == before
        link.unlink()


def test_the_cable_may_be_pulled_and_plugged(tmp_path: Path) -> None:
    line = PtyLine(tmp_path / "port")
    for _ in range(3):
        assert (tmp_path / "port").resolve().is_char_device()
        line.unplug()
        assert list(tmp_path.iterdir()) == []
        line.plug()
    line.close()
    line.close()
    assert list(tmp_path.iterdir()) == []


def test_two_emulators_do_not_share_a_name(tmp_path: Path) -> None:
    line = PtyLine(tmp_path / "port")
    before = seen(tmp_path / "port")
    with pytest.raises(FileError, match="the port of a terminal in use"):
        PtyLine(tmp_path / "port")
    assert seen(tmp_path / "port") == before
    line.close()
