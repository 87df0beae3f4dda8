"""*Play and live*: a dry run through the gate, playing, a stand-in for hardware, and what a screen reader writes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route

from drivers import serial_ports

from ...api.sinks import open as open_sink
from ...errors import AppError, bad_input
from ..devices import device_choices, device_path
from ..page import Studio, StudioPage, result_values, show, studio_of
from ..results import Result
from ..uploads import words_of_form

__all__ = ["PAGE"]

WAVEFORM = "text.wav"
SOURCES = {
    "brlapi": "BrlAPI: Orca, BRLTTY, NVDA",
    "baum": "an emulated Baum display, for BRLTTY",
    "canute": "an emulated Canute, for BRLTTY",
}


def _form(request: Request, given: Mapping[str, str] | None = None, why: str = "") -> Response:
    studio = studio_of(request)
    waveforms = [(one.name, one.title) for one in studio.results.latest(200) if WAVEFORM in one.files()]
    values = {
        "given": {"result": "", "sink": "", "device": studio.device, "source": "brlapi", **(given or {})},
        "why": why, "waveforms": waveforms, "devices": device_choices(studio), "sources": list(SOURCES.items()),
        "ports": _ports(studio), "stopped": "stopped" in request.query_params,
        "going": [studio.results.find(name) for name, one in studio.tasks.going_on().items() if one.work in WORKS],
    }  # fmt: skip
    return show(request, "play.html", values, here="play", status=400 if why else 200)


def _ports(studio: Studio) -> list[tuple[str, str]]:
    """Addresses of what could play, and the words for them: stand-ins first."""
    emulated = [one.shown["port"] for one in studio.tasks.going_on().values() if "port" in one.shown]
    there = [(f"controller:{port}", "the stand-in") for port in emulated]
    try:
        there += [(f"controller:{port.name}", port.description) for port in serial_ports()]
    except bad_input():
        # Without pyserial there are no ports to list, and all else works.
        return there
    return there


async def _begin(request: Request) -> Response:
    async with request.form(max_files=0, max_fields=20) as form:
        given = words_of_form(form)
    try:
        work = given.get("work", "")
        if work not in WORKS:
            raise AppError("choose what to do with one of the buttons")
        result = await run_in_threadpool(_started, studio_of(request), work, given)
    except bad_input() as error:
        return await run_in_threadpool(_form, request, given, str(error))
    return RedirectResponse(f"/play/{result.name}", 303)


def _started(studio: Studio, work: str, given: Mapping[str, str]) -> Result:
    title, asked = WORKS[work](studio, given)
    result = studio.results.begin("play", title, {**asked, "work": work})
    try:
        studio.tasks.start(work, result, plays=bool(asked.get("live")))
    except AppError:
        studio.results.remove(result)
        raise
    return result


def _playing(studio: Studio, given: Mapping[str, str]) -> tuple[str, dict[str, Any]]:
    result = studio.results.find(given.get("result", ""))
    path = result.files().get(WAVEFORM)
    if path is None:
        raise AppError("Waveform: this result has none; write a text first")
    live, sink = "live" in given, _sink(given)
    if live and not sink:
        raise AppError("Where: is empty; name a port to really play, or leave the switch off for a dry run")
    title = f"{'Playing' if live else 'Dry run of'} {result.title}"
    return title, {"waveform": str(path.absolute()), "sink": sink, "live": live}


def _standing_in(studio: Studio, given: Mapping[str, str]) -> tuple[str, dict[str, Any]]:
    device = given.get("device", "")
    return f"Stand-in for {device}", {"device": device_path(studio, device)}


def _reading(studio: Studio, given: Mapping[str, str]) -> tuple[str, dict[str, Any]]:
    source, device = given.get("source", ""), given.get("device", "")
    if source not in SOURCES:
        raise AppError(f"From: expected one of {', '.join(SOURCES)}")
    live, sink = "live" in given, _sink(given)
    if live and not sink:
        raise AppError("Where: is empty; name a port to really play, or leave the switch off")
    asked = {"device": device_path(studio, device), "source": source, "sink": sink if live else "", "live": live}
    return f"Live from {source} on {device}", asked


def _sink(given: Mapping[str, str]) -> str:
    words = given.get("sink", "").strip()
    return open_sink(words).address if words else ""


WORKS = {"play": _playing, "emulator": _standing_in, "live": _reading}
"""What the page begins, and how it is asked for."""


def _shown(request: Request) -> Response:
    return show(request, "playing.html", result_values(request), here="play")


PAGE = StudioPage(
    "play",
    "Play and live",
    "A dry run through the safety gate, playing to a controller or a stand-in, and what a screen reader writes.",
    (
        Route("/play", _form),
        Route("/play", _begin, methods=["POST"]),
        Route("/play/{name}", _shown),
    ),
)
