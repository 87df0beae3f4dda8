"""What a page is, and which there are: one module of `dotwave.studio.pages` each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute
from starlette.templating import Jinja2Templates

from .keys import Keys
from .results import Results
from .tasks import Tasks

__all__ = ["PAGES", "Studio", "StudioPage", "pages", "result_values", "show", "studio_of"]

PAGES = ("write", "pictures", "device", "chain", "tradeoff", "play")
"""Modules of `dotwave.studio.pages`, in the order of the navigation."""


@dataclass(frozen=True)
class StudioPage:
    """A page of the navigation.

    Attributes
    ----------
    name : of its module, and the first part of its addresses.
    title : a word or two.
    about : what is done there, in a sentence.
    routes : what it answers.
    """

    name: str
    title: str
    about: str
    routes: tuple[BaseRoute, ...]


@dataclass(frozen=True)
class Studio:
    """What all pages share.

    Attributes
    ----------
    keys : who may come in.
    results : what was made.
    tasks : what is being made.
    device : name or file of the profile that pages begin with.
    templates : of the pages.
    """

    keys: Keys
    results: Results
    tasks: Tasks
    device: str
    templates: Jinja2Templates


def pages() -> list[StudioPage]:
    """All pages, in the order of the navigation."""
    return [import_module(f".pages.{name}", __package__).PAGE for name in PAGES]


def studio_of(request: Request) -> Studio:
    """What all pages share."""
    found: Studio = request.app.state.studio
    return found


def result_values(request: Request) -> dict[str, Any]:
    """The result that an address names, what came of it, and the work that makes it.

    Raises
    ------
    AppError
        When there is no such result.
    """
    studio = studio_of(request)
    result = studio.results.find(request.path_params["name"])
    return {"result": result, "answer": result.answer(), "running": studio.tasks.of(result.name)}


def show(
    request: Request, template: str, values: Mapping[str, Any] | None = None, *, status: int = 200, here: str = ""
) -> Response:
    """A page made of a template; `here` is the page of the navigation it belongs to."""
    studio = studio_of(request)
    playing = studio.tasks.playing()
    for running in playing:
        running.look()
    context = {"pages": request.app.state.pages, "here": here, "playing": bool(playing), **(values or {})}
    return studio.templates.TemplateResponse(request, template, context, status_code=status)
