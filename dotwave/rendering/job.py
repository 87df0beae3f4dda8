"""A job file carried out."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

from drivers import FileError

from ..errors import AppError
from ..jobs.scene import read_job_scene
from ..reports.report import Report
from ..request import Request
from .render import render

__all__ = ["render_job"]


def render_job(
    path: Path, out: Path | None = None, request: Request | None = None, *, root: Path | None = None
) -> Report:
    """Carry out the job file `path`; `out` is written in place of the job's own output.

    Parameters
    ----------
    request : what is asked, before what the job asks for.
    root : the job, and what it names, lie below this folder, or are refused; None for anywhere.

    Raises
    ------
    Declined
        When a person was asked, and said no.
    AppError, ChainError, DriverError, EncodeError, PlanError
        When the job, or what it names, cannot be used.
    """
    began = time.perf_counter()
    job = read_job_scene(path, root=root)
    try:
        report = render(job, job.device, out or job.out, job.request(request or Request()))
    except FileError as error:
        if out is not None:
            raise
        raise AppError(f"{job.located.at('output')}: {error}") from None
    return replace(report, seconds=time.perf_counter() - began)
