"""*Device*: a profile as a form, its curves, and what it can make."""

from __future__ import annotations

from typing import Any

import yaml
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route

from chainsim import load_device
from drivers import atomic_file

from ...errors import AppError, bad_input
from ..devices import PROFILE, device_choices, device_path
from ..page import Studio, StudioPage, result_values, show, studio_of
from ..profile_form import profile_fields, profile_of
from ..results import Result
from ..uploads import words_of_form

__all__ = ["PAGE"]


def _form(request: Request, typed: dict[str, str] | None = None, why: str = "") -> Response:
    studio = studio_of(request)
    chosen = request.query_params.get("base", studio.device)
    fields = profile_fields(load_device(device_path(studio, chosen)).as_dict())
    values: dict[str, Any] = {"fields": fields, "devices": device_choices(studio), "chosen": chosen, "why": why}
    values["typed"] = {field.key: field.value for field in fields} | (typed or {})
    return show(request, "device.html", values, here="device", status=400 if why else 200)


async def _save(request: Request) -> Response:
    async with request.form(max_files=0, max_fields=100) as form:
        typed = words_of_form(form)
    try:
        result = await run_in_threadpool(_saved, studio_of(request), typed)
    except bad_input() as error:
        return await run_in_threadpool(_form, request, typed, str(error))
    studio_of(request).tasks.start("device", result)
    return RedirectResponse(f"/device/{result.name}", 303)


def _saved(studio: Studio, typed: dict[str, str]) -> Result:
    """The profile as a file, when it reads back."""
    profile = profile_of(typed)
    result = studio.results.begin("device", str(profile.get("name", ""))[:60] or "no name", {"profile": PROFILE})
    path = result.folder / PROFILE
    with atomic_file(path) as file:
        file.write(yaml.safe_dump(profile, sort_keys=False, allow_unicode=True, width=110).encode())
    try:
        load_device(str(path))
    except bad_input() as error:
        studio.results.remove(result)
        # Which file and line it would be is nothing to a person who typed into a form.
        raise AppError(str(error).replace(str(path), "profile")) from None
    return result


def _shown(request: Request) -> Response:
    return show(request, "device_saved.html", result_values(request), here="device")


PAGE = StudioPage(
    "device",
    "Device",
    "A device profile as a form, checked like the file: its curves, what it can make, and the YAML to keep.",
    (
        Route("/device", _form),
        Route("/device", _save, methods=["POST"]),
        Route("/device/{name}", _shown),
    ),
)
