"""*Write*: a text or a document as cells and frames, and what is felt of it."""

from __future__ import annotations

from pathlib import PurePath
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import FormData
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route

from encoders import PageNumbering, Presentation, TableInfo, Undefined, list_tables, text_suffixes

from ...errors import AppError, bad_input
from ..devices import device_choices, device_path
from ..page import StudioPage, result_values, show, studio_of
from ..results import Result
from ..uploads import ending_of, file_of, keep, words_of_form

__all__ = ["PAGE"]

USUAL_TABLE = "en-ueb-g2.ctb"
MOST_TABLES = 12
MOST_LETTERS = 1_000_000
FRAMES_AT_A_TIME = 48
EMPTY = {
    "text": "", "table": USUAL_TABLE, "undefined": Undefined.NAME, "presentation": Presentation.TOGETHER,
    "page_numbers": PageNumbering.NONE, "pages": "",
}  # fmt: skip
CHOICES = {"undefined": Undefined, "presentation": Presentation, "page_numbers": PageNumbering}


def _form(request: Request, given: dict[str, Any] | None = None, why: str = "") -> Response:
    asked = request.query_params
    given = {**EMPTY, "device": studio_of(request).device, **(given or {"table": asked.get("table", USUAL_TABLE)})}
    find = asked.get("find", "")
    found = _tables(find)
    tables = [one for one in found[:MOST_TABLES] if one.file != given["table"]]
    values = {
        "given": given, "why": why, "find": find, "tables": tables, "more": max(0, len(found) - MOST_TABLES),
        "devices": device_choices(studio_of(request)), "suffixes": text_suffixes(),
        "choices": {name: [(one.value, one.value) for one in kind] for name, kind in CHOICES.items()},
    }  # fmt: skip
    return show(request, "write.html", values, here="write", status=400 if why else 200)


def _tables(find: str) -> list[TableInfo]:
    words = find.casefold().split()
    if not words:
        return []
    said = {one: f"{one.file} {one.language} {one.name} {one.contraction}".casefold() for one in list_tables()}
    return [one for one, line in said.items() if all(word in line for word in words)]


async def _begin(request: Request) -> Response:
    async with request.form(max_files=1, max_fields=40, max_part_size=4 * MOST_LETTERS) as form:
        given = words_of_form(form)
        try:
            result = await _asked(request, form, given)
        except bad_input() as error:
            return await run_in_threadpool(_form, request, given, str(error))
    studio_of(request).tasks.start("write", result)
    return RedirectResponse(f"/write/{result.name}", 303)


async def _asked(request: Request, form: FormData, given: dict[str, str]) -> Result:
    """The result that is to be made, with the document in its folder."""
    file = file_of(form, "document")
    text = given.get("text", "")
    if not (file or text.strip()):
        raise AppError("Text: is empty; type something, or choose a document")
    if len(text) > MOST_LETTERS:
        raise AppError(f"Text: more than {MOST_LETTERS} letters; give it as a document")
    options = {name: given[name] for name in (*CHOICES, "pages") if given.get(name)}
    asked: dict[str, Any] = {
        "device": device_path(studio_of(request), given.get("device", "")), "text": "" if file else text,
        "source": "", "name": "", "options": options | {"table": given.get("table", USUAL_TABLE)},
    }  # fmt: skip
    if file is None:
        return studio_of(request).results.begin("write", " ".join(text.split())[:60], asked)
    ending = ending_of(file, text_suffixes(), "Document")
    name = PurePath(file.filename or "").name
    asked |= {"source": f"document{ending}", "name": name[:100]}
    result = studio_of(request).results.begin("write", name[:60], asked)
    await keep(file, result.folder / asked["source"])
    return result


def _shown(request: Request) -> Response:
    values = result_values(request)
    first = request.query_params.get("from", "1")
    start = max(1, int(first)) if first.isdecimal() and len(first) < 9 else 1
    frames = values["answer"]["frames"] if values["answer"] else []
    shown = frames[start - 1 : start - 1 + FRAMES_AT_A_TIME]
    values |= {"first": start, "frames": shown, "step": FRAMES_AT_A_TIME}
    return show(request, "written.html", values, here="write")


PAGE = StudioPage(
    "write",
    "Write",
    "Text or a document as Braille: its cells, what is felt of them frame by frame, and the files that play it.",
    (
        Route("/write", _form),
        Route("/write", _begin, methods=["POST"]),
        Route("/write/{name}", _shown),
    ),
)
