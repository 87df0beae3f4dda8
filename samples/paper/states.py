"""Fig. 5: the three phase states, with their Floquet multipliers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Closure, Setting, balance_near, solve
from chainsim.averaging.envelope import follow
from chainsim.continuation.locking import locking
from chainsim.continuation.path import continue_branch
from chainsim.continuation.spectrum import delta_from_critical_lam

from .page import BLUE, GREY, ORANGE, RED, Finding, Page, sheet

Complexes = NDArray[np.complex128]

LAM = 6.131e-3
# Amplitudes at which the waves of 60 and 120 degrees sit on omega = 1: 3/4 a^2 = lam (1 - cos phi).
EPSILON_A, EPSILON_B, EPSILON_C = 3.91e-4, 1.175e-3, 6e-4


@dataclass(frozen=True)
class State:
    """A state: its phasors (n,) where it is locked, and its multipliers."""

    name: str
    epsilon: float
    phasor: Complexes
    multipliers: Complexes

    @property
    def lags(self) -> NDArray[np.float64]:
        """Phase lags in degrees."""
        return -np.degrees(np.angle(self.phasor[1:] / self.phasor[:-1]))


def open_state(name: str, epsilon: float, delta: float) -> State:
    """The state an open chain reaches from rest."""
    chain = Chain(6, delta, -1.0)
    found = solve(chain, Setting.of(chain, epsilon=epsilon, lam=LAM, omega=1.0), tol=1e-9)
    return State(name, epsilon, found.phasor[0], found.multipliers[0].ravel())


def ring_orbit(epsilon: float, delta: float) -> State:
    """The periodic orbit of the ring at `epsilon`, stable or not, followed down from a drive at which it locks."""
    chain = Chain(6, delta, -1.0, Closure.RING)
    strong = Setting.of(chain, epsilon=3e-3, lam=LAM, omega=1.0)
    begin = solve(chain, strong, tol=1e-8).phasor[0]
    path = continue_branch(
        chain, strong, parameter="epsilon", stop=epsilon, harmonics=3, step=0.05, max_points=200, start=begin
    )  # fmt: skip
    here = Setting.of(chain, epsilon=epsilon, lam=LAM, omega=1.0)
    found = balance_near(chain, here, path.phasor[-1:], tol=1e-9)
    return State("(c)", epsilon, found.phasor[0], found.multipliers[0].ravel())


def figure(out: Path) -> Page:
    """Draw Fig. 5 and compare."""
    delta = delta_from_critical_lam(6.13e-3, 6)
    a, b = open_state("(a)", EPSILON_A, delta), open_state("(b)", EPSILON_B, delta)
    c = ring_orbit(EPSILON_C, delta)
    ring = Chain(6, delta, -1.0, Closure.RING)
    drives = np.array([EPSILON_A, EPSILON_B, EPSILON_C, 2e-3, 3e-3])
    verdict = locking(ring, Setting.of(ring, epsilon=drives, lam=LAM, omega=1.0), start="rest")
    tau = np.linspace(0, 40_000, 4001)
    walk = follow(ring, Setting.of(ring, epsilon=EPSILON_C, lam=LAM, omega=1.0), tau, tol=1e-4).phasor[:, 0]

    def paint(axes: Any) -> None:
        _paint_states(axes[0], (a, b), tau, walk)
        for ax, state in zip(axes[1], (a, b, c), strict=True):
            circle = np.exp(1j * np.linspace(0, 2 * np.pi, 361))
            ax.plot(circle.real, circle.imag, color=GREY, lw=0.8)
            out_of = np.abs(state.multipliers) > 1
            ax.plot(state.multipliers[~out_of].real, state.multipliers[~out_of].imag, "o", ms=4, color=BLUE)
            ax.plot(state.multipliers[out_of].real, state.multipliers[out_of].imag, "o", ms=4, color=RED)
            ax.set(title=f"multipliers of {state.name}, largest {np.abs(state.multipliers).max():.4f}", aspect="equal",
                   xlim=(0.95, 1.02), ylim=(-0.06, 0.06), xlabel="Re", ylabel="Im")  # fmt: skip

    sheet(out, "fig5", (2, 3), (12, 7), paint)
    return Page("fig5", "Fig. 5: three phase states at ω = 1, λ = 6.131e-3", _verdict(), _findings(a, b, c, verdict))


def _paint_states(axes: Any, states: tuple[State, State], tau: Any, walk: Complexes) -> None:
    from matplotlib import colormaps

    colors = colormaps["viridis"](np.linspace(0, 0.9, 6))
    cycle = np.linspace(0, 4 * np.pi, 400)
    for ax, state, degrees in zip(axes[:2], states, (60, 120), strict=True):
        for m in range(6):
            wave = (state.phasor[m] * np.exp(1j * cycle)).real
            ax.plot(cycle / (2 * np.pi), wave, "-" if m < 3 else "--", color=colors[m], label=f"P{m + 1}")
        lags = ", ".join(f"{lag:.0f}" for lag in state.lags)
        chosen = f"{state.name} open chain, ε = {state.epsilon:g}, chosen for {degrees}° at ω = 1"
        ax.set(title=f"{chosen}\nlags {lags}°", xlabel="cycles", ylabel="z")
    axes[0].set_ylim(-0.095, None)
    axes[0].legend(ncols=6, fontsize=7, loc="lower center", handlelength=1.2, columnspacing=0.8)
    lag = -np.degrees(np.angle(walk[:, 1:] * walk[:, :-1].conj()))
    for m in range(5):
        axes[2].plot(tau / (2 * np.pi), lag[:, m] % 360, ".", ms=1, color=colors[m + 1])
    axes[2].set(title=f"(c) ring, ε = {EPSILON_C:g}\nlags that never settle", xlabel="cycles", ylabel="lag, degrees",
                ylim=(0, 360), yticks=[0, 60, 120, 180, 240, 300, 360])  # fmt: skip
    for angle in (60, 120):
        axes[2].axhline(angle, color=ORANGE, lw=0.8, ls="--")


def _verdict() -> str:
    return (
        "All three states exist at the paper's setting, but not in one system. In the open chain of equation (2) "
        "the lags of 60 and 120 degrees are the two unit-gain waves asin(δ/λ), at the drives where the softening "
        "brings them to ω = 1. The 120 degree wave attracts along the chain; the 60 degree wave repels and drifts "
        "a few degrees over six. Nothing in an open chain fails to lock here. The state with varying phases "
        "belongs to the ring, as does the critical λ: at rest it loses stability at 6.13e-3, and at small drive "
        "its own waves beat with the drive. The paper's pair on the unit circle is presumably that of the drive "
        "written as an oscillator, since a driven chain has "
        "none. For (a) and (b) all multipliers lie inside, for (c) "
        "pairs of the ring's periodic orbit lie outside, as the paper reports for its case (c), though near 1 and "
        "not on the imaginary axis. In the ring itself neither 60 degrees at (a)'s drive nor 120 at (b)'s is "
        "locked to the drive; it locks from about ε = 1.4e-3, with lags that tend to 120 degrees along it."
    )


def _findings(a: State, b: State, c: State, ring: Any) -> list[Finding]:
    def spoken(state: State) -> str:
        return f"{state.lags.min():.1f} .. {state.lags.max():.1f}°"

    rows = [
        Finding(f"(a) lags, open, ε = {a.epsilon:g}", spoken(a), "60° (2π/6)"),
        Finding(f"(b) lags, open, ε = {b.epsilon:g}", spoken(b), "120° (2π/3), P1-P4 in phase"),
        Finding("(b) phase of P4 less P1", f"{np.degrees(np.angle(b.phasor[3] / b.phasor[0])):.1f}°", "0°"),
        Finding("(a) largest multiplier", f"{np.abs(a.multipliers).max():.4f}", "inside"),
        Finding("(b) largest multiplier", f"{np.abs(b.multipliers).max():.4f}", "inside"),
        Finding("(c) largest multiplier, ring", f"{np.abs(c.multipliers).max():.4f}", "one pair outside"),
    ]
    for epsilon, locked, beat, steps in zip(
        (EPSILON_A, EPSILON_B, EPSILON_C, 2e-3, 3e-3), ring.locked, ring.beat, ring.phase_step, strict=True
    ):
        said = f"locked, lags {-np.degrees(steps[-1]):.1f} .. {-np.degrees(steps[0]):.1f}°"
        if not locked:
            said = f"not locked, beats at {abs(beat) * 133.13:.2f} Hz"
        rows.append(Finding(f"ring from rest, ε = {epsilon:g}", said))
    return rows
