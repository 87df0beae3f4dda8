"""The command line: reads arguments, calls one function, prints.

Exit codes: 0 done; 1 an outcome that is not ok, or a verification that failed; 2 bad input or circumstances, with
one line on stderr; 70 a fault of the program; 130 after Ctrl-C; 141 when nobody reads the output any more; 143 after
SIGTERM. Imports that take time stay inside the commands.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from typer.main import get_command_name
from typer.models import CommandInfo

from encoders import EmphasisChoice, Grade, ImageChoice, LineEnds, Mathematics, PageNumbering, Presentation

from ..errors import Terminated
from .command import (
    Actuator,
    Budget,
    Contrast,
    Device,
    Explain,
    Icon,
    Json,
    Language,
    Modulated,
    Output,
    Pareto,
    Scheduler,
    Tol,
    Unwritable,
    Waveforms,
    Workers,
    Written,
    Yes,
    Yield,
    finish as _finish,
    finish_folder,
    finish_run,
)
from .completion import completed_devices, completed_texts
from .ending import ended
from .help import LOOK, RENDER, SET_UP, Commands
from .options import Dots, SampleFormat

__all__ = ["app", "application", "main"]


def _without_commands() -> typer.Typer:
    return typer.Typer(
        name="dotwave",
        help="Braille, textures and icons as amplifier waveforms for grids of coupled piezoelectric actuators.",
        no_args_is_help=True,
        cls=Commands,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )


app = _without_commands()

GAP = "in actuators."
Words = Annotated[
    str,
    typer.Argument(
        metavar="TEXT|FILE|FOLDER|-",
        help="A file or folder if it exists, - for stdin, else words.",
        autocompletion=completed_texts(),
    ),
]
Shown = Annotated[Presentation | None, typer.Option(help="Show a page at once, row by row, dot by dot; or scroll.")]
Start = Annotated[
    str | None, typer.Option("--from", metavar="PAGE|CHAPTER|WORDS", help="Begin at a page, heading or words.")
]

Lines = Annotated[LineEnds | None, typer.Option(help="Single line ends: a new line too, or a blank.")]
Numbers = Annotated[PageNumbering | None, typer.Option(help="Nowhere, in a page's last cells, in frames of their own.")]


@app.command(short_help="Render text as Braille that can be felt.", rich_help_panel=RENDER)
def text(
    source: Words,
    device: Device = "paper-6x6",
    output: Output = None,
    table: Annotated[str | None, typer.Option(help="Table file, list, or query: 'language:de grade:2'.")] = None,
    language: Language = None,
    grade: Annotated[Grade | None, typer.Option(help="With --language; uncontracted if not said.")] = None,
    undefined: Unwritable = None,
    cell_gap: Annotated[int | None, typer.Option(min=0, help=f"Empty columns between cells, {GAP}")] = None,
    line_gap: Annotated[int | None, typer.Option(min=0, help=f"Empty rows between lines, {GAP}")] = None,
    rate: Annotated[float | None, typer.Option(help="Reading rate, cells per second.")] = None,
    dwell: Annotated[float | None, typer.Option(help="Seconds per page, instead of --rate.")] = None,
    presentation: Shown = None,
    dots: Annotated[Dots | None, typer.Option(help="Dots per cell.")] = None,
    blank_between: Annotated[bool, typer.Option("--blank-between", help="A blank page between paragraphs.")] = False,
    contrast: Contrast = None,
    share: Yield = None,
    modulation: Modulated = None,
    encoding: Annotated[str | None, typer.Option(help="Of the file's characters, such as cp1252.")] = None,
    emphasis: Annotated[EmphasisChoice | None, typer.Option(help="Of documents, written or not.")] = None,
    images: Annotated[ImageChoice | None, typer.Option(help="Of documents, as the words they bring or felt.")] = None,
    math: Annotated[Mathematics | None, typer.Option(help="Formulas of documents, in Nemeth code or words.")] = None,
    start_at: Start = None,
    pages: Annotated[str | None, typer.Option(help="Only these, such as 10-20; counted from --from.")] = None,
    lines: Lines = None,
    page_numbers: Numbers = None,
    actuator: Actuator = None,
    sample_format: Annotated[SampleFormat, typer.Option(help="Number format of the samples.")] = SampleFormat.FLOAT32,
    tol: Tol = None,
    budget: Budget = None,
    explain: Explain = False,
    pareto: Pareto = None,
    waveforms: Waveforms = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    yes: Yes = False,
    as_json: Json = False,
) -> None:
    """Render text as Braille and write the waveforms that make it felt.

    TEXT|FILE|FOLDER|-: a path that exists is read as a file (text, Unicode Braille, BRF, PEF, eBraille, Markdown,
    HTML, EPUB, DAISY, DOCX, ODT, PDF), - is standard input, anything else is the text itself. Words with a
    slash or the ending of a text and no spaces are taken for a path, and refused when there is no such file.

    A folder is one job: every text and document below it is rendered, -o names a folder for library.json, a
    journal and the waveforms, and the same call again goes on where it was.

    \b
    Example:
      dotwave text "Hello world" --device linked-6x6 -o hello.wav
    """
    from ..api.scenes import text as text_scene
    from ..rendering.render import render
    from ..request import request_of
    from ..source import text_source
    from .options import place_of, profile_of, refuse, text_options

    request = request_of(
        tol=tol, budget=budget, pareto=pareto, explain=explain, contrast_db=contrast, yield_=share,
        encoding=sample_format.value, actuator=place_of(actuator), yes=yes,
    )  # fmt: skip
    options = text_options(
        table=table, language=language, grade=grade, undefined=undefined, cell_gap=cell_gap, line_gap=line_gap,
        rate=rate, dwell_s=dwell, presentation=presentation, dots=dots, blank_between=blank_between, lines=lines,
        encoding=encoding, emphasis=emphasis, images=images, math=math, start_at=start_at, pages=pages,
        page_numbers=page_numbers,
    )  # fmt: skip
    profile = profile_of(device, modulation)
    if os.path.isdir(source):
        given = Path(source), output, profile, options, request
        finish_folder(*given, as_json, waveforms=waveforms, workers=workers, scheduler=scheduler)
    refuse("a folder of texts", waveforms=waveforms or None, workers=workers, scheduler=scheduler)
    finish_run(render(text_scene(text_source(source, options), profile, options), profile, output, request), as_json)


@app.command(short_help="Say what a written waveform makes felt.", rich_help_panel=LOOK)
def verify(
    out: Written,
    icon: Icon = None,
    as_built: Annotated[
        bool, typer.Option("--as-built", help="On many devices, with all that surrounds them in the profile.")
    ] = False,
    devices: Annotated[int | None, typer.Option(min=1, help="How many with --as-built; default: 1000.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Of these devices; default: 0.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A dask.distributed scheduler whose workers do --as-built.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Integrate the full equations under the samples of a written waveform and say what is felt.

    Reads only the samples and the manifest beside them. The exit code is 1 when a dot is wrong, a level
    is outside its limits, or the text does not come back; with --as-built, when that is so on any device.

    --as-built draws devices with the spread, hysteresis, creep, higher modes, amplifier and fingertip that the
    profile's section surroundings tells or assumes, and says the yield, the worst dot, contrasts, and which effect
    spoils what.

    \b
    Example:
      dotwave verify hello.wav --as-built --devices 200
    """
    from ..api.felt import verify as check
    from .options import refuse

    if as_built:
        refuse("a check without --as-built", icon=icon)
        built = check(Path(out), devices=devices or 1000, seed=seed or 0, scheduler=scheduler)
        _finish(built, as_json, ok=built.ok)
    refuse("--as-built", devices=devices, seed=seed, scheduler=scheduler)
    report = check(Path(out), icon=icon)
    _finish(report, as_json, ok=report.ok)


@app.command(short_help="Draw and spell out what a written waveform makes felt.", rich_help_panel=LOOK)
def preview(
    out: Written,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Start of the file names; default: OUT's own.")
    ] = None,
    icon: Icon = None,
    as_json: Json = False,
) -> None:
    """Verify a written waveform, then draw its frames: PNG, GIF, and the same as text for a screen reader.

    Every frame shows what was wanted beside what is felt. For hello.wav it writes hello.preview.png,
    hello.preview.gif and hello.preview.txt; with -o pictures/hello, pictures/hello.png and so on.

    \b
    Example:
      dotwave preview hello.wav
    """
    from ..api.felt import verify as check
    from ..figures.preview import write_preview

    report = write_preview(check(Path(out), icon=icon), output or Path(out).with_suffix(".preview"))
    _finish(report, as_json, ok=True)


@app.command(short_help="List device profiles, or print one.", rich_help_panel=SET_UP)
def devices(
    name: Annotated[
        str | None,
        typer.Argument(help="One profile, or a YAML file: print every value.", autocompletion=completed_devices),
    ] = None,
    as_json: Json = False,
) -> None:
    """List the built-in device profiles, with the values that are assumed rather than given.

    \b
    Example:
      dotwave devices linked-6x6
    """
    from .listing import list_devices

    _finish(list_devices(name), as_json, ok=True)


@app.command(short_help="List translation tables.", rich_help_panel=SET_UP)
def tables(
    wanted: Annotated[
        str | None, typer.Argument(metavar="FILTER", help="Part of a file name, language or name.")
    ] = None,
    as_json: Json = False,
) -> None:
    """List the Braille tables liblouis has: file, language, grade, name.

    \b
    Example:
      dotwave tables german
    """
    from .listing import list_translation_tables

    _finish(list_translation_tables(wanted), as_json, ok=True)


@app.command(short_help="Check this installation.", rich_help_panel=SET_UP)
def doctor(as_json: Json = False) -> None:
    """Check Python, the packages, liblouis, the cache and the disk, and name the cure for what is wrong.

    \b
    Example:
      dotwave doctor
    """
    from .doctor import examine

    report = examine()
    _finish(report, as_json, ok=report.ok)


@cache
def application() -> typer.Typer:
    """All commands."""
    for name in ("pictures", "study", "plan", "play", "live", "studio"):
        app.add_typer(import_module(f".{name}", __package__).commands)
    return app


def _asked(words: Sequence[str]) -> typer.Typer:
    """No other command than the first of `words`, where that is one: making all takes longer than most take to run."""
    for info in _commands():
        if words[:1] == [info.name or get_command_name(getattr(info.callback, "__name__", ""))]:
            only = _without_commands()
            only.registered_commands.append(info)
            # Without a function of its own it would be the command itself, not a group of one.
            only.callback()(lambda: None)
            return only
    return application()


def _commands() -> Iterator[CommandInfo]:
    """Those of this file, then of the others, which are imported only when none of the first is asked for."""
    yield from app.registered_commands
    for group in application().registered_groups:
        if group.typer_instance is not None:
            yield from group.typer_instance.registered_commands


def _terminate(number: int, _frame: object) -> NoReturn:
    raise Terminated(128 + number)


def _speak_utf8() -> None:
    """Start again in UTF-8 where names of files could only be ASCII (a C locale, and Python told to keep to it)."""
    if sys.getfilesystemencoding() == "ascii":
        os.execv(sys.executable, [sys.executable, "-X", "utf8", *sys.orig_argv[1:]])


def _fill_streams() -> None:
    """Where the program was started without stdout or stderr, what is said goes nowhere.

    Else the next file that is opened would get the number of the missing one, and words for a person into it.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # It gets the lowest number that is free.
            os.open(os.devnull, os.O_RDWR)
    for name, number in (("stdout", 1), ("stderr", 2)):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w", encoding="utf-8", closefd=False))


def main() -> None:
    """Entry point: runs the command and turns what went wrong into an exit code."""
    _speak_utf8()
    _fill_streams()
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), _terminate)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            # A terminal that cannot show Braille gets escapes, not a traceback.
            stream.reconfigure(errors="backslashreplace")
    sys.exit(ended(lambda: _asked(sys.argv[1:])(prog_name="dotwave")))
