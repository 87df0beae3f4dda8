"""A set of icons: encoded, planned, told apart, written; what was finished is never done again."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from chainsim import load_device
from drivers import PACK_SUFFIX, naming
from encoders import Frame, PictureOptions, TargetPattern

from ..errors import AppError
from ..rendering.extent import extent_of, go_on
from .journal import Journal
from .metadata import told_of
from .pool import ClusterPool, LocalPool, Pool
from .report import IconsReport
from .run import CANDIDATES, IconOptions, IconRun
from .sources import find_icons
from .work import Recipe, versions
from .written import write_report

__all__ = ["IconOptions", "render_icons"]

JOURNAL = "journal.jsonl"
REPORTS = ("manifest.csv", "manifest.json", "contact.png", "index.html")


def render_icons(
    sources: Sequence[str],
    out: Path,
    options: IconOptions | None = None,
    *,
    clock: Callable[[], float] = time.monotonic,
) -> IconsReport:
    """Encode and plan every icon of `sources` and write manifest, contact sheets and waveforms into folder `out`.

    A picture that cannot be used is reported and the others go on. A run into the same folder takes over what an
    earlier one finished, however that one ended. On Ctrl-C the manifest of what is finished is written.

    Parameters
    ----------
    clock : seconds, by which the budget is kept and the report says how long it took.

    Raises
    ------
    AppError
        When there are no pictures, `out` has files that dotwave did not make, no process can be started, or no
        scheduler answers.
    ChainError, DriverError
        When the device cannot be used, or the disk refuses.
    """
    began = clock()
    options = options or IconOptions()
    device = load_device(options.device)
    picture = PictureOptions(
        pitch_m=(device.pitch_m, device.pitch_m),
        dwell_s=options.dwell_s,
        candidates=CANDIDATES if options.distinct else 1,
    )
    if options.pack is not None and options.pack.suffix.lower() != PACK_SUFFIX:
        raise AppError(f"--pack {options.pack}: expected a name that ends in {PACK_SUFFIX}")
    recipe = Recipe(device, picture, options.contrast_db, options.encoding, versions())
    places = find_icons(sources)
    if options.waveforms:
        blank = Frame(TargetPattern(np.zeros((device.rows, device.cols), np.complex128)), options.dwell_s)
        go_on(extent_of([blank], device, Path("icon.wav"), options.encoding, len(places)), out, yes=options.yes)
    _check_own(out)
    with naming(out):
        out.mkdir(parents=True, exist_ok=True)
    pool: Pool = (
        ClusterPool(options.scheduler) if options.scheduler else LocalPool(options.workers, options.icon_seconds)
    )
    with Journal(out / JOURNAL) as journal:
        run = IconRun(recipe, options, out, places, journal, told=told_of(places), clock=clock)
        try:
            with pool:
                run.work(pool)
        except (KeyboardInterrupt, SystemExit):
            write_report(run.report(complete=False, seconds=clock() - began), out, pictures=False)
            raise
        report = run.report(complete=True, seconds=clock() - began)
    report = write_report(report, out, pictures=True)
    return report if options.pack is None else _with_pack(report, recipe, options.pack)


def _with_pack(report: IconsReport, recipe: Recipe, path: Path) -> IconsReport:
    # Imported here: most sets are written without.
    from .pack import write_icon_pack

    packed = write_icon_pack(report.icons, recipe, path)
    return replace(report, files=(*report.files, packed.path), reached=(*report.reached, packed.sentence))


def _check_own(out: Path) -> None:
    """A folder without a journal is not one of ours: what is in it is not replaced."""
    if os.path.lexists(out / JOURNAL):
        return
    for name in (*REPORTS, "waveforms"):
        if os.path.lexists(out / name):
            raise AppError(f"{out}: has {name}, and no {JOURNAL} that says dotwave made it; give another folder")
