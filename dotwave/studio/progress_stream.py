"""How far work is, as server-sent events; the buttons that end it; and whether anybody looks while it plays."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator

from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response, StreamingResponse
from starlette.routing import BaseRoute, Route

from .page import studio_of
from .tasks import Running

__all__ = ["progress_routes", "progress_values"]

LOOK_EVERY_S = 0.1


def progress_routes() -> tuple[BaseRoute, ...]:
    """The addresses of progress and cancel."""
    return (
        Route("/progress/{name}", _progress),
        Route("/cancel/{name}", _cancel, methods=["POST"]),
        Route("/stop", _stop, methods=["POST"]),
        Route("/watch", _watch),
        Route("/left", _left, methods=["POST"]),
    )


def progress_values(running: Running) -> dict[str, object]:
    """What is told of work that is going on."""
    share = running.share
    percent = None if share is None else round(100 * share)
    words = running.label if percent is None else f"{running.label}: {percent} %"
    return {"words": words, "percent": percent, "over": running.over, "error": running.error, "shown": running.shown}


async def _progress(request: Request) -> Response:
    running = studio_of(request).tasks.of(request.path_params["name"])
    if running is None:
        return Response(status_code=204)
    return StreamingResponse(_events(request, running), media_type="text/event-stream")


async def _events(request: Request, running: Running) -> AsyncIterator[str]:
    seen = -1
    while not await request.is_disconnected():
        if running.changes != seen:
            seen = running.changes
            yield f"data: {json.dumps(progress_values(running))}\n\n"
            if running.over:
                return
        await asyncio.sleep(LOOK_EVERY_S)


def _cancel(request: Request) -> Response:
    name = request.path_params["name"]
    result = studio_of(request).results.find(name)
    running = studio_of(request).tasks.of(name)
    if running is not None:
        running.stop()
    return RedirectResponse(f"/{result.page}/{result.name}", 303)


def _stop(request: Request) -> Response:
    """End all that plays; harmless when nothing does."""
    for running in studio_of(request).tasks.playing():
        running.stop()
    return RedirectResponse("/play?stopped", 303)


def _watch(request: Request) -> Response:
    """A page says that it is there; what plays goes on."""
    playing = studio_of(request).tasks.playing()
    for running in playing:
        running.look()
    return JSONResponse({"playing": bool(playing)})


def _left(request: Request) -> Response:
    """A page was closed."""
    for running in studio_of(request).tasks.playing():
        running.leave()
    return Response(status_code=204)
