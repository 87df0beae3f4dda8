"""What the commands of the command line share: options, and the way a result is printed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from drivers import PACK_SUFFIX, SUFFIXES
from encoders import Undefined

from ..errors import AppError
from ..plain import Printable, printable
from .completion import completed_devices, completed_files

if TYPE_CHECKING:
    from chainsim import Device as Profile
    from encoders import TextOptions

    from ..reports.report import Report
    from ..request import Request

__all__ = [
    "Actuator", "Budget", "Contrast", "Device", "Explain", "Icon", "Json", "Language", "Modulated", "Output", "Pareto",
    "Scheduler", "Tol", "Unwritable", "Waveforms", "Workers", "Written", "Yes", "Yield", "finish", "finish_folder",
    "finish_run", "printable", "say",
]  # fmt: skip

Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Device = Annotated[
    str,
    typer.Option(
        "--device",
        "-d",
        help="A built-in profile or a YAML file; see `dotwave devices`.",
        autocompletion=completed_devices,
    ),
]
Written = Annotated[
    str,
    typer.Argument(
        metavar="OUT",
        help="A waveform written by `dotwave text` (.wav or .json), or a pack (.dwp).",
        autocompletion=completed_files(*SUFFIXES, PACK_SUFFIX, ".json"),
    ),
]
Icon = Annotated[str | None, typer.Option(metavar="NAME", help="Which one of a pack (.dwp) that has several.")]
Tol = Annotated[
    str | None,
    typer.Option(help="Largest error of full scale: draft, normal, fine or a number; says what it took."),
]
Budget = Annotated[
    str | None, typer.Option(help="Time for planning, such as 50ms or 2s; says how exact the answer is.")
]
Contrast = Annotated[
    float | None,
    typer.Option(
        min=6.0, max=60.0, help="Least decibels between raised and unraised dots; none: 20 planned, 12 enough."
    ),
]
Yield = Annotated[
    float | None,
    typer.Option(
        "--yield", min=0.0, max=1.0, help="Share of devices, drawn with the device's spread, that are to keep it."
    ),
]
Modulated = Annotated[
    str | None, typer.Option("--modulation", metavar="HZ[,DEPTH]", help="Of a carrier; none: as the device has it.")
]
Actuator = Annotated[
    str | None, typer.Option(metavar="ROW,COL", help="The one an .ahap or .haptic shows; none: the mean.")
]
Language = Annotated[str | None, typer.Option(metavar="TAG", help="Language, such as de, instead of --table.")]
Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", help="File to write, .wav for one; of a folder a folder; none: plan only."),
]
Unwritable = Annotated[
    Undefined | None, typer.Option(help="Characters the table cannot write: name them, leave them out, refuse.")
]
Waveforms = Annotated[bool, typer.Option("--waveforms", help="Of a folder: write a .wav for every text.")]
Workers = Annotated[int | None, typer.Option(min=1, help="Of a folder: processes; default: all cores.")]
Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Of a folder: work on a dask cluster that shares it.")
]
Explain = Annotated[bool, typer.Option("--explain", help="Also list which terms of the model are needed, and why.")]
Pareto = Annotated[
    str | None,
    typer.Option(metavar="N|PICTURE|N:PICTURE", help="Also list what frame N (else 1) can be bought for; draw it."),
]
Yes = Annotated[bool, typer.Option("--yes", "-y", help="Do not ask before a file of more than 1 GB.")]


def finish(report: Printable, as_json: bool, *, ok: bool) -> NoReturn:
    """Print a report, as JSON or as text, and end with exit code 0 or 1."""
    shown = json.dumps(report.as_dict(), ensure_ascii=False, allow_nan=False) if as_json else report.as_text()
    say(shown)
    raise typer.Exit(0 if ok else 1)


def finish_run(report: Report, as_json: bool) -> NoReturn:
    """As `finish`, with the exit code that the report's outcome has."""
    finish(report, as_json, ok=report.ok)


def finish_folder(
    folder: Path,
    out: Path | None,
    device: Profile,
    options: TextOptions,
    request: Request,
    as_json: bool,
    *,
    waveforms: bool,
    workers: int | None,
    scheduler: str | None,
) -> NoReturn:
    """Render all texts of a folder and print the report; arguments are those of `libraries.build.render_library`."""
    # Imported here: one text does without.
    from ..libraries.build import WorkPlaces, render_library

    places = WorkPlaces(workers, scheduler)
    report = render_library(folder, out, device, options, request, waveforms=waveforms, places=places)
    finish(report, as_json, ok=report.ok)


def say(words: str) -> None:
    """Print `words` on standard output.

    Raises
    ------
    AppError
        When it cannot take them; a reader that has gone is a BrokenPipeError.
    """
    try:
        typer.echo(printable(words))
    except BrokenPipeError:
        raise
    except OSError as error:
        raise AppError(f"standard output: {error.strerror or error}; send it elsewhere, or free some space") from None
