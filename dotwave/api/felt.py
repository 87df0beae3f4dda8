"""What is felt when a waveform is played: the full equations under its samples."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from os import PathLike
from typing import TYPE_CHECKING, overload

from ..reports.html import html_table
from ..reports.text import VerifyReport, decibels
from ..verification import verify as verify_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..as_built.report import AsBuiltReport
    from .memory import Playable

__all__ = ["Felt", "verify"]


@overload
def verify(
    what: Playable, *, icon: str | None = None, devices: None = None, seed: int = 0, scheduler: str | None = None
) -> Felt: ...


@overload
def verify(what: Playable, *, devices: int, seed: int = 0, scheduler: str | None = None) -> AsBuiltReport: ...


def verify(
    what: Playable, *, icon: str | None = None, devices: int | None = None, seed: int = 0, scheduler: str | None = None
) -> Felt | AsBuiltReport:
    """Integrate the device's full equations under the samples of a waveform and say what is felt.

    Of a file nothing but the samples and the manifest beside them is read. A plan or a waveform in memory is written
    as float64 to a temporary folder and read back, so that it goes the same way.

    Parameters
    ----------
    what : path, ScenePlan or PlanWaveform
        A written waveform (the samples or the manifest), a pack, a plan, or its waveform.
    icon : str, optional
        Name of the entry of a pack that has several.
    devices : int, optional
        Say instead what is felt on so many devices as built, drawn at random, with all that surrounds them.
    seed : int
        Of these devices.
    scheduler : str, optional
        Address of a dask.distributed scheduler whose workers do it.

    Returns
    -------
    Felt
        With `ok`, `frames` and `text`.
    dotwave.as_built.report.AsBuiltReport
        When `devices` are asked for, with `ok`, `yield_`, `worst_dot`, `effects` and `as_text()`.

    Raises
    ------
    drivers.DriverError
        When the files cannot be used, or the samples are not those the manifest was written for.
    NotMade
        When a frame of a plan cannot be made as asked.

    Examples
    --------
    >>> import dotwave as dw
    >>> felt = dw.verify(dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6"))
    >>> felt.ok, felt.text
    (True, 'Hi')
    >>> felt.frames[0].amplitude.shape
    (6, 6)
    >>> dw.verify(dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6"), devices=10).devices
    10
    """
    from .memory import MEMORY, on_disk

    name = None if isinstance(what, str | PathLike) else MEMORY
    with on_disk(what) as path:
        if devices is None:
            return Felt.of(verify_file(path, icon), name)
        from ..as_built.study import AsBuiltStudy, verify_as_built

        report = verify_as_built(path, AsBuiltStudy(devices, seed, scheduler))
        return report if name is None else replace(report, path=name)


@dataclass(frozen=True, repr=False)
class Felt(VerifyReport):
    """What is felt of a waveform.

    Attributes
    ----------
    ok : bool
        Every dot is right, the levels are within their limits, and a text comes back.
    frames : tuple of FrameCheck
        Each with `amplitude` and `target` (float64, shape (rows, cols), in units of full scale), `wrong_dots`,
        `contrast_db`, `amplitude_error`, and the times `start_s`, `settled_s`, `end_s` in seconds.
    text : str
        What the felt cells say when they are translated back; empty when it is no text.

    Examples
    --------
    >>> import dotwave as dw
    >>> felt = dw.verify(dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6"))
    >>> felt
    <Felt: ok, 1 frame on paper-6x6, 'Hi'>
    >>> print(felt.as_text().splitlines()[1])
    Wrong dots: 0.
    """

    @classmethod
    def of(cls, report: VerifyReport, path: str | None = None) -> Felt:
        """The same as a report of the command line has it; `path` in place of the file's."""
        return cls(**{one.name: getattr(report, one.name) for one in fields(report)} | ({"path": path} if path else {}))

    @property
    def text(self) -> str:
        """What the felt cells say; white space at the ends apart."""
        return self.felt_text.strip()

    def figure(self, most: int = 12) -> Figure:
        """What was wanted beside what is felt, frame by frame, as discs whose area is the amplitude.

        Parameters
        ----------
        most : int
            Frames to draw, from the first.

        Returns
        -------
        matplotlib.figure.Figure
            In a notebook it shows itself, with `words` as its alternative text.

        Examples
        --------
        >>> import dotwave as dw
        >>> felt = dw.verify(dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6"))
        >>> len(felt.figure().axes)
        2
        """
        from ..figures.felt import felt_figure

        return felt_figure(self, most, self.words())

    def words(self) -> str:
        """All that `figure` shows, and more, as lines of plain text: dots as ``o`` and ``.``, levels in decibels.

        Examples
        --------
        >>> import dotwave as dw
        >>> felt = dw.verify(dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6"))
        >>> "Dots felt: the same." in felt.words()
        True
        """
        from ..reports.spoken import spoken

        return "\n".join(spoken(self))

    def __repr__(self) -> str:
        frames = f"{len(self.frames)} frame{'' if len(self.frames) == 1 else 's'}"
        text = "" if self.text_equal is None else f", {self.text!r}"
        return f"<Felt: {'ok' if self.ok else 'not ok'}, {frames} on {self.device}{text}>"

    def _repr_html_(self) -> str:
        return html_table(
            f"What is felt of {self.path} on {self.device}: {'all is right' if self.ok else 'not all is right'}",
            ("frame", "text", "cells felt", "wrong dots", "contrast", "error, % of full scale"),
            (
                (
                    number, one.text, one.felt_cells.replace("\n", " / "), one.wrong_dots, decibels(one.contrast_db),
                    f"{100 * one.amplitude_error:.2f}",
                )
                for number, one in enumerate(self.frames, 1)
            ),
        )  # fmt: skip
