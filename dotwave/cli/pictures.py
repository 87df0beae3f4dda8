"""The commands for pictures, sets of icons and job files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from encoders import picture_rules

from .command import Actuator, Budget, Contrast, Device, Explain, Json, Modulated, Pareto, Tol, Yes, Yield, finish, say
from .completion import completed_files
from .help import RENDER
from .options import SampleFormat

__all__ = ["commands"]

commands = typer.Typer(rich_markup_mode=None)


def _words(option: str) -> str:
    """The choices of an option of `encoders.PictureOptions`."""
    return ", ".join(picture_rules()[option].choices)


PICTURES = (".bmp", ".gif", ".jpeg", ".jpg", ".png", ".svg", ".svgz", ".tif", ".tiff", ".webp")
ARCHIVES = (".zip", ".tar", ".tgz", ".gz", ".bz2", ".xz")


@commands.command(short_help="Render pictures as patterns that can be felt.", rich_help_panel=RENDER)
def image(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="PNG, JPEG, GIF, WebP, BMP, TIFF, SVG.",
            autocompletion=completed_files(*PICTURES),
        ),
    ],
    device: Device = "paper-6x6",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File to write, .wav for one; none: plan only.")
    ] = None,
    explain: Annotated[Path | None, typer.Option(help="Folder for a picture of every step.")] = None,
    style: Annotated[str | None, typer.Option(help=f"Defaults for: {_words('style')}.")] = None,
    fit: Annotated[str | None, typer.Option(help=f"How it meets the grid: {_words('fit')}.")] = None,
    kind: Annotated[str | None, typer.Option("--as", help=f"What a dot can be: {_words('output')}.")] = None,
    threshold: Annotated[
        str | None, typer.Option(help=f"How figure and ground are parted: {_words('threshold')}.")
    ] = None,
    invert: Annotated[str | None, typer.Option(help=f"Raise what is dark: {_words('invert')}.")] = None,
    edges: Annotated[bool, typer.Option("--edges", help="Outlines in place of areas.")] = False,
    zoom: Annotated[int, typer.Option(help="From 2 on: an overview, then parts of the picture.")] = 1,
    dwell: Annotated[float, typer.Option(help="Seconds a frame is shown.")] = 1.0,
    contrast: Contrast = None,
    share: Yield = None,
    modulation: Modulated = None,
    actuator: Actuator = None,
    sample_format: Annotated[SampleFormat, typer.Option(help="Number format of the samples.")] = SampleFormat.FLOAT32,
    tol: Tol = None,
    budget: Budget = None,
    yes: Yes = False,
    as_json: Json = False,
) -> None:
    """Render pictures, one after another, and write the waveforms that make them felt.

    \b
    Example:
      dotwave image samples/icons/heart.svg -o heart.wav --explain steps
    """
    from ..api.pictures import image as image_scene
    from ..rendering.render import render as render_scene
    from ..rendering.steps import write_steps
    from ..request import request_of
    from .options import picture_options, place_of, profile_of

    request = request_of(
        tol=tol, budget=budget, contrast_db=contrast, yield_=share, encoding=sample_format.value,
        actuator=place_of(actuator), yes=yes,
    )  # fmt: skip
    options = picture_options(
        style=style, fit=fit, output=kind, threshold=threshold, invert=invert, edges=edges, zoom=zoom, dwell_s=dwell
    )
    profile = profile_of(device, modulation)
    scene = image_scene(files, profile, options)
    steps = () if explain is None else write_steps(files, profile, options, explain)
    report = render_scene(scene, profile, output, request)
    finish(replace(report, files=(*report.files, *steps)), as_json, ok=report.ok)


@commands.command(short_help="Render a set of icons and tell them apart.", rich_help_panel=RENDER)
def icons(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="DIR|GLOB|ARCHIVE...",
            help="Folders, globs, zip or tar archives.",
            autocompletion=completed_files(*PICTURES, *ARCHIVES),
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write to.")],
    device: Device = "paper-6x6",
    distinct: Annotated[bool, typer.Option("--distinct", help="Choose patterns that are not alike.")] = False,
    waveforms: Annotated[bool, typer.Option("--waveforms", help="Write a .wav for every icon.")] = False,
    pack: Annotated[Path | None, typer.Option(help="A .dwp of all icons as events, to be played from memory.")] = None,
    closer_than: Annotated[int, typer.Option(min=0, help="List pairs that differ in fewer dots.")] = 2,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes side by side; default: all cores.")] = None,
    scheduler: Annotated[str | None, typer.Option(help="Work on a dask cluster: tcp://HOST:PORT.")] = None,
    icon_seconds: Annotated[
        float, typer.Option(min=0.1, help="Processor time that one icon may take; not with --scheduler.")
    ] = 20.0,
    dwell: Annotated[float, typer.Option(help="Seconds an icon is shown.")] = 1.0,
    contrast: Contrast = None,
    sample_format: Annotated[SampleFormat, typer.Option(help="Number format of the samples.")] = SampleFormat.FLOAT32,
    tol: Tol = None,
    budget: Budget = None,
    yes: Yes = False,
    as_json: Json = False,
) -> None:
    """Encode and plan every icon; write manifest.json, manifest.csv, contact.png and index.html.

    Stopped in any way, the same call goes on where it was. The exit code is 1 when a file could not be used or a
    pattern cannot be made; the others are done all the same.

    \b
    Example:
      dotwave icons samples/icons -o out/icons --distinct
    """
    from ..icon_sets.build import IconOptions, render_icons
    from ..request import request_of

    request = request_of(tol=tol, budget=budget)
    options = IconOptions(
        device=device, distinct=distinct, waveforms=waveforms, workers=workers, scheduler=scheduler,
        closer_than=closer_than, contrast_db=contrast, dwell_s=dwell, encoding=sample_format.value,
        tol=request.tol, budget_s=request.budget_s, yes=yes, icon_seconds=icon_seconds,
        pack=pack,
    )  # fmt: skip
    report = render_icons(sources, output, options)
    finish(report, as_json, ok=report.ok)


@commands.command(short_help="Carry out a job file.", rich_help_panel=RENDER)
def render(
    job: Annotated[
        Path,
        typer.Argument(
            metavar="JOB.yaml",
            help="Device, tolerance, output and a sequence.",
            autocompletion=completed_files(".yaml", ".yml"),
        ),
    ],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="File to write, in place of the job's.")] = None,
    root: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Refuse a job that leads out of this folder; for jobs of others.")
    ] = None,
    share: Yield = None,
    actuator: Actuator = None,
    tol: Tol = None,
    budget: Budget = None,
    explain: Explain = False,
    pareto: Pareto = None,
    yes: Yes = False,
    as_json: Json = False,
) -> None:
    """Render a sequence of texts, pictures, icons, textures and pauses.

    Nothing is written when a frame cannot be made as asked; the exit code is then 1. --tol, --budget and --yield come
    before what the job says. With --root the job, every file it names and its output lie below a folder, links
    followed, and its tables are liblouis's own.

    \b
    Example:
      dotwave render samples/jobs/mixed.yaml
    """
    from ..rendering.job import render_job
    from ..request import request_of
    from .options import place_of

    request = request_of(
        tol=tol, budget=budget, pareto=pareto, explain=explain, yield_=share, actuator=place_of(actuator), yes=yes
    )
    report = render_job(job, output, request, root=root)
    finish(report, as_json, ok=report.ok)


@commands.command(short_help="Print the JSON Schema of job files.", rich_help_panel=RENDER)
def schema() -> None:
    """Print the JSON Schema of job files, for editors that complete and check them.

    \b
    Example:
      dotwave schema > job.schema.json
    """
    from ..jobs.job import job_schema

    say(json.dumps(job_schema(), indent=2))
