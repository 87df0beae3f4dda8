"""Fig. 4: the equilibrium against lam, and the one inference everything else rests on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from chainsim.continuation.spectrum import critical_lam, delta_from_critical_lam, peak_gain, spectrum_curve

from .page import BLUE, GREEN, GREY, ORANGE, RED, Finding, Page, sheet

PAPER = 6.13e-3
# The paper's number has three digits: anything between these is written so.
ROUNDED = (6.125e-3, 6.135e-3)
N = 6


def figure(out: Path) -> Page:
    """Draw Fig. 4 and compare."""
    delta = delta_from_critical_lam(PAPER, N)
    low, high = (delta_from_critical_lam(end, N) for end in ROUNDED)
    lam = np.linspace(0, 0.012, 601)
    modes = 2 * np.pi * np.arange(N) / N
    growth = spectrum_curve(delta, lam[:, None], modes)[..., 0].real
    phi = np.linspace(0, 2 * np.pi, 721)
    limit = spectrum_curve(delta, lam[:, None], phi)[..., 0].real.max(axis=1)

    def paint(axes: Any) -> None:
        left, middle, right = axes[0]
        names = {0: "0°", 1: "60°, 120°", 3: "180°", 4: "240°, 300°"}
        for k, color in ((0, GREY), (1, BLUE), (3, GREEN), (4, ORANGE)):
            left.plot(lam * 1e3, growth[:, k] * 1e3, color=color, label=names[k])
        left.plot(lam * 1e3, limit * 1e3, color=RED, ls="--", label="n → ∞")
        left.axhline(0, color="black", lw=0.6)
        left.axvline(PAPER * 1e3, color="black", lw=0.8, ls=":")
        left.text(PAPER * 1e3 + 0.1, -4.6, "6.13", fontsize=8)
        left.set(title="(a) ring of six: growth of each wave", xlabel="λ · 10³", ylabel="Re μ · 10³", ylim=(-5, 2))
        left.legend(fontsize=8, loc="lower left")
        for value, color in ((0.5 * PAPER, GREY), (critical_lam(delta), RED), (PAPER, BLUE), (1.5 * PAPER, ORANGE)):
            curve = spectrum_curve(delta, value, phi)[:, 0]
            middle.plot(curve.real * 1e3, (curve.imag - 1) * 1e3, color=color, label=f"λ = {value * 1e3:.2f}e-3")
        points = spectrum_curve(delta, PAPER, modes)[:, 0]
        middle.plot(points.real * 1e3, (points.imag - 1) * 1e3, "o", ms=4, color=BLUE)
        middle.axvline(0, color="black", lw=0.6)
        middle.set(title="(b) asymptotic continuous spectrum", xlabel="Re μ · 10³", ylabel="(Im μ - 1) · 10³")
        middle.legend(fontsize=8)
        right.plot(lam * 1e3, peak_gain(delta, lam), color=BLUE)
        right.axhline(1, color="black", lw=0.6)
        right.axvline(critical_lam(delta) * 1e3, color=RED, lw=0.8, ls="--")
        right.set(title="(c) open chain: best gain per stage", xlabel="λ · 10³", ylabel="|z(m)| / |z(m-1)|")

    sheet(out, "fig4", (1, 3), (12, 3.8), paint)
    apart(out, delta)
    return Page(
        "fig4",
        "Fig. 4: stability of the equilibrium",
        "The paper's one number fixes the one unknown: with a ring of six, the critical value is 6.13e-3 exactly "
        f"when delta = {delta:.4e} (Q = {1 / delta:.0f}). That is an inference, since the paper gives no damping; "
        "and it needs the ring, which the paper's equation (2) and its figure 3 do not have. An open chain has no "
        "such instability at all; there the same condition is where the gain per stage passes 1, so that a wave "
        "grows from actuator to actuator. The paper says `the amplitude grows rapidly` past the critical value: "
        "both do that. `fig4_apart.png` has the spectrum of every actuator of the open chain and of every wave of the "
        "ring by itself: an actuator of the open chain stays at -δ/2 whatever λ is.",
        [
            Finding("critical λ, ring of six", f"{critical_lam(delta, N):.4e}", "6.13e-3"),
            Finding("critical λ, n → ∞ (δ + δ²/2)", f"{critical_lam(delta):.4e}"),
            Finding("damping δ (inferred)", f"{delta:.4e}", "not given"),
            Finding("δ by the rounding of 6.13e-3", f"{low:.4e} .. {high:.4e} (Q {1 / high:.1f} .. {1 / low:.1f})"),
            Finding("unstable phase lags just beyond", "60° and 120°", "2π/6 and 2π/3 (states 1 and 2)"),
        ],
    )


def apart(out: Path, delta: float) -> None:
    """Draw what the equilibrium's spectrum is made of, an actuator or a wave each, for λ from 0 to twice critical."""
    lam = np.linspace(0, 2 * PAPER, 201)
    waves = spectrum_curve(delta, lam[:, None], 2 * np.pi * np.arange(N) / N)[..., 0]

    def paint(axes: Any) -> None:
        for m, (above, below) in enumerate(axes.T):
            # The first actuator is fed by no other; each of the rest hangs on one link.
            own = -delta / 2 + 1j * np.sqrt(1 + (lam if m else 0 * lam) - delta**2 / 4)
            for ax, values, name in ((above, own, f"P{m + 1}, open"), (below, waves[:, m], f"{60 * m}°, ring")):
                ax.plot(values.real * 1e3, (values.imag - 1) * 1e3, color=BLUE)
                ax.plot(values[0].real * 1e3, (values[0].imag - 1) * 1e3, "o", ms=3, color=GREY)
                ax.axvline(0, color=RED, lw=0.8, ls="--")
                ax.set(title=name, xlim=(-15, 5), ylim=(-7, 14))
            below.set_xlabel("Re μ · 10³")
        for ax in axes[:, 0]:
            ax.set_ylabel("(Im μ - 1) · 10³")

    sheet(out, "fig4_apart", (2, N), (13, 4.5), paint)
