"""*Trade-off*: what accuracy costs for a text, measured now."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route

from ...errors import AppError, bad_input
from ..devices import device_choices, device_path
from ..fields import NumberField
from ..page import Studio, StudioPage, result_values, show, studio_of
from ..results import Result
from ..uploads import words_of_form

__all__ = ["PAGE"]

TOL = NumberField("tol", "Tolerance", 1e-3, 1e-12, 1.0, 0, 1, 1, "relative to the largest amplitude")
BUDGET = NumberField("budget", "Budget", 0.05, 1e-9, 1e6, 0, 1, 1, "seconds of solving")
MOST_LETTERS = 10_000
WIDE, TALL = 520.0, 230.0


def _form(request: Request, given: Mapping[str, str] | None = None, why: str = "") -> Response:
    studio = studio_of(request)
    usual = {"text": "Hello world", "device": studio.device} | {one.name: f"{one.usual:g}" for one in (TOL, BUDGET)}
    values = {
        "given": {**usual, **(given or {})},
        "why": why,
        "fields": (TOL, BUDGET),
        "devices": device_choices(studio),
    }
    return show(request, "tradeoff.html", values, here="tradeoff", status=400 if why else 200)


async def _begin(request: Request) -> Response:
    async with request.form(max_files=0, max_fields=10) as form:
        given = words_of_form(form)
    try:
        result = await run_in_threadpool(_asked, studio_of(request), given)
    except bad_input() as error:
        return await run_in_threadpool(_form, request, given, str(error))
    studio_of(request).tasks.start("tradeoff", result)
    return RedirectResponse(f"/tradeoff/{result.name}", 303)


def _asked(studio: Studio, given: Mapping[str, str]) -> Result:
    text = given.get("text", "").strip()
    if not 0 < len(text) <= MOST_LETTERS:
        raise AppError(f"Text: expected 1 to {MOST_LETTERS} letters, got {len(text)}")
    asked = {"device": device_path(studio, given.get("device", "")), "text": text, "tol": TOL.of(given)}
    return studio.results.begin("tradeoff", " ".join(text.split())[:60], asked | {"budget_s": BUDGET.of(given)})


def _shown(request: Request) -> Response:
    values = result_values(request)
    values["dots"] = _places(values["answer"]["rows"]) if values["answer"] else []
    return show(request, "traded.html", values, here="tradeoff")


def _places(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Where each row stands on a map of time (to the right) and error (upwards), both logarithmic."""
    known = [row for row in rows if row["error"] is not None and row["seconds"]]
    if not known:
        return []
    times = [math.log10(row["seconds"]) for row in known]
    errors = [math.log10(max(row["error"], 1e-16)) for row in known]

    def share(values: list[float], one: float) -> float:
        return (one - min(values)) / ((max(values) - min(values)) or 1.0)

    return [
        {
            "x": round(WIDE * share(times, time), 1), "y": round(TALL * (1 - share(errors, error)), 1),
            "name": row["rung"], "front": row["front"],
        }
        for row, time, error in zip(known, times, errors, strict=True)
    ]  # fmt: skip


PAGE = StudioPage(
    "tradeoff",
    "Trade-off",
    "What accuracy costs for your text: error against time, measured now, and what the text requires of the model.",
    (
        Route("/tradeoff", _form),
        Route("/tradeoff", _begin, methods=["POST"]),
        Route("/tradeoff/{name}", _shown),
    ),
)
