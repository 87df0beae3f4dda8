"""A desktop without a screen: Xvfb, a session bus, a window manager, Orca, and a dialog whose focus a test moves."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

PROGRAMS = ("Xvfb", "dbus-run-session", "openbox", "orca")
needs_orca = pytest.mark.skipif(
    not all(map(shutil.which, PROGRAMS)) or not Path("/usr/lib/python3/dist-packages/gi").exists(),
    reason="no desktop (apt install orca xvfb dbus-x11 at-spi2-core openbox gir1.2-gtk-3.0 gir1.2-wnck-3.0)",
)

DIALOG = """
import sys
import gi
gi.require_version("Gtk", "3.0")
from gi.repository import GLib, Gtk

window = Gtk.Dialog(title="Trial")
box = window.get_content_area()
fields = {name: Gtk.Button(label=name) for name in sys.argv[1:]}
for one in fields.values():
    box.add(one)
window.show_all()

def asked(source, condition):
    name = sys.stdin.readline().strip()
    if not name:
        Gtk.main_quit()
        return False
    window.present()
    fields[name].grab_focus()
    return True

GLib.io_add_watch(sys.stdin.fileno(), GLib.IO_IN | GLib.IO_HUP, asked)
print("ready", flush=True)
Gtk.main()
"""


@dataclass
class Desktop:
    """A desktop with a dialog that is open."""

    process: subprocess.Popen[str]

    def focus(self, name: str) -> None:
        """Move the focus to a button."""
        assert self.process.stdin is not None
        self.process.stdin.write(name + "\n")
        self.process.stdin.flush()


@contextmanager
def desktop(folder: Path, number: int, *buttons: str) -> Iterator[Desktop]:
    """Start everything, with Orca as a client of BrlAPI server `number`; all of it ends with the body."""
    (folder / "dialog.py").write_text(DIALOG)
    with session_of(folder, number, f"exec /usr/bin/python3 -u dialog.py {' '.join(buttons)}") as (session, _):
        yield Desktop(session)


@contextmanager
def session_of(folder: Path, number: int, program: str) -> Iterator[tuple[subprocess.Popen[str], dict[str, str]]]:
    """A session with Orca in which a line of shell runs, which has to say ``ready``; and its environment."""
    read, write = os.pipe()
    screen = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "800x600x24", "-nolisten", "tcp"],
        pass_fds=[write], stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(write)
    with os.fdopen(read) as told:
        display = ":" + told.readline().strip()
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith(("XDG_", "DBUS_"))},
        "DISPLAY": display, "HOME": str(folder), "XDG_RUNTIME_DIR": str(folder), "BRLAPI_HOST": f"127.0.0.1:{number}",
        "GTK_MODULES": "gail:atk-bridge", "NO_AT_BRIDGE": "0", "PYTHONPATH": "",
    }  # fmt: skip
    line = (
        "gsettings set org.gnome.desktop.interface toolkit-accessibility true 2>/dev/null; openbox >openbox.log 2>&1 & "
        "orca --replace --enable=braille --disable=speech >orca.log 2>&1 & "
        f"{program}"
    )
    with (folder / "session.log").open("w") as log:
        session = subprocess.Popen(
            ["dbus-run-session", "--", "sh", "-c", line], cwd=folder, env=environment, text=True,
            start_new_session=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log,
        )  # fmt: skip
    try:
        assert session.stdout is not None
        # The registry of the accessibility bus says a word there too.
        assert "ready\n" in iter(session.stdout.readline, ""), (folder / "session.log").read_text()
        yield session, environment
    finally:
        os.killpg(session.pid, signal.SIGKILL)
        session.communicate()
        screen.kill()
        screen.wait()
