"""Section 3.1.1: where in (epsilon, lam, omega) the chain stays locked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Closure, Outcome, Setting, reached_from_rest
from chainsim.continuation.locking import locking
from chainsim.continuation.spectrum import delta_from_critical_lam

from .page import RED, Finding, Page, sheet

Floats = NDArray[np.float64]

PERIODS = 8000
EPSILONS = np.geomspace(5e-5, 5e-3, 28)
LAMS = np.linspace(0.002, 0.014, 25)
OMEGAS = np.linspace(0.985, 1.03, 31)
SMALL = 5e-4
FAINT = 0.1
STATES = ("locked to the end", "locked, dies on the way", "not locked", "undecided", "escaped")
PLACE = {Outcome.OK: 0, Outcome.NOT_LOCKED: 2, Outcome.OUT_OF_BUDGET: 3, Outcome.ESCAPED: 4}


def lattice(chain: Chain, rows: Floats, columns: Floats, names: tuple[str, str], fixed: dict[str, float]) -> Floats:
    """State of every pair of values, as an index into STATES."""
    first, second = (grid.ravel() for grid in np.meshgrid(rows, columns, indexing="ij"))
    values: dict[str, Any] = {**fixed, names[0]: first, names[1]: second}
    values["lam"] = np.asarray(values["lam"])[:, None]
    setting = Setting.of(chain, **values)
    if chain.closure is Closure.OPEN:
        slow = locking(chain, setting, start="rest")
        outcome, size = slow.outcome, slow.amplitude
    else:
        full = reached_from_rest(chain, setting, max_periods=PERIODS)
        outcome, size = full.outcome, np.abs(full.phasor)
    state = np.array([PLACE[each] for each in outcome], dtype=float)
    state[(state == 0) & (size[:, -1] < FAINT * size[:, 0])] = 1
    return state.reshape(len(rows), len(columns))


def figure(out: Path) -> Page:
    """Map the locked ranges of the open chain and of the ring."""
    delta = delta_from_critical_lam(6.13e-3, 6)
    maps = []
    for closure in (Closure.OPEN, Closure.RING):
        chain = Chain(6, delta, -1.0, closure)
        maps.append(
            (
                lattice(chain, EPSILONS, LAMS, ("epsilon", "lam"), {"omega": 1.0}),
                lattice(chain, OMEGAS, LAMS, ("omega", "lam"), {"epsilon": SMALL}),
            )
        )

    def paint(axes: Any) -> None:
        from matplotlib.colors import ListedColormap

        colors = ListedColormap(["#5b94cf", "#d5e5f4", "#f2b48c", "#e8e8e8", "#4a4a4a"])
        for row, pair, name in zip(axes, maps, ("open chain", "ring"), strict=True):
            for ax, grid, values, label in zip(row, pair, (EPSILONS, OMEGAS), ("ε", "ω"), strict=True):
                mesh = ax.pcolormesh(LAMS * 1e3, values, grid, cmap=colors, vmin=-0.5, vmax=4.5, shading="nearest")
                ax.axvline(6.13, color=RED, lw=0.9, ls="--")
                where = "ω = 1" if label == "ε" else f"ε = {SMALL:g}"
                ax.set(title=f"{name}, {where}", xlabel="λ · 10³", ylabel=label)
                if label == "ε":
                    ax.set_yscale("log")
        bar = axes[0, 0].figure.colorbar(mesh, ax=axes, ticks=range(5), shrink=0.6)
        bar.ax.set_yticklabels(STATES)

    sheet(out, "ranges", (2, 2), (10.5, 7), paint)
    near = int(np.abs(LAMS - 6.131e-3).argmin())
    return Page(
        "ranges",
        "Section 3.1.1: ranges in which the chain stays locked",
        "From rest; the open chain by the envelope, the ring by the full equations. (a) of the paper: at ω = 1 the "
        "open chain is locked for every λ and ε looked at, and from two thirds of the critical λ on its wave reaches "
        "the last actuator. (b): at a small ε the same wave reaches the end only within a narrow band of ω, which "
        "widens with λ; outside it the chain is locked but dies on the way. The paper does not say what it counts "
        "as synchronised; with the end at a tenth of the beginning or more, both statements fit the open chain. "
        "The ring adds what an open chain cannot have: beyond its critical λ it is locked only by a strong drive "
        "just past it. The paper gives no numbers for these ranges, so the agreement is one of shape. Grey cells "
        f"need more than {PERIODS} periods to decide.",
        [
            Finding("open chain, ω = 1: share of the map that locks", _share(maps[0][0], 2), "wide range"),
            Finding("the same, with the end above a tenth of the beginning", _share(maps[0][0], 1)),
            Finding(f"open chain, ε = {SMALL:g}, λ ≈ 6.1e-3: ω that reach the end", _span(OMEGAS, maps[0][1][:, near]),
                    "narrow range"),
            Finding("ring, λ ≈ 6.1e-3, ω = 1: smallest ε above which it locks", _smallest(maps[1][0][:, near])),
            Finding("ring, ω = 1: share of the map that locks", _share(maps[1][0], 2)),
        ],
    )  # fmt: skip


def _share(grid: Floats, below: int) -> str:
    return f"{np.mean(grid < below):.1%}"


def _smallest(column: Floats) -> str:
    unlocked = np.flatnonzero(column > 1)
    first = unlocked[-1] + 1 if len(unlocked) else 0
    return f"{EPSILONS[first]:.2e}" if first < len(EPSILONS) else "none on the map"


def _span(values: Floats, states: Floats) -> str:
    through = values[states == 0]
    return f"{through.min():.4g} .. {through.max():.4g}" if len(through) else "none on the map"
