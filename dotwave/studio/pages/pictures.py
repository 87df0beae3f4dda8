"""*Pictures and icons*: a picture step by step; a set of icons that are told apart, and a blind test of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import FormData
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route

from chainsim import load_device

from ...errors import AppError, bad_input
from ..blind_test import BlindTest
from ..devices import device_choices, device_path
from ..page import StudioPage, show, studio_of
from ..picture_steps import OFFERED, choices_of, options_of, steps_of
from ..results import Result
from ..uploads import ending_of, file_of, keep, words_of_form

__all__ = ["PAGE"]

PICTURES = (".bmp", ".gif", ".jpeg", ".jpg", ".png", ".svg", ".svgz", ".tif", ".tiff", ".webp")
ARCHIVES = (".zip", ".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tar.xz")
ICONS_AT_A_TIME = 60
TEST = ".blind-test.json"


def _form(request: Request, given: Mapping[str, str] | None = None, why: str = "") -> Response:
    studio = studio_of(request)
    values = {
        "given": {"device": studio.device, "distinct": "yes", **(given or {})}, "why": why, "pictures": PICTURES,
        "archives": ARCHIVES, "devices": device_choices(studio),
    }  # fmt: skip
    return show(request, "pictures.html", values, here="pictures", status=400 if why else 200)


async def _begin(request: Request) -> Response:
    async with request.form(max_files=1, max_fields=10) as form:
        given = words_of_form(form)
        try:
            result = await _asked(request, form, given)
        except bad_input() as error:
            return await run_in_threadpool(_form, request, given, str(error))
    if result.asked["set"]:
        studio_of(request).tasks.start("icons", result)
    return RedirectResponse(f"/pictures/{result.name}", 303)


async def _asked(request: Request, form: FormData, given: Mapping[str, str]) -> Result:
    file = file_of(form, "file")
    if file is None:
        raise AppError("File: none was chosen; choose a picture, or an archive of icons")
    ending = ending_of(file, PICTURES + ARCHIVES, "File")
    studio = studio_of(request)
    asked = {
        "device": device_path(studio, given.get("device", "")), "source": f"picture{ending}",
        "set": ending in ARCHIVES, "distinct": "distinct" in given,
    }  # fmt: skip
    result = studio.results.begin("pictures", PurePath(file.filename or "").name[:60], asked)
    await keep(file, result.folder / str(asked["source"]))
    return result


def _shown(request: Request) -> Response:
    result = studio_of(request).results.find(request.path_params["name"])
    return _set(request, result) if result.asked["set"] else _picture(request, result)


def _picture(request: Request, result: Result) -> Response:
    given = {name: request.query_params.get(name, "") for name in OFFERED}
    values: dict[str, Any] = {"result": result, "found": None, "why": "", "given": given, "choices": choices_of()}
    try:
        device = load_device(result.asked["device"])
        values["found"] = steps_of(result.folder / result.asked["source"], device, options_of(given))
    except bad_input() as error:
        values["why"] = str(error)
    return show(request, "picture.html", values, here="pictures", status=400 if values["why"] else 200)


def _set(request: Request, result: Result) -> Response:
    studio = studio_of(request)
    answer = result.answer()
    find = request.query_params.get("find", "").casefold().strip()
    icons = [one for one in (answer or {"icons": []})["icons"] if find in f"{one['name']} {one['label']}".casefold()]
    values = {
        "result": result, "answer": answer, "running": studio.tasks.of(result.name), "find": find,
        "icons": [_drawable(one) for one in icons[:ICONS_AT_A_TIME]], "of": len(icons),
    }  # fmt: skip
    return show(request, "icons.html", values, here="pictures")


def _drawable(icon: Mapping[str, Any]) -> dict[str, Any]:
    strengths = {".": 0.0, "-": 0.5, "o": 1.0}
    levels = [[strengths[mark] for mark in line] for line in icon["pattern"]]
    return {**icon, "levels": levels, "raised": [[level > 0 for level in line] for line in levels]}


def _blind_test(request: Request) -> Response:
    """The pattern that is shown now; the page does not say whose it is."""
    result = studio_of(request).results.find(request.path_params["name"])
    icons = (result.answer() or {"icons": []})["icons"]
    test = BlindTest.of(result.folder / TEST, icons)
    shown = _drawable(next(icon for icon in icons if icon["name"] == test.pending))
    columns, rows = test.confusion()
    last = test.answers[-1] if test.answers else None
    values = {"result": result, "test": test, "shown": shown, "columns": columns, "rows": rows, "last": last}
    return show(request, "blind_test.html", values, here="pictures")


async def _named(request: Request) -> Response:
    async with request.form(max_files=0, max_fields=5) as form:
        named = words_of_form(form).get("icon", "")

    def taken() -> str:
        result = studio_of(request).results.find(request.path_params["name"])
        icons = (result.answer() or {"icons": []})["icons"]
        BlindTest.of(result.folder / TEST, icons).answer(named, icons)
        return result.name

    return RedirectResponse(f"/pictures/{await run_in_threadpool(taken)}/test", 303)


PAGE = StudioPage(
    "pictures",
    "Pictures and icons",
    "A picture on its way to a pattern, step by step; a set of icons that are told apart, and a blind test of it.",
    (
        Route("/pictures", _form),
        Route("/pictures", _begin, methods=["POST"]),
        Route("/pictures/{name}", _shown),
        Route("/pictures/{name}/test", _blind_test),
        Route("/pictures/{name}/test", _named, methods=["POST"]),
    ),
)
