"""Which settings make a scene on a device, frame by frame, and the voltages that carry them out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from chainsim import Outcome, surroundings_of
from drivers import Encoding, Waveform, channels_of
from encoders import Scene
from planner import FramePlan, Plan, plan_scene

from ..errors import AppError, NotMade
from ..rendering.render import render
from ..reports.html import html_table
from ..reports.report import Report
from ..request import Request
from ..scenes import DeviceScene, placed
from ..studies.judge import Judge
from .scenes import AnyDevice, device as device_of

if TYPE_CHECKING:
    from ..studies.tradeoff import ExplainReport

__all__ = ["PlanWaveform", "ScenePlan", "plan"]

SHOWN = 12


def plan(
    scene: Scene,
    device: AnyDevice | None = None,
    *,
    tol: float | None = None,
    budget_s: float | None = None,
    contrast_db: float | None = None,
    yield_: float | None = None,
) -> ScenePlan:
    """Find the settings that make a scene on a device.

    Nothing is planned before it is asked for: the first frame of a long text is there at once.

    Parameters
    ----------
    scene : encoders.Scene
        What should be felt: from `dotwave.text`, `image`, `icons`, `texture` or `job`.
    device : Device, name, file or mapping, optional
        The hardware, as `dotwave.device` takes it; may be left out for a job, which names its own.
    tol : float, optional
        Largest predicted error of an actuator, in units of full scale; a frame beyond it is ``unreachable``. A job
        has its own.
    budget_s : float, optional
        Seconds for planning; later frames are ``out_of_budget``.
    contrast_db : float, optional
        Decibels by which unraised dots stay below raised ones, planned and judged. A job has its own. Without,
        vibrating chains are planned with 20, and 12 are enough.
    yield_ : float, optional
        Share of devices, drawn with the device's spread, that are to keep what is wished. The report says on how
        many they do. A job has its own. The means for it are sought at once; a text without a presentation of its own
        may be shown by row or by dot for it.

    Returns
    -------
    ScenePlan
        A sequence of `FramePlan`.

    Raises
    ------
    planner.PlanError, dotwave.AppError
        When the scene was laid out for another grid, or there is no device to plan for.

    Examples
    --------
    >>> import dotwave as dw
    >>> plan = dw.plan(dw.text("Hello world", "linked-6x6"), "linked-6x6", tol=0.02)
    >>> len(plan), plan[0].outcome.value, plan[0].error < 0.02
    (2, 'ok', True)
    >>> [frame.frame.text for frame in plan]
    ['Hello', 'world']
    """
    request = Request(tol=tol, budget_s=budget_s, contrast_db=contrast_db, yield_=yield_)
    if isinstance(scene, DeviceScene):
        request = scene.request(request)
        device = scene.device if device is None else device
    if device is None:
        raise AppError("plan: no device was given; give the one that the scene was laid out for")
    profile = device_of(device)
    if request.yield_ is not None:
        from ..rendering.presenting import presented

        scene = presented(scene, profile, request).scene
    found = plan_scene(scene, profile, contrast_db=request.contrast_db, yield_=request.yield_)
    return ScenePlan(profile, _Judged(found, scene, request), scene.encoding, scene, request)


@dataclass(frozen=True, repr=False, eq=False)
class ScenePlan(Plan, Sequence[FramePlan]):
    """The plan of a scene: a sequence of its frames, planned as they are asked for, each time anew.

    An index plans all frames up to it, so iterate where you want them all.

    Attributes
    ----------
    device : chainsim.Device
        The hardware.
    frames : iterable of FramePlan
        All of the time line, with the way out after the last frame, whose `frame` is None.
    scene : encoders.Scene
        What should be felt.
    request : Request
        Tolerance, budget, contrast and yield.

    Examples
    --------
    >>> import dotwave as dw
    >>> plan = dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6")
    >>> plan
    <ScenePlan of text: Hi on paper-6x6>
    >>> plan[-1].states[0].target.shape
    (6,)
    """

    scene: Scene
    request: Request

    def __repr__(self) -> str:
        return f"<ScenePlan of {', '.join(self.scene.parts) or 'a scene'} on {self.device.name}>"

    def _repr_html_(self) -> str:
        frames = list(islice(self, SHOWN + 1))
        more = f"; the first {SHOWN}" if len(frames) > SHOWN else ""
        return html_table(
            f"Plan of {', '.join(self.scene.parts)} on {self.device.name}{more}",
            ("frame", "text", "cells", "settled, s", "end, s", "outcome", "error, % of full scale"),
            (_row(number, frame) for number, frame in enumerate(frames[:SHOWN], 1)),
        )

    def __len__(self) -> int:
        return sum(1 for _ in self.scene.frames)

    def __iter__(self) -> Iterator[FramePlan]:
        return (frame for frame in self.frames if frame.frame is not None)

    @overload
    def __getitem__(self, index: int) -> FramePlan: ...

    @overload
    def __getitem__(self, index: slice) -> list[FramePlan]: ...

    def __getitem__(self, index: int | slice) -> FramePlan | list[FramePlan]:
        if isinstance(index, slice):
            return list(self)[index]
        place = index if index >= 0 else len(self) + index
        found = next(islice(self, place, None), None) if place >= 0 else None
        if found is None:
            raise IndexError(f"frame {index}: the plan has {len(self)}, counted from 0")
        return found

    def explain(self, tol: float = 1e-2) -> ExplainReport:
        """Which terms of the model the scene needs on the device, and why.

        Parameters
        ----------
        tol : float
            What may be left out together, relative to the largest amplitude.

        Returns
        -------
        ExplainReport
            Print its `as_text()`; `as_dict()` has the numbers.

        Examples
        --------
        >>> import dotwave as dw
        >>> plan = dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6")
        >>> print(plan.explain().as_text().splitlines()[0])
        What this scene requires on paper-6x6:
        """
        from planner import require

        from ..studies.tradeoff import ExplainReport

        return ExplainReport(require(self.frames, self.device, surroundings_of(self.device), tol=tol))

    def report(self) -> Report:
        """What `dotwave text`, `image` or `render` say of it; plans every frame.

        Returns
        -------
        Report
            With `ok`, `outcomes`, `duration_s` (seconds), `peak_volts`, `error` (of full scale), `notes`.

        Examples
        --------
        >>> import dotwave as dw
        >>> report = dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6").report()
        >>> report.ok, report.outcomes
        (True, {'ok': 1})
        """
        return render(self.scene, self.device, None, self.request)

    def waveform(self) -> PlanWaveform:
        """The amplifier voltages that carry it out; nothing is computed yet.

        Returns
        -------
        PlanWaveform
            With `samples`, `blocks` and `write`.

        Examples
        --------
        >>> import dotwave as dw
        >>> wave = dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6").waveform()
        >>> wave.rate_hz, len(wave.channels)
        (8000, 42)
        """
        return PlanWaveform(self.device, channels_of(self.device), _Made(self.frames), self)


@dataclass(frozen=True, repr=False, eq=False)
class PlanWaveform(Waveform):
    """Volts of every channel as a function of time.

    Attributes
    ----------
    device : chainsim.Device
        The hardware.
    channels : tuple of drivers.Channel
        What each column of the samples is: drive or bias, row, column.
    plan : ScenePlan
        What it carries out.

    Examples
    --------
    >>> import dotwave as dw
    >>> wave = dw.plan(dw.text("Hi", "linked-6x6"), "linked-6x6").waveform()
    >>> volts = wave.samples(0.0, 0.5)
    >>> volts.shape, volts.dtype.name
    ((12000, 6), 'float64')
    """

    plan: ScenePlan

    def __repr__(self) -> str:
        return f"<PlanWaveform of {self.plan!r}, {len(self.channels)} channels at {self.rate_hz} samples a second>"

    def _repr_html_(self) -> str:
        rows = [
            (channel.index, channel.role.value, channel.row, "" if channel.col is None else channel.col)
            for channel in self.channels
        ]
        return html_table(f"Channels at {self.rate_hz} samples a second", ("channel", "role", "row", "column"), rows)

    def write(
        self,
        path: str | PathLike[str],
        *,
        encoding: Encoding = "float32",
        actuator: tuple[int, int] | None = None,
    ) -> Report:
        """Write it to a file: samples with a manifest beside them, or a haptic file, as the ending says.

        Parameters
        ----------
        path : path
            Of a .wav, .npz, .csv or .raw, or of an .hjif, .ahap or .haptic.
        encoding : {"float32", "pcm24"}
            Number format of the samples of a .wav.
        actuator : (int, int), optional
            Row and column that an .ahap or .haptic shows; without, the mean over the grid.

        Returns
        -------
        Report
            Its `files` are what was written.

        Raises
        ------
        NotMade
            When a frame cannot be made as asked; nothing is written.
        drivers.DriverError
            When the file cannot be written.

        Examples
        --------
        >>> import dotwave as dw
        >>> wave = dw.plan(dw.text("Hi", "linked-6x6"), "linked-6x6").waveform()
        >>> wave.write("hi.wav").files
        ('hi.wav', 'hi.json')
        """
        from dataclasses import replace

        request = replace(self.plan.request, encoding=encoding, actuator=actuator, yes=True)
        report = render(self.plan.scene, self.device, Path(path), request)
        if not report.made:
            raise NotMade(report.failure)
        return report


@dataclass(frozen=True)
class _Judged:
    """The frames of a plan, judged anew by every iteration."""

    plan: Plan
    scene: Scene
    request: Request

    def __iter__(self) -> Iterator[FramePlan]:
        with placed(self.scene):
            yield from Judge(self.request).judged(self.plan)


@dataclass(frozen=True)
class _Made:
    """Frames that can be made; the first that cannot ends it."""

    frames: Iterable[FramePlan]

    def __iter__(self) -> Iterator[FramePlan]:
        for number, frame in enumerate(self.frames, 1):
            if frame.outcome is not Outcome.OK:
                raise NotMade(f"Frame {number}: {frame.note}")
            yield frame


def _row(number: int, frame: FramePlan) -> tuple[Any, ...]:
    assert frame.frame is not None
    shown = frame.frame
    times = f"{frame.settled_s:.3f}", f"{frame.end_s:.3f}"
    return number, shown.text, shown.cells.replace("\n", " / "), *times, frame.outcome, f"{100 * frame.error:.2f}"
