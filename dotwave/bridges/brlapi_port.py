"""The BrlAPI server on loopback, and on Windows on the named pipe that NVDA looks for (untried there)."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

from ..errors import AppError
from .brlapi import BrlapiServer
from .brlapi_client import BrlapiClient
from .port import WindowPort
from .window import BrailleWindow, Key

__all__ = ["FIRST_PORT", "HOST", "PIPE", "BrlapiLine", "BrlapiPort", "serve_pipe"]

HOST = "127.0.0.1"
FIRST_PORT = 4101
PIPE = r"\\.\pipe\BrlAPI0"
_PORTS = 10
_MOST_CLIENTS = 32
_GREETING_S = 10.0
_MOST_UNREAD = 1 << 16


class _Closing(Protocol):
    """What listens: servers of asyncio and of named pipes have this in common."""

    def close(self) -> None:
        """Listen no more."""


class BrlapiPort(WindowPort):
    """Listens on 127.0.0.1, port 4101 or the next that is free; on nothing that another machine reaches.

    Parameters
    ----------
    server : answers.
    pipe : also listen on a named pipe; by default where there are such.
    """

    kind = "brlapi"

    def __init__(self, server: BrlapiServer, pipe: bool = sys.platform == "win32") -> None:
        super().__init__()
        self.server = server
        self.number = 0
        self._pipe = pipe
        self._lines: dict[BrlapiClient, BrlapiLine] = {}
        self._listening: list[_Closing] = []

    @property
    def window(self) -> BrailleWindow | None:
        """Of the client that has the display."""
        return self.server.window

    async def open(self) -> None:
        """Begin to listen.

        Raises
        ------
        AppError
            When no port is free.
        """
        loop = asyncio.get_running_loop()
        for number in range(_PORTS):
            with suppress(OSError):
                self._listening.append(await loop.create_server(self.line, HOST, FIRST_PORT + number))
                self.number = number
                break
        else:
            ports = f"{FIRST_PORT} to {FIRST_PORT + _PORTS - 1}"
            raise AppError(
                f"--from brlapi: no port of {ports} on {HOST} is free; end a BRLTTY or dotwave that has them"
            )
        if self._pipe:
            self._listening += await serve_pipe(loop, self.line)
        where = f"BrlAPI on {HOST}:{FIRST_PORT + self.number}"
        if self.number:
            self.how = (where, f"BRLTTY or another has the usual port; clients need BRLAPI_HOST={HOST}:{self.number}")
        else:
            self.how = (where, "Orca and other clients find it by themselves; more: dotwave live --doctor")

    def line(self) -> BrlapiLine:
        """Of a connection that comes."""
        return BrlapiLine(self)

    def joined(self, line: BrlapiLine) -> BrlapiClient | None:
        """A client for a connection, in the place of an idle one where there are too many; None for no room."""
        idle = [client for client in self.server.clients if client.written is None]
        if len(self.server.clients) >= _MOST_CLIENTS:
            if not idle:
                return None
            self._lines[idle[0]].end()
        client = self.server.join()
        self._lines[client] = line
        return client

    def left(self, client: BrlapiClient) -> None:
        """Its connection is gone."""
        self.server.leave(client)
        self._lines.pop(client, None)
        self.changed()

    def press(self, key: Key) -> None:
        """To the client that has the display, if it wants that key."""
        told = self.server.press(key)
        if told is not None:
            client, data = told
            self._lines[client].send(data)

    async def close(self) -> None:
        """Listen no more, and hang up."""
        for listening in self._listening:
            listening.close()
        for line in list(self._lines.values()):
            line.end()
        await asyncio.sleep(0)


class BrlapiLine(asyncio.BufferedProtocol):
    """One connection, of a socket or a pipe; reads little at a time, so that no client keeps the others waiting."""

    def __init__(self, port: BrlapiPort) -> None:
        self._port = port
        self._client: BrlapiClient | None = None
        self._transport: asyncio.Transport | None = None
        self._buffer = bytearray(4096)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Greet, or hang up where there is no room."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self._client = self._port.joined(self)
        if self._client is None:
            transport.abort()
            return
        self.send(self._client.greeting)
        asyncio.get_running_loop().call_later(_GREETING_S, self._expect_greeting)

    def get_buffer(self, sizehint: int) -> bytearray:
        """Where what comes is put."""
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Bytes came."""
        if self._client is not None:
            self.send(self._client.receive(bytes(self._buffer[:nbytes])))
            self._port.changed()
            if self._client.finished and self._transport is not None:
                self._transport.close()

    def eof_received(self) -> None:
        """The other end has gone."""

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._transport = None
        if self._client is not None:
            client, self._client = self._client, None
            self._port.left(client)

    def send(self, data: bytes) -> None:
        """Send, or hang up on somebody who asks and asks and never reads."""
        if data and self._transport is not None and not self._transport.is_closing():
            self._transport.write(data)
            if self._transport.get_write_buffer_size() > _MOST_UNREAD:
                self.end()

    def end(self) -> None:
        """Hang up."""
        if self._transport is not None:
            self._transport.abort()
        self.connection_lost(None)

    def _expect_greeting(self) -> None:
        if self._client is not None and not self._client.trusted:
            self.end()


async def serve_pipe(
    loop: asyncio.AbstractEventLoop, line: Callable[[], BrlapiLine], path: str = PIPE
) -> list[_Closing]:
    """Listen on a named pipe, as NVDA's driver for BRLTTY looks for it. Untried: no Windows was at hand.

    Parameters
    ----------
    loop : one that knows named pipes, which is asyncio's own on Windows.
    line : makes what talks to a client.
    path : of the pipe.

    Raises
    ------
    AppError
        When the loop knows none.
    """
    start = getattr(loop, "start_serving_pipe", None)
    if start is None:
        raise AppError("this system has no named pipes; clients connect to 127.0.0.1")
    listening: list[_Closing] = await start(line, path)
    return listening
