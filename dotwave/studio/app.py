"""The pages as one web application, behind the guard."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.templating import Jinja2Templates

from ..errors import AppError, bad_input
from ..plain import one_line
from .guard import Guard
from .keys import Keys
from .page import Studio, pages, show, studio_of
from .progress_stream import progress_routes
from .results import Results
from .tasks import Tasks

__all__ = ["studio_app"]

HERE = Path(__file__).parent
LATEST = 20


def studio_app(keys: Keys, folder: Path, device: str, spent: Callable[[], None] = lambda: None) -> Starlette:
    """The web application.

    Parameters
    ----------
    keys : who may come in.
    folder : where results go; nothing is written anywhere else.
    device : name or file of the profile that pages begin with.
    spent : called when a first address was used.
    """
    known = pages()
    routes = [
        Route("/", _start),
        Mount("/static", StaticFiles(directory=HERE / "static")),
        Route("/results/{name}/{file}", _download),
        *progress_routes(),
        *(route for page in known for route in page.routes),
    ]
    app = Starlette(
        routes=routes,
        middleware=[Middleware(Guard, keys=keys, spent=spent)],
        exception_handlers={HTTPException: _refused} | dict.fromkeys(bad_input(), _bad_input),
    )
    app.state.pages = known
    app.state.studio = Studio(keys, Results(folder), Tasks(), device, _templates())
    return app


def _templates() -> Jinja2Templates:
    environment = Environment(
        loader=PackageLoader("dotwave.studio"), autoescape=select_autoescape(), undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["shown"] = one_line
    return Jinja2Templates(env=environment)


def _start(request: Request) -> Response:
    return show(request, "start.html", {"results": studio_of(request).results.latest(LATEST)})


def _download(request: Request) -> Response:
    """A file of a result; its name is looked up among those that are there."""
    result = studio_of(request).results.find(request.path_params["name"])
    path = result.files().get(request.path_params["file"])
    if path is None:
        raise AppError("there is no such file in this result")
    inline = path.suffix == ".png" and "show" in request.query_params
    return FileResponse(
        path, filename=f"{result.name}-{path.name}", content_disposition_type="inline" if inline else "attachment"
    )


def _bad_input(request: Request, error: Exception) -> Response:
    return show(request, "refused.html", {"why": str(error)}, status=400)


def _refused(request: Request, error: Exception) -> Response:
    status = error.status_code if isinstance(error, HTTPException) else 500
    words = error.detail if isinstance(error, HTTPException) else str(error)
    return show(request, "refused.html", {"why": words}, status=status)
