"""What stands before every page: who asks, from where, how much is sent, and what a browser may do with the answer.

Any page of the web may make a browser send requests to this machine, and any user of the machine may connect to the
port. So a request needs the cookie, a `Host` of ours, and an `Origin` of ours where it changes anything.
"""

from __future__ import annotations

from collections.abc import Callable
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .keys import Keys

__all__ = ["MAX_BODY_BYTES", "Guard"]

MAX_BODY_BYTES = 32_000_000
"""Of one request; more is refused before it is read."""

SAFE_METHODS = ("GET", "HEAD")
HEADERS = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "form-action 'self'; frame-ancestors 'none'; base-uri 'none'"
    ),
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    # Not "no-referrer": browsers would then send `Origin: null` with our own forms.
    "referrer-policy": "same-origin",
    "x-content-type-options": "nosniff",
    "cache-control": "no-store",
}
STRANGER = "Not let in. Open the address that dotwave studio printed last; each is good for one browser.\n"


class Guard:
    """ASGI middleware that lets only our own browser through.

    Parameters
    ----------
    app : what it stands before.
    keys : of this run.
    spent : called when a first address was used, so that the next can be told.
    """

    def __init__(self, app: ASGIApp, keys: Keys, spent: Callable[[], None]) -> None:
        self._app, self._keys, self._spent = app, keys, spent

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request through, or answer it."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return
        answer = self._refusal(scope) or self._let_in(scope)
        if answer is not None:
            await answer(scope, receive, _with_headers(send))
            return
        await self._app(scope, _bounded(receive), _with_headers(send))

    def _refusal(self, scope: Scope) -> Response | None:
        headers, keys = Headers(scope=scope), self._keys
        host = headers.get("host", "")
        if host not in (f"127.0.0.1:{keys.port}", f"localhost:{keys.port}"):
            return PlainTextResponse("Not let in: another name of this machine.\n", 421)
        # A page of another port is of the same site, and would get the cookie sent along.
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            return PlainTextResponse("Not let in: asked for by another page.\n", 403)
        if scope["method"] not in SAFE_METHODS and headers.get("origin") != f"http://{host}":
            return PlainTextResponse("Not let in: sent by another page.\n", 403)
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length) > MAX_BODY_BYTES:
            return PlainTextResponse(f"Too large: at most {MAX_BODY_BYTES // 1_000_000} MB at a time.\n", 413)
        return None

    def _let_in(self, scope: Scope) -> Response | None:
        """The way in with a token; None for who is in already."""
        if self._keys.knows(_cookie(Headers(scope=scope), self._keys.cookie_name)):
            return None
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        cookie = self._keys.spend(given) if scope["method"] == "GET" and scope["path"] == "/" else None
        if cookie is None:
            return PlainTextResponse(STRANGER, 403)
        self._spent()
        answer = RedirectResponse("/", 303)
        answer.set_cookie(self._keys.cookie_name, cookie, path="/", httponly=True, samesite="strict")
        return answer


def _cookie(headers: Headers, name: str) -> str | None:
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return None
    return None if found is None else found.value


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return sending


def _bounded(receive: Receive) -> Receive:
    """Counts what comes: a request need not say how long it is."""
    count = 0

    async def receiving() -> Message:
        nonlocal count
        message = await receive()
        count += len(message.get("body", b""))
        if count > MAX_BODY_BYTES:
            raise HTTPException(413, f"Too large: at most {MAX_BODY_BYTES // 1_000_000} MB at a time.")
        return message

    return receiving
