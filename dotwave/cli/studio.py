"""The command that opens the web pages."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .command import Device, Json, finish
from .help import SET_UP

__all__ = ["commands"]

commands = typer.Typer(rich_markup_mode=None)


@commands.command(short_help="Everything in local web pages.", rich_help_panel=SET_UP)
def studio(
    device: Device = "linked-6x6",
    folder: Annotated[Path, typer.Option("--folder", help="Where results are kept, a folder each.")] = Path(
        "dotwave-studio"
    ),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Of this machine; 0: any that is free.")] = 0,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only say the address.")] = False,
    as_json: Json = False,
) -> None:
    """Open the pages of dotwave in a browser: write, look, trade, play. Ctrl-C ends it.

    They are served on this machine alone (127.0.0.1), for the browser that opens the printed address first. They
    need no shell, no mouse and no sight. Needs the extra studio: pip install 'dotwave[studio]'.

    \b
    Example:
      dotwave studio --device linked-6x6 --folder lessons
    """
    from ..studio.serve import serve

    finish(serve(folder, device=device, port=port, browser=not no_browser), as_json, ok=True)
