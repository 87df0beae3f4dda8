"""The commands that study a chain or a device: sweeps, benchmarks, calibration."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from ..errors import AppError
from .command import Device, Json, finish, say
from .completion import completed_files
from .help import STUDY

__all__ = ["commands"]

commands = typer.Typer(rich_markup_mode=None)


@commands.command(short_help="Solve one chain and print its steady state.", rich_help_panel=STUDY)
def simulate(
    chain: Annotated[
        str,
        typer.Argument(
            metavar="CHAIN.yaml",
            help="The chain, its setting and a tolerance; - is stdin.",
            autocompletion=completed_files(".yaml", ".yml"),
        ),
    ],
    as_json: Annotated[bool, typer.Option("--json", help="As without it: the answer is JSON.")] = False,
) -> None:
    """Solve a chain of coupled oscillators and print what it does, as JSON.

    The file says `chain`, `setting`, `rung`, `tol` and `start`; samples/chains has some to copy. The exit code
    is 1 when the outcome is not ok; the JSON is printed all the same.

    \b
    Example:
      dotwave simulate chain.yaml
    """
    from chainsim import simulate as solve

    from ..source import simulation_source

    answer = solve(simulation_source(chain))
    say(json.dumps(answer, allow_nan=False))
    raise typer.Exit(0 if answer["outcome"] == "ok" else 1)


@commands.command(short_help="Solve one chain at many settings.", rich_help_panel=STUDY)
def sweep(
    chain: Annotated[
        Path,
        typer.Argument(
            metavar="CHAIN.yaml",
            help="The chain, ranges of its setting, a tolerance.",
            autocompletion=completed_files(".yaml", ".yml"),
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="The .npz or .csv to write.")],
    only: Annotated[str | None, typer.Option(help="Fields to write, with commas between; default: all.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Also a map of two ranges, as PNG (needs an .npz).")] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes side by side.")] = 1,
    as_built: Annotated[
        bool, typer.Option("--as-built", help="Also what chains drawn at random reach, by what surrounds --device.")
    ] = False,
    device: Device = "paper-6x6",
    devices: Annotated[int | None, typer.Option(min=1, help="How many with --as-built; default: 64.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Of what is drawn; default: 0.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A dask.distributed scheduler whose workers solve it.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Solve a chain at every combination of its ranges, or at every row of a table.

    epsilon, lam and omega are numbers or ranges {from, to, steps, log}, or come from a table (.npz, .csv). Stopped
    halfway, the same call goes on where it was.

    --as-built adds the share of chains that reach the same outcome with all that the profile's section surroundings
    tells or assumes, the actuator that is farthest off, and the effect that spoils most.

    \b
    Example:
      dotwave sweep sweep.yaml -o sweep.npz --picture map.png
    """
    from ..figures.sweep_map import draw_map
    from ..studies.sweep import run_sweep

    fields = None if only is None else tuple(name.strip() for name in only.split(","))
    drawn = None
    if as_built:
        from ..api.scenes import device as device_of
        from ..as_built.settings import AsBuiltSettings

        drawn = AsBuiltSettings(device_of(device), devices or 64, seed or 0)
    elif devices is not None or seed is not None:
        raise AppError("--devices, --seed: they belong to --as-built; add that, or leave them out")
    report = run_sweep(chain, output, only=fields, workers=workers, as_built=drawn, scheduler=scheduler)
    if picture is not None:
        draw_map(chain, output, picture)
    finish(report, as_json, ok=True)


@commands.command(short_help="Measure the solvers against others, on this machine.", rich_help_panel=STUDY)
def bench(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for bench.json and bench.svg.")] = Path(
        "out/bench"
    ),
    quick: Annotated[bool, typer.Option("--quick", help="Fewer settings.")] = False,
    as_json: Json = False,
) -> None:
    """Measure steady states, transients, long chains and maps, and what is installed of their peers, as ratios.

    Needs a source tree: the measurements are in its benchmarks folder.

    \b
    Example:
      dotwave bench --quick
    """
    from ..studies.bench import run_bench

    finish(run_bench(output, quick=quick), as_json, ok=True)


@commands.command(short_help="Fit the actuators of a device to measured frequency sweeps.", rich_help_panel=STUDY)
def calibrate(
    sweep: Annotated[
        str,
        typer.Argument(
            metavar="SWEEP.csv",
            help="The measured points; - is standard input.",
            autocompletion=completed_files(".csv"),
        ),
    ],
    device: Device = "linked-6x6",
    output: Annotated[Path | None, typer.Option("--output", "-o", help="The .yaml to write; none: fit only.")] = None,
    lam: Annotated[float | None, typer.Option(help="What every link was set to during the sweep.")] = None,
    as_json: Json = False,
) -> None:
    """Fit natural frequency, damping, cubic term and coupling of each actuator, and write a device file.

    SWEEP.csv has the columns row, col, frequency_hz, drive_v, amplitude (of the displacement, over length_m)
    and phase_rad (negative = lag behind the drive), with up and down sweeps in the order of measuring, at one
    or more drives. Numbers come with 95 % confidence intervals. The exit code is 1, and nothing is written,
    when a chain does not fit.

    \b
    Example:
      dotwave calibrate samples/calibration/sweep.csv --device linked-6x6 --lam 0.006 -o my-device.yaml
    """
    from ..studies.calibrate import calibrate as fit

    report = fit(sweep, device=device, out=output, lam_set=lam)
    finish(report, as_json, ok=report.ok)
