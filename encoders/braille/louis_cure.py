"""How the Braille library is installed on this machine; `run` says the same before there is any Python of ours."""

from __future__ import annotations

import shutil
import sys

__all__ = ["install_words"]

# Package manager -> the command that installs liblouis with its Python binding, in the order in which they are tried.
INSTALLERS = {
    "apt-get": "sudo apt-get install python3-louis",
    "dnf": "sudo dnf install python3-louis",
    "zypper": "sudo zypper install python3-louis",
    "pacman": "sudo pacman -S liblouis",
    "apk": "sudo apk add liblouis, and its Python binding (apk search louis)",
    "brew": "brew install liblouis",
}
ELSEWHERE = {
    "darwin": "get Homebrew (brew.sh), then: brew install liblouis",
    "win32": "use the Windows Subsystem for Linux (wsl --install), and in it: sudo apt-get install python3-louis",
}
UNKNOWN = "ask your package manager for liblouis 3.x and its Python binding (liblouis.io)"


def install_words() -> str:
    """What to do on this machine, as a clause that follows a semicolon."""
    found = next((command for tool, command in INSTALLERS.items() if shutil.which(tool)), None)
    return f"install it with: {found}" if found else ELSEWHERE.get(sys.platform, UNKNOWN)
