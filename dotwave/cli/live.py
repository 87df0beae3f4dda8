"""The commands that play live: what a screen reader writes, and recordings of it."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from .command import Device, Json, finish
from .help import PLAY

__all__ = ["commands"]

commands = typer.Typer(rich_markup_mode=None)


class Source(StrEnum):
    """Where windows come from (`dotwave.bridges.run.WindowSource`, which takes longer to import)."""

    BRLAPI = "brlapi"
    BAUM = "baum"
    CANUTE = "canute"
    LINES = "lines"


class CursorShown(StrEnum):
    """How the cursor is drawn."""

    BLINK = "blink"
    NONE = "none"


To = Annotated[str, typer.Option(metavar="SINK", help="controller:PORT or none.")]
Show = Annotated[bool, typer.Option("--show", help="Write what is felt to the terminal, a line a change.")]
Record = Annotated[Path | None, typer.Option("--record", "-o", help="A .jsonl for what comes and goes.")]


@commands.command(short_help="Show what a screen reader writes, now.", rich_help_panel=PLAY)
def live(
    device: Device = "linked-6x6",
    source: Annotated[Source, typer.Option("--from", help="Where windows come from.")] = Source.BRLAPI,
    to: To = "none",
    show: Show = False,
    record: Record = None,
    doctor: Annotated[bool, typer.Option("--doctor", help="Only say what to type, and what is missing.")] = False,
    table: Annotated[str | None, typer.Option(help="Of the characters, where text comes and not cells.")] = None,
    cursor: Annotated[CursorShown, typer.Option(help="How the cursor is drawn.")] = CursorShown.BLINK,
    idle: Annotated[float, typer.Option(min=0, max=3600, help="Seconds a pattern stands with nobody left.")] = 30.0,
    link: Annotated[Path | None, typer.Option(help="A stable name for the port of baum or canute.")] = None,
    keys: Annotated[
        Path | None, typer.Option(help="File or named pipe with keys: a line such as next or route 3.")
    ] = None,
    key_file: Annotated[Path | None, typer.Option(help="BrlAPI's key, which clients must know then.")] = None,
    as_json: Json = False,
) -> None:
    """Show what a screen reader writes while it writes it, and hand keys back.

    It PLAYS when --to names hardware, behind the safety gate. Orca, BRLTTY and NVDA need no change: --doctor says
    what to type. Keys come from the buttons beside the grid, from --keys, and from the terminal: arrows, or p and n
    for previous and next, u and d for up and down, h for home, 1 to 9 for a cell. Ctrl-C brings the output to zero
    and ends.

    \b
    Example:
      dotwave live --device linked-6x6 --from brlapi --show
    """
    if doctor:
        from .live_doctor import examine_live

        health = examine_live(device)
        finish(health, as_json, ok=health.ok)
    from ..bridges.run import LiveOptions, WindowSource, play_live

    options = LiveOptions(
        to=to, show=show, record=record, table=table, cursor=cursor is CursorShown.BLINK, idle_s=idle, link=link,
        key_file=keys, secret=key_file,
    )  # fmt: skip
    report = play_live(device, WindowSource(source.value), options)
    finish(report, as_json, ok=report.ok)


@commands.command(short_help="Show a recorded session again.", rich_help_panel=PLAY)
def replay(
    session: Annotated[Path, typer.Argument(help="A .jsonl written by `dotwave live --record`.")],
    device: Device = "linked-6x6",
    to: To = "none",
    show: Show = False,
    record: Record = None,
    as_json: Json = False,
) -> None:
    """Show what was recorded of a live session again, at its own pace, on any grid with the cells for it.

    It PLAYS when --to names hardware, behind the safety gate.

    \b
    Example:
      dotwave replay session.jsonl --device linked-6x6 --show
    """
    from ..bridges.run import LiveOptions, replay as run

    report = run(session, device, LiveOptions(to=to, show=show, record=record))
    finish(report, as_json, ok=report.ok)
