"""The commands that play: on hardware, on a stand-in, and the ports there are."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from .command import Device, Icon, Json, Written, finish
from .help import PLAY

__all__ = ["commands"]

commands = typer.Typer(rich_markup_mode=None)


class BoardModel(StrEnum):
    """Boards that play by themselves."""

    DRV2667 = "drv2667"


class BoardFirmware(StrEnum):
    """What runs on the board (`drivers.Firmware`, light to import)."""

    TEST_PIXEL = "test-pixel"
    CORRECTED = "corrected"


@commands.command(short_help="Play a written waveform on hardware.", rich_help_panel=PLAY)
def play(
    out: Written,
    port: Annotated[str | None, typer.Option("--port", "-p", help="Serial port; see `dotwave ports`.")] = None,
    live: Annotated[bool, typer.Option("--live", help="Really play; without it only the checks are made.")] = False,
    baud: Annotated[int | None, typer.Option(min=300, help="Bits per second; default: the controller's own.")] = None,
    patience: Annotated[
        float | None, typer.Option(min=0.1, help="Seconds to wait for a controller not heard; default: 10.")
    ] = None,
    parametric: Annotated[
        bool, typer.Option("--parametric", help="No samples: the controller draws it itself.")
    ] = False,
    board: Annotated[BoardModel | None, typer.Option(help="A board that plays by itself, instead.")] = None,
    firmware: Annotated[BoardFirmware | None, typer.Option(help="What runs on the board; default: test-pixel.")] = None,
    audio: Annotated[str | None, typer.Option(help="Sound card, by name or number; '' is the default one.")] = None,
    channels: Annotated[str | None, typer.Option("--map", help="Sound card outputs: channel:output,...")] = None,
    to: Annotated[str | None, typer.Option(metavar="NAME:PLACE", help="Any sink, also one of another package.")] = None,
    icon: Icon = None,
    adapt: Annotated[bool, typer.Option("--adapt", help="Correct while playing, from what is measured.")] = False,
    noise: Annotated[float, typer.Option(min=0, max=0.5, help="Of a sensor, share of full scale; --adapt.")] = 0.002,
    amplitudes: Annotated[bool, typer.Option("--amplitudes", help="The sensors tell no phases; --adapt.")] = False,
    as_json: Json = False,
) -> None:
    """Check a written waveform against the safety gate and, with --live, play it.

    Nothing leaves this machine without --live, and nothing at all when a sample is over a limit. Ctrl-C ramps
    the output to zero. The exit code is 1 when the buffer ran dry or the output was held on the way.

    With --adapt a controller that measures is sent its frames half a second ahead, each corrected by what was measured
    of those before; every sample of them is held against the gate as it goes out.

    \b
    Example:
      dotwave play hello.wav --port /dev/ttyACM0 --live
    """
    from drivers import Firmware

    from ..playing.adapting import Adapting
    from ..playing.play import play as run

    report = run(
        Path(out), live=live, port=port, board=board is not None, audio=audio, to=to, baud=baud, patience_s=patience,
        parametric=parametric or None, icon=icon,
        firmware=None if firmware is None else Firmware(firmware.value), mapping=channels,
        adapt=Adapting(noise, not amplitudes) if adapt else None,
    )  # fmt: skip
    finish(report, as_json, ok=report.ok)


@commands.command(short_help="Identify a device from the pages it shows.", rich_help_panel=PLAY)
def tune(
    port: Annotated[str, typer.Option("--port", "-p", help="Serial port; see `dotwave ports`.")],
    device: Device = "linked-6x6",
    output: Annotated[Path | None, typer.Option("--output", "-o", help="The .yaml to write; none: look only.")] = None,
    goal: Annotated[float, typer.Option(min=1e-3, max=0.5, help="Error to be expected of a page in the end.")] = 0.02,
    noise: Annotated[float, typer.Option(min=0, max=0.5, help="Of a sensor; both are shares of full scale.")] = 0.002,
    amplitudes: Annotated[bool, typer.Option("--amplitudes", help="The sensors tell no phases.")] = False,
    baud: Annotated[int | None, typer.Option(min=300, help="Bits per second; default: the controller's own.")] = None,
    as_json: Json = False,
) -> None:
    """Show the pages that tell most of a device, correct it after each, and write a device file.

    It PLAYS: every page stands for some seconds, behind the safety gate. The controller must measure what its actuators
    do. What was found stands in the section actuators, with 95 % confidence; what the pages do not tell is said. The
    exit code is 1, and nothing is written, when the last page is not felt as wanted or an actuator is not of the
    profile's kind. A device that holds its pages by a bias is looked at only, without --output: it says what a volt
    makes, loop and creep, and how well pages are held once these are undone.

    \b
    Example:
      dotwave tune --port /dev/ttyACM0 --device linked-6x6 -o my-device.yaml
    """
    from chainsim import load_device

    from ..playing.measuring import MeasuringPort
    from ..studies.tune import tune as run
    from ..studies.tune_bias import tune_bias

    line, profile = MeasuringPort(port, baud), load_device(device)
    if profile.bias == "actuator" and output is None:
        held = tune_bias(profile, line, noise=noise)
        finish(held, as_json, ok=held.ok)
    report = run(device, line, output, goal=goal, noise=noise, phases=not amplitudes)
    finish(report, as_json, ok=report.ok)


@commands.command(short_help="List serial ports.", rich_help_panel=PLAY)
def ports(as_json: Json = False) -> None:
    """List the serial ports of this machine.

    \b
    Example:
      dotwave ports
    """
    from ..playing.play import list_ports

    finish(list_ports(), as_json, ok=True)


@commands.command(short_help="Stand in for a controller.", rich_help_panel=PLAY)
def emulate(
    device: Device = "paper-6x6",
    link: Annotated[Path | None, typer.Option(help="A stable name for the port (a symbolic link).")] = None,
    record: Annotated[Path | None, typer.Option("--record", "-o", help="A .wav for what arrives.")] = None,
    plant: Annotated[Path | None, typer.Option(help="How the grid truly is (YAML); it then measures.")] = None,
    seconds: Annotated[float | None, typer.Option(help="Stop after so long; default: Ctrl-C.")] = None,
    once: Annotated[bool, typer.Option("--once", help="Stop when the first session has ended.")] = False,
    buffer: Annotated[float, typer.Option(help="Seconds the controller can store.")] = 2.0,
    watchdog: Annotated[float, typer.Option(help="Seconds of silence after which the output is zero.")] = 0.2,
    drift: Annotated[float, typer.Option(help="Error of its clock in parts per million.")] = 0.0,
    drop: Annotated[float, typer.Option(min=0, max=1, help="Share of packets lost.")] = 0.0,
    corrupt: Annotated[float, typer.Option(min=0, max=1, help="Share of packets spoiled.")] = 0.0,
    duplicate: Annotated[float, typer.Option(min=0, max=1, help="Share of packets doubled.")] = 0.0,
    delay: Annotated[float, typer.Option(min=0, help="Seconds every packet is late.")] = 0.0,
    stall: Annotated[str | None, typer.Option(help="AT,LENGTH in seconds: packets wait.")] = None,
    disconnect: Annotated[str | None, typer.Option(help="AT,LENGTH in seconds: the cable is out.")] = None,
    seed: Annotated[int, typer.Option(help="Of the faults.")] = 0,
    as_json: Json = False,
) -> None:
    """Emulate a controller on a pseudo-terminal: play to it from another terminal.

    It shows what is felt as Braille and levels, the buffer, and the faults it makes on request.

    \b
    Example:
      dotwave emulate --device linked-6x6 --link /tmp/controller --record arrived.wav
    """
    from drivers import Faults

    from ..playing.emulate import emulate as run, parse_window

    faults = Faults(
        drop=drop, corrupt=corrupt, duplicate=duplicate, delay_s=delay, stall=parse_window(stall, "stall"),
        disconnect=parse_window(disconnect, "disconnect"),
    )  # fmt: skip
    report = run(
        device=device, link=link, record=record, plant=plant, seconds=seconds, once=once, buffer_s=buffer,
        watchdog_s=watchdog, drift_ppm=drift, faults=faults, seed=seed,
    )  # fmt: skip
    finish(report, as_json, ok=True)
