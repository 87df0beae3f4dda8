"""What `dotwave explain`, `tradeoff` and `pareto` find: what a scene requires, and what accuracy costs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chainsim import Device, load_device, surroundings_of
from encoders import Scene, TargetPattern, TextOptions, encode_text
from planner import Plan, plan_scene

from ..errors import AppError
from ..reports.html import html_table
from ..reports.report import plain
from ..request import FrameRequest, picture_name
from ..scenes import shape_of
from ..source import text_source

if TYPE_CHECKING:
    from planner import ParetoFront, ParetoPoint, Requirement, Tradeoff, TradeoffRow

__all__ = [
    "ExplainReport", "ParetoReport", "TradeReport", "explain", "pareto_report", "planned", "trade", "trade_frame",
]  # fmt: skip


def planned(source: str, device: str | None, *, otherwise: str = "paper-6x6") -> tuple[Scene, Plan]:
    """The scene of a job file or of a text, and its plan.

    Parameters
    ----------
    source : a job file (.yaml, .yml), a text file, ``-``, or the text itself.
    device : a profile's name or file; None is the job's own, or `otherwise` for a text.

    Raises
    ------
    AppError, ChainError, EncodeError, PlanError
        When what is given cannot be used.
    """
    if source.lower().endswith((".yaml", ".yml")) and not any(letter.isspace() for letter in source):
        scene, profile, contrast_db = _of_job(Path(source), None if device is None else load_device(device))
    else:
        profile, contrast_db = load_device(device or otherwise), None
        scene = encode_text(text_source(source), shape_of(profile), TextOptions())
    return scene, plan_scene(scene, profile, contrast_db=contrast_db)


def _of_job(path: Path, given: Device | None) -> tuple[Scene, Device, float | None]:
    from ..jobs.scene import read_job_scene

    found = read_job_scene(path, device=given)
    return found, found.device, found.job.contrast_db


@dataclass(frozen=True, repr=False)
class ExplainReport:
    """What a scene requires."""

    required: Requirement

    def __repr__(self) -> str:
        return f"<ExplainReport: what the scene requires on {self.required.device}>"

    def _repr_html_(self) -> str:
        rows = (
            (term.name, f"{term.effect:.1e}", "in" if term.included else "out", term.cost, term.why)
            for term in self.required.terms
        )
        columns = ("term", "effect", "in or out", "cost, evaluations", "why")
        return html_table(f"What this scene requires on {self.required.device}", columns, rows)

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types; an effect without bound is null."""
        found = plain(self.required.as_dict())
        assert isinstance(found, dict)
        return found

    def as_text(self) -> str:
        """A line for each term, then the verdict."""
        return f"What this scene requires on {self.required.device}:\n{self.required.as_text()}"


def explain(source: str, *, device: str | None, tol: float) -> ExplainReport:
    """Which terms of the model a scene needs on a device, to a tolerance relative to the largest amplitude."""
    from planner import require

    _, plan = planned(source, device)
    return ExplainReport(require(plan.frames, plan.device, surroundings_of(plan.device), tol=tol))


@dataclass(frozen=True)
class TradeReport:
    """Speed against accuracy; `choices` are sentences on what a budget and a tolerance reach, `ok` whether they do."""

    found: Tradeoff
    choices: tuple[str, ...]
    ok: bool
    picture: Path | None

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        picture = None if self.picture is None else str(self.picture)
        return {"ok": self.ok, **self.found.as_dict(), "choices": list(self.choices), "picture": picture}

    def as_text(self) -> str:
        """A line for each rung and tolerance (those that give the same are one), then what was asked for."""
        found, front = self.found, self.found.front
        lines = [
            f"Distinct chains on {found.device}: {found.states}, measured against {found.reference}, "
            f"known to {found.reference_error:.0e}.",
            f"{'rung':17} {'tol':>13} {'error':>8} {'its own':>8} {'time':>8} {'memory':>8}  work",
        ]
        lines += [_row_words(rows, front) for rows in _alike(found.rows)]
        lines.append("* no other is both faster and more accurate.")
        lines += [f"{rung}: not here, {why}." for rung, why in found.refused.items()]
        if found.skipped:
            lines.append(
                f"{found.skipped} chains are not compared: they have several tones, or are beyond the first 64."
            )
        return "\n".join([*lines, *self.choices, *([f"Picture: {self.picture}."] if self.picture else [])])


def _alike(rows: tuple[TradeoffRow, ...]) -> list[list[TradeoffRow]]:
    """Rows of one rung whose work and error do not depend on the tolerance, together."""
    groups: list[list[TradeoffRow]] = []
    for row in rows:
        last = groups[-1][-1] if groups else None
        same = last is not None and (last.rung, last.error, _work(last)) == (row.rung, row.error, _work(row))
        if same:
            groups[-1].append(row)
        else:
            groups.append([row])
    return groups


def _work(row: TradeoffRow) -> tuple[int, int, int]:
    return row.work.rhs_evals, row.work.newton_steps, row.work.oscillators_solved


def _row_words(rows: list[TradeoffRow], front: tuple[TradeoffRow, ...]) -> str:
    from planner import seconds_words

    row = min(rows, key=lambda one: one.seconds)
    tols = [f"{one.tol:.0e}" for one in rows if one.tol is not None]
    asked = "" if not tols else tols[0] if len(tols) == 1 else f"{tols[0]}..{tols[-1]}"
    evals, steps, solved = _work(row)
    work = f"{evals} evaluations, {steps} Newton steps" if evals else f"{steps} Newton steps, {solved} oscillators"
    lost = "" if row.solved == 1 else f"; {100 * (1 - row.solved):.0f} % of the chains end elsewhere"
    memory = "" if row.memory is None else f"{row.memory / 1024:.0f} kB"
    mark = "*" if any(one in front for one in rows) else " "
    return (
        f"{row.rung:16}{mark} {asked:>13} {row.error:8.1e} {row.estimate:8.1e} {seconds_words(row.seconds):>8} "
        f"{memory:>8}  {work}{lost}"
    )


def trade(
    source: str, *, device: str | None, tol: float | None, budget_s: float | None, picture: Path | None
) -> TradeReport:
    """Measure every rung and tolerance on a scene; with a picture, draw the front (PNG or SVG)."""
    from planner import trade_off

    _, plan = planned(source, device)
    _only_chains("tradeoff", plan.device)
    found = trade_off(plan.frames, plan.device)
    chosen = [] if tol is None else [found.cheapest(tol)]
    chosen += [] if budget_s is None else [found.within(budget_s)]
    if picture is not None:
        from ..figures.tradeoff import draw_tradeoff

        _drawn(picture, lambda: draw_tradeoff(found, picture, tol=tol, budget_s=budget_s))
    return TradeReport(found, tuple(one.sentence for one in chosen), all(one.met for one in chosen), picture)


@dataclass(frozen=True)
class ParetoReport:
    """What a frame can be bought for."""

    found: ParetoFront
    frame: int
    picture: Path | None

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        picture = None if self.picture is None else str(self.picture)
        return {"frame": self.frame, **self.found.as_dict(), "picture": picture}

    def as_text(self) -> str:
        """For each length of the way in the points with the least drive, error and spread."""
        found = self.found
        lines = [
            f"Frame {self.frame} on {found.device}: {len(found.points)} of {found.tried} ways are beaten by no other "
            f"({found.unfit} were beyond volts, links or well).",
            f"{'way in':>7} {'omega':>6} {'contrast':>8} {'error':>6} {'residue':>7} {'drive':>6} {'noise':>8} "
            f"{'1 % spread':>10}  least",
        ]
        for ramp_s in dict.fromkeys(point.ramp_s for point in found.points):
            same = [point for point in found.points if point.ramp_s == ramp_s]
            lines += _cheapest_words(same)
        return "\n".join([*lines, *([f"Picture: {self.picture}."] if self.picture else [])])


OBJECTIVES: dict[str, Callable[[ParetoPoint], float]] = {
    "drive": lambda one: one.drive,
    "error": lambda one: one.error,
    "noise": lambda one: one.noise_gain,
    "spread": lambda one: one.spread,
}


def _cheapest_words(points: list[ParetoPoint]) -> list[str]:
    least: dict[ParetoPoint, list[str]] = {}
    for name, cost in OBJECTIVES.items():
        least.setdefault(min(points, key=cost), []).append(name)
    return [
        f"{1e3 * one.ramp_s:4.0f} ms {one.omega:6.3f} {_contrast(one.contrast_db):>8} {100 * one.error:4.0f} % "
        f"{one.made:7.0e} {100 * one.drive:4.0f} % {one.noise_gain:8.1e} {100 * one.spread:8.0f} %  {', '.join(names)}"
        for one, names in least.items()
    ]


def _contrast(decibels: float) -> str:
    return f"{decibels:.0f} dB" if decibels < float("inf") else "full"


def _only_chains(command: str, device: Device) -> None:
    """What compares ways, or rungs, does so for chains."""
    if device.grid:
        raise AppError(f"{command}: {device.name} is coupled in two dimensions; take a device of chains (linked-6x6)")


def trade_frame(source: str, *, device: str | None, frame: int, picture: Path | None) -> ParetoReport:
    """The Pareto set of one frame of a scene, counted from 1.

    Raises
    ------
    AppError
        When the scene has no such frame.
    """
    scene, plan = planned(source, device, otherwise="linked-6x6")
    _only_chains("pareto", plan.device)
    chosen = next(islice(iter(scene.frames), frame - 1, None), None) if frame > 0 else None
    if chosen is None:
        raise AppError(f"--frame: the scene has no frame {frame}; count from 1")
    return pareto_report(chosen.pattern, plan.device, FrameRequest(frame, picture))


def pareto_report(pattern: TargetPattern, device: Device, asked: FrameRequest) -> ParetoReport:
    """The Pareto set of a pattern; with a picture, drawn (PNG or SVG).

    Raises
    ------
    AppError, PlanError
        When no way fits the device, or the picture cannot be written.
    """
    from planner import pareto_of

    found = pareto_of(pattern, device)
    if not found.points:
        raise AppError(f"frame {asked.number}: no way fits {device.name}; see `dotwave text` for what is lacking")
    picture = asked.picture
    if picture is not None:
        from ..figures.tradeoff import draw_pareto

        _drawn(picture, lambda: draw_pareto(found, picture))
    return ParetoReport(found, asked.number, picture)


def _drawn(picture: Path, draw: Callable[[], None]) -> None:
    picture_name(picture)
    draw()
