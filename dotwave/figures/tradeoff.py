"""Pictures of what accuracy costs and of what a frame can be bought for."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chainsim import RUNGS
from drivers import atomic_file, naming

from ..plain import one_line

if TYPE_CHECKING:
    from planner import ParetoFront, Tradeoff

__all__ = ["draw_pareto", "draw_tradeoff"]

# Of rungs, in the order of `chainsim.RUNGS`; a colour and a mark for those to come.
COLOURS = ("#7a5195", "#d1495b", "#edae49", "#00798c", "#66a182", "#2e4057")
MARKS = "Ps^Dvo"
AUTO, ANOTHER = ("#8d99ae", "x"), ("black", "*")
# Errors below this are rounding.
ROUNDING = 1e-16
SHAPES = "so^DvP"


def draw_tradeoff(found: Tradeoff, picture: Path, *, tol: float | None, budget_s: float | None) -> None:
    """True error (filled) and the rung's own estimate (outlined) against time; the line joins what none beats."""
    figure, axes = _axes((7.4, 4.2))
    axes.set(xscale="log", yscale="log")
    looks = {**dict(zip(RUNGS, zip(COLOURS, MARKS, strict=True), strict=False)), "auto": AUTO}
    for rung in dict.fromkeys(row.rung for row in found.rows):
        rows = [row for row in found.rows if row.rung == rung]
        seconds = [row.seconds for row in rows]
        errors = [max(row.error, ROUNDING) for row in rows]
        estimates = [max(row.estimate, ROUNDING) for row in rows]
        colour, mark = looks.get(rung, ANOTHER)
        style = {"marker": mark, "linestyle": "none", "color": colour}
        lost = " (not all chains)" if min(row.solved for row in rows) < 1 else ""
        axes.plot(seconds, errors, label=rung.replace("_", " ") + lost, markersize=7, zorder=3, **style)
        if rung != "auto":
            axes.plot(seconds, estimates, markerfacecolor="none", markersize=7, zorder=2, **style)
            axes.vlines(seconds, errors, estimates, color=style["color"], linewidth=0.8, alpha=0.5)
    low, high = axes.get_ylim()
    bottom, top = min(low, found.reference_error / 10), max(high, 3 * (tol or 0.0))
    axes.axhspan(bottom, found.reference_error, color="#f0f0f0", zorder=0, label="below what the reference is known to")
    axes.set_ylim(bottom, top)
    front = found.front
    reached = [max(row.error, ROUNDING) for row in front]
    axes.step([row.seconds for row in front], reached, where="post", color="#999999")
    _wishes(axes, tol, budget_s)
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="seconds for all chains of the scene",
        ylabel="error, of the largest amplitude",
    )
    chains = "1 chain" if found.states == 1 else f"{found.states} chains"
    title = one_line(f"{chains} on {found.device}: filled the true error, outlined the rung's own estimate")
    # A name with dollar signs is no formula.
    axes.set_title(title, fontsize=9, parse_math=False)
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    _save(figure, picture)


def _wishes(axes: Any, tol: float | None, budget_s: float | None) -> None:
    """Dotted lines at a tolerance and a budget."""
    line = {"color": "#999999", "linestyle": ":", "linewidth": 1}
    if tol is not None:
        place = {"xycoords": ("axes fraction", "data"), "ha": "right", "va": "bottom", "fontsize": 8}
        axes.axhline(tol, **line)
        axes.annotate(f"tolerance {tol:g}", (0.99, tol), **place)
    if budget_s is not None:
        place = {"xycoords": ("data", "axes fraction"), "ha": "right", "va": "top", "fontsize": 8, "rotation": 90}
        axes.axvline(budget_s, **line)
        axes.annotate(f"budget {1e3 * budget_s:g} ms", (budget_s, 0.98), **place)


def draw_pareto(found: ParetoFront, picture: Path) -> None:
    """Peak drive against the length of the way in; shape is the contrast, colour what 1 % spread does."""
    figure, axes = _axes((6.4, 4.2))
    contrasts = sorted({point.contrast_db for point in found.points})
    shades = [100 * point.spread for point in found.points]
    shown: Any = None
    for shape, contrast in zip(SHAPES, contrasts, strict=False):
        points = [point for point in found.points if point.contrast_db == contrast]
        shown = axes.scatter(
            # A little apart, so that contrasts do not hide each other.
            [1e3 * point.ramp_s * (1 + 0.03 * (contrasts.index(contrast) - 1)) for point in points],
            [100 * point.drive for point in points],
            c=[100 * point.spread for point in points], vmin=min(shades), vmax=max(shades), cmap="viridis_r",
            marker=shape, s=36, edgecolors="black", linewidths=0.4,
            label="full contrast" if math.isinf(contrast) else f"{contrast:.0f} dB contrast",
        )  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel="time to the pattern, ms", ylabel="peak drive, % of the amplifier")
    ticks = sorted({1e3 * point.ramp_s for point in found.points})
    axes.set_xticks(ticks, [f"{tick:.0f}" for tick in ticks])
    axes.minorticks_off()
    percent = [tick for tick in (0.5, 1, 2, 5, 10, 20, 50, 100) if axes.get_ylim()[0] <= tick <= axes.get_ylim()[1]]
    axes.set_yticks(percent, [f"{tick:g}" for tick in percent])
    figure.colorbar(shown, ax=axes, label="error by 1 % spread of f0, % of full scale")
    legend = figure.legend(fontsize=8, frameon=False, loc="outside lower center", ncols=len(contrasts))
    for handle in legend.legend_handles:
        # Colour says something else.
        handle.set(facecolor="white", array=None)
    title = one_line(f"{len(found.points)} ways on {found.device} that no other beats")
    axes.set_title(title, fontsize=10, parse_math=False)
    _save(figure, picture)


def _axes(size: tuple[float, float]) -> tuple[Any, Any]:
    # Imported here: only a picture needs it. No window system is needed for a figure that is only saved.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.grid(color="#e5e5e5", zorder=0)
    axes.set_axisbelow(True)
    return figure, axes


def _save(figure: Any, picture: Path) -> None:
    # No date in the file: the same numbers give the same bytes.
    still: dict[str, None] = {"Date": None} if picture.suffix.lower() == ".svg" else {"Software": None}
    with atomic_file(picture) as file, naming(picture):
        figure.savefig(file, format=picture.suffix[1:].lower(), dpi=110, metadata=still)
