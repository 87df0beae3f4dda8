"""The studio for tests: a client that is let in, and a server in a thread for browsers."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import uvicorn
from starlette.testclient import TestClient

from dotwave.studio.app import studio_app
from dotwave.studio.keys import Keys
from dotwave.studio.serve import _listening

__all__ = ["PORT", "Served", "inside", "served", "stranger"]

PORT = 8765


def stranger(folder: Path, keys: Keys | None = None) -> TestClient:
    """A client that has no cookie yet."""
    keys = keys or Keys(PORT)
    client = TestClient(studio_app(keys, folder, "linked-6x6"), base_url=keys.origin, follow_redirects=False)
    client.headers["origin"] = keys.origin
    return client


def inside(folder: Path) -> TestClient:
    """A client that came in by the first address."""
    keys = Keys(PORT)
    client = stranger(folder, keys)
    assert client.get("/", params={"token": keys.token}).status_code == 303
    return client


@dataclass(frozen=True)
class Served:
    """A studio that browsers can open."""

    keys: Keys
    app: Any
    folder: Path


@contextmanager
def served(folder: Path) -> Iterator[Served]:
    """Serve on a free port until the body ends."""
    listening = _listening(0)
    keys = Keys(listening.getsockname()[1])
    app = studio_app(keys, folder, "linked-6x6")
    server = uvicorn.Server(uvicorn.Config(app, log_level="error", timeout_graceful_shutdown=1))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
    thread.start()
    try:
        yield Served(keys, app, folder)
    finally:
        server.should_exit = True
        thread.join(20)
        app.state.studio.tasks.close(5)
