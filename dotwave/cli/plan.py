"""The commands about the price of a plan: what a scene requires, what accuracy costs, what a frame can be made of."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .command import Device, Json, finish
from .completion import completed_devices, completed_texts
from .help import STUDY

__all__ = ["commands"]

commands = typer.Typer(rich_markup_mode=None)

Source = Annotated[
    str,
    typer.Argument(
        metavar="JOB.yaml|TEXT|FILE|-",
        help="A job file, or a text as `dotwave text`.",
        autocompletion=completed_texts(".yaml", ".yml"),
    ),
]
Profile = Annotated[
    str | None,
    typer.Option(
        "--device",
        "-d",
        help="A profile or YAML file; default: the job's own, or paper-6x6.",
        autocompletion=completed_devices,
    ),
]
Picture = Annotated[Path | None, typer.Option("--picture", help="Also a picture, .png or .svg.")]


@commands.command(short_help="Say which terms of the model a scene needs, and why.", rich_help_panel=STUDY)
def explain(
    source: Source,
    device: Profile = None,
    tol: Annotated[float, typer.Option(help="What may be left out together, of the largest amplitude.")] = 1e-2,
    as_json: Json = False,
) -> None:
    """Estimate what every term of the model does to this scene on this device: effect, in or out, cost, and why.

    Nothing is solved or integrated; the estimates are closed forms and on the safe side.

    \b
    Example:
      dotwave explain "Hello" --device linked-6x6 --tol 1e-3
    """
    from ..studies.tradeoff import explain as run

    finish(run(source, device=device, tol=tol), as_json, ok=True)


@commands.command(short_help="Measure speed against accuracy on a scene.", rich_help_panel=STUDY)
def tradeoff(
    source: Source,
    device: Profile = None,
    tol: Annotated[float | None, typer.Option(help="Name the cheapest answer this accurate.")] = None,
    budget: Annotated[str | None, typer.Option(help="Name the best answer in this time, such as 50ms.")] = None,
    picture: Picture = None,
    as_json: Json = False,
) -> None:
    """Solve a scene's chains with every rung and tolerance: error true and estimated, time, memory, work.

    The exit code is 1 when --tol or --budget cannot be met; what was reached is said all the same.

    \b
    Example:
      dotwave tradeoff "Hello" --device linked-6x6 --tol 1e-3 --budget 50ms --picture front.png
    """
    from ..request import seconds_of
    from ..studies.tradeoff import trade

    budget_s = None if budget is None else seconds_of(budget)
    report = trade(source, device=device, tol=tol, budget_s=budget_s, picture=picture)
    finish(report, as_json, ok=report.ok)


@commands.command(short_help="Trade error, time, drive and robustness of one frame.", rich_help_panel=STUDY)
def pareto(
    source: Source,
    device: Annotated[
        str | None,
        typer.Option(
            "--device",
            "-d",
            help="A profile or YAML file; default: the job's own, or linked-6x6.",
            autocompletion=completed_devices,
        ),
    ] = None,
    frame: Annotated[int, typer.Option(min=1, help="Which frame of the scene, from 1.")] = 1,
    picture: Picture = None,
    as_json: Json = False,
) -> None:
    """List the ways to make a frame that no other beats, over length of the way in, frequency, contrast and drive.

    Ways of vibrations and waves are tried in the full equations; those of deflections are closed forms.

    \b
    Example:
      dotwave pareto "Hello" --device linked-6x6 --picture ways.png
    """
    from ..studies.tradeoff import trade_frame

    finish(trade_frame(source, device=device, frame=frame, picture=picture), as_json, ok=True)


@commands.command(short_help="Say which kinds of patterns a device makes.", rich_help_panel=STUDY)
def reach(
    device: Device = "paper-6x6",
    spread: Annotated[
        float | None, typer.Option(help="Of natural frequencies, 0.01 for 1 %: say the yield under it, too.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Plan a few patterns of every kind on a device: which it makes, how fast, how surely, at what drive.

    Nothing is written. Times are ways in from rest; error, drive and well are the largest, over full scale, the
    amplifier's volts and the edge of the softening well. The map shows which waves can stand on a chain.

    \b
    Example:
      dotwave reach --device linked-6x6
    """
    from ..api.scenes import device as device_of
    from ..studies.reach import reach_of

    finish(reach_of(device_of(device), spread), as_json, ok=True)
