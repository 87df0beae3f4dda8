"""What `dotwave live --doctor` examines: what to type into Orca, BRLTTY and NVDA, and what is missing for it."""

from __future__ import annotations

import os
import shutil
import socket
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chainsim import load_device

from ..bridges.brlapi_port import FIRST_PORT, HOST
from ..bridges.grid_fold import GridFold
from ..bridges.run import fold_of
from .doctor import Check, Health

__all__ = ["LiveHealth", "examine_live"]

BRLTTY = "brltty -n -e -q -f /dev/null -x lx -s no"
UNIX_SOCKETS = Path("/var/lib/BrlAPI")


@dataclass(frozen=True)
class LiveHealth:
    """What to type, and the checks.

    Attributes
    ----------
    lines : name of a screen reader and what to type, in order.
    health : the checks.
    """

    lines: tuple[tuple[str, str], ...]
    health: Health

    @property
    def ok(self) -> bool:
        """Every check is ok."""
        return self.health.ok

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        return {"type": [{"for": name, "line": line} for name, line in self.lines], **self.health.as_dict()}

    def as_text(self) -> str:
        """Lines of plain text."""
        return "\n".join([*(f"{name}:\n  {line}" for name, line in self.lines), self.health.as_text()])


def examine_live(device: str) -> LiveHealth:
    """Look at what live playing on a device needs.

    Raises
    ------
    ChainError, AppError
        When the device is none, or has no room for a cell.
    """
    profile = load_device(device)
    fold = fold_of(profile)
    return LiveHealth(tuple(_lines(profile.name, fold)), Health(tuple(_checks())))


def _lines(device: str, fold: GridFold) -> Iterator[tuple[str, str]]:
    live = f"dotwave live --device {device}"
    yield "Here, first, for Orca", f"{live} --from brlapi --to controller:PORT --show"
    yield "Orca, in its own session (braille is on by default; restart it when it ran before)", "orca --replace"
    dots = "6" if fold.dots == 6 else "8"
    yield (
        "BRLTTY, text consoles, into the same display",
        f"sudo {BRLTTY} -b ba -B ba:host={HOST}:0,ba:auth=none -N -o braille-variant=computer{dots}",
    )
    yield "Here, first, for a BRLTTY of your own", f"{live} --from baum --link /tmp/braille --to controller:PORT --show"
    yield (
        "BRLTTY, consoles and Orca at once",
        f"sudo {BRLTTY} -b bm -d serial:/tmp/braille -A auth=none,host={HOST}:0",
    )
    yield "BRLTTY, several lines (with --from canute)", f"sudo {BRLTTY} -b cn -d serial:/tmp/braille"
    yield (
        "NVDA on Windows (untried)",
        f"{live} --from brlapi there; then NVDA menu, Preferences, Settings, Braille, Change, BRLTTY",
    )


def _checks() -> Iterator[Check]:
    yield _port()
    yield _other_server()
    yield _program("brltty", "apt install brltty, for text consoles")
    yield _program("orca", "apt install orca, for the desktop")
    yield _bindings()
    yield _terminals()
    yield _louis()


def _port() -> Check:
    with socket.socket() as probe:
        taken = probe.connect_ex((HOST, FIRST_PORT)) == 0
    name, where = "BrlAPI's port", f"{HOST}:{FIRST_PORT}"
    if not taken:
        return Check(name, f"{where} is free")
    cure = f"end what has it, or start clients with the BRLAPI_HOST={HOST}:1 that `dotwave live` names"
    return Check(name, f"{where} is taken", cure)


def _other_server() -> Check:
    name = "another BrlAPI server"
    # Clients try its socket before ours.
    sockets = sorted(UNIX_SOCKETS.glob("[0-9]*")) if os.access(UNIX_SOCKETS, os.R_OK | os.X_OK) else []
    alive = [path for path in sockets if _answers(path)]
    if not alive:
        return Check(name, "none")
    return Check(name, f"one listens on {alive[0]}", "clients find it first: stop it (systemctl stop brltty)")


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX) as probe:
        return probe.connect_ex(str(path)) == 0


def _program(name: str, cure: str) -> Check:
    place = shutil.which(name)
    return Check(name, place) if place else Check(name, "not installed", cure)


def _bindings() -> Check:
    # Of the system's own Python, which runs Orca.
    found = any(Path("/usr/lib/python3/dist-packages").glob("brlapi*.so"))
    name = "brlapi for Orca"
    return Check(name, "installed") if found else Check(name, "not found", "apt install python3-brlapi")


def _terminals() -> Check:
    name = "pseudo-terminals"
    if sys.platform == "win32":
        return Check(name, "none on Windows", "use --from brlapi or lines")
    try:
        ends = os.openpty()
    except OSError as error:
        return Check(name, error.strerror or "none", "close terminals, or mount /dev/pts")
    for end in ends:
        os.close(end)
    return Check(name, "ok")


def _louis() -> Check:
    from encoders import EncodeError

    from ..bridges.glyphs import COMPUTER_TABLE, glyphs

    try:
        glyphs()
    except EncodeError as error:
        return Check("liblouis", "cannot be used", str(error))
    return Check("liblouis", COMPUTER_TABLE)
