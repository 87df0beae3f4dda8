"""`dotwave studio`: serves the pages on this machine alone, and opens them."""

from __future__ import annotations

import socket
import sys
import webbrowser
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from chainsim import load_device

from ..errors import AppError

__all__ = ["StudioReport", "serve"]

LOOPBACK = "127.0.0.1"
NEEDED = ("starlette", "uvicorn", "jinja2", "python_multipart")
PATIENCE_S = 5.0
"""Seconds that work which goes on is given to end, outputs at zero."""


@dataclass(frozen=True)
class StudioReport:
    """What to say when the studio was closed."""

    address: str
    folder: str

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        return {"address": self.address, "folder": self.folder}

    def as_text(self) -> str:
        """Lines of plain text."""
        return f"The studio is closed; what was made is in {self.folder}."


def serve(folder: Path, *, device: str, port: int, browser: bool) -> StudioReport:
    """Serve until Ctrl-C.

    Parameters
    ----------
    folder : where results go.
    device : that pages begin with.
    port : 0 for any that is free.
    browser : open one.

    Raises
    ------
    AppError
        When the extra is not installed, or the port is taken.
    chainsim.ChainError
        When there is no such device.
    """
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise AppError(f"studio: needs {', '.join(missing)}; install them with pip install 'dotwave[studio]'")
    load_device(device)
    if folder.exists() and not folder.is_dir():
        raise AppError(f"{folder}: is not a folder; name one for the results")
    listening = _listening(port)

    # Imported here: only now is it known that they are there.
    import uvicorn

    from .app import studio_app
    from .keys import Keys

    keys = Keys(listening.getsockname()[1])
    told = _Teller(keys)
    app = studio_app(keys, folder, device, told.tell)
    told.tell()
    if browser:
        webbrowser.open(keys.first_address)
    server = uvicorn.Server(uvicorn.Config(app, log_level="error", server_header=False, timeout_graceful_shutdown=1))
    try:
        server.run(sockets=[listening])
    except KeyboardInterrupt:
        pass
    finally:
        app.state.studio.tasks.close(PATIENCE_S)
    return StudioReport(keys.origin, str(folder))


@dataclass
class _Teller:
    """Says the address that lets the next browser in."""

    keys: Any
    times: int = 0

    def tell(self) -> None:
        words = "Open in another browser" if self.times else "Open in a browser (Ctrl-C ends)"
        self.times += 1
        print(f"{words}: {self.keys.first_address}", file=sys.stderr, flush=True)


def _listening(port: int) -> socket.socket:
    """A socket on loopback and nowhere else."""
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((LOOPBACK, port))
        # A browser that is quicker than the server waits for it.
        listening.listen()
    except OSError as error:
        listening.close()
        raise AppError(f"--port {port}: {error.strerror}; leave it out for one that is free") from None
    return listening
