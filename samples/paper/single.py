"""Fig. 2: one actuator, its linear response at 100 V and the soft spring swept both ways."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, GridIntegrator, Setting, load_device
from chainsim.continuation.path import Path as Branch, continue_branch

from .beam import beam_of
from .page import BLUE, GREY, ORANGE, RED, Finding, Page, sheet

Floats = NDArray[np.float64]

DRIVES = (2e-4, 1e-3, 2e-3)
LOW, HIGH = 0.93, 1.03
SWEEP = 40_000.0  # tau; a fifth of the linewidth goes by in a settling time


def swept(epsilon: float, begin: float, end: float, chain: Chain) -> tuple[Floats, Floats]:
    """Frequency and amplitude while the drive's frequency goes from `begin` to `end`, by the full equations."""
    dtau = 0.1
    tau = np.arange(round(SWEEP / dtau)) * dtau
    rate = (end - begin) / SWEEP
    phase = begin * tau + 0.5 * rate * tau**2
    grid = GridIntegrator(shape=(1, 1), chain_length=1, delta=chain.delta, beta=chain.beta, ring=False, dtau=dtau)
    z = grid.advance(epsilon * np.cos(phase)[:, None, None], np.zeros((1, 1)))[:, 0, 0]
    turn = 600
    rows = len(z) // turn
    top = np.abs(z[: rows * turn]).reshape(rows, turn).max(axis=1)
    return begin + rate * tau[: rows * turn].reshape(rows, turn).mean(axis=1), top


def branch(epsilon: float, chain: Chain) -> Branch:
    """Every periodic answer between HIGH and LOW, stable or not."""
    setting = Setting.of(chain, epsilon=epsilon, lam=0, omega=HIGH)
    return continue_branch(
        chain, setting, parameter="omega", stop=LOW, harmonics=5, step=0.03, max_points=900
    )  # fmt: skip


def figure(out: Path) -> Page:
    """Draw Fig. 2 and compare."""
    device = load_device("paper-6x6")
    chain = Chain(1, device.delta, device.beta)
    branches = {epsilon: branch(epsilon, chain) for epsilon in DRIVES}
    ways = [swept(DRIVES[-1], LOW, HIGH, chain), swept(DRIVES[-1], HIGH, LOW, chain)]
    beam = beam_of(device.f0_hz, device.amplifier.volts)
    hz = np.linspace(125, 141, 4001)
    omega = hz / device.f0_hz
    linear = 1 / np.abs(1 - omega**2 + 1j * device.delta * omega)

    def paint(axes: Any) -> None:
        left, right = axes[0]
        left.semilogy(hz, linear * beam.tip_m * 1e6, color=BLUE)
        left.axvline(133.13, color=GREY, lw=0.8, ls=":")
        left.axhline(beam.length_m * 1e6, color=RED, lw=0.8, ls="--")
        left.text(125.2, beam.length_m * 1.1e6, "the beam's own length", color=RED, fontsize=8)
        left.set(title="(a) linear response, 100 V", xlabel="drive frequency, Hz",
                 ylabel="tip displacement, µm (data-sheet PZT-5A)", ylim=(None, beam.length_m * 2e6))  # fmt: skip
        for epsilon, path in branches.items():
            shown = path.amplitude[:, 0]
            for stable, line in ((True, "-"), (False, ":")):
                part = np.where(path.stable == stable, shown, np.nan)
                right.plot(path.value, part, line, color=GREY, lw=1.2)
            right.annotate(f"ε = {epsilon:g}", (path.value[shown.argmax()], shown.max()), fontsize=8, color="#444444",
                           xytext=(4, 4), textcoords="offset points")  # fmt: skip
        for (w, top), color, text in zip(ways, (BLUE, ORANGE), ("swept up", "swept down"), strict=True):
            right.plot(w, top, color=color, lw=1.4, label=text)
        right.set(title="(b) soft spring, both sweep directions", xlabel="ω", ylabel="amplitude z",
                  xlim=(LOW, 1.02), ylim=(0, None))  # fmt: skip
        right.legend(loc="upper right")

    sheet(out, "fig2", (1, 2), (10, 4), paint)
    strong = branches[DRIVES[-1]]
    peak = hz[linear.argmax()]
    half = hz[linear > linear.max() / math.sqrt(2)]
    return Page(
        "fig2",
        "Fig. 2: one actuator",
        "The resonance is the paper's by construction (its f0 is ours). The width is not in the paper: it follows "
        "from the damping inferred from Fig. 4. Micrometres follow from the paper's layers: a uniform cantilever of "
        "them with its first mode at 133.13 Hz has one length, and 100 V from top to bottom bend it so far. Assumed "
        "for that, from data sheets, are PZT-5A's 61 GPa, 7750 kg/m³ and d31 = -171 pm/V and Kapton's 2.5 GPa and "
        "1420 kg/m³, copper left out. At resonance the linear curve comes near the beam's own length, so no beam "
        "follows it: it is a curve without its nonlinearity, as the paper says of its own, or the damping of its "
        "finite elements, which it does not give, is another than that of its chains. The static deflection is what "
        "our profiles assume (a force of 0.2 in units of 1 mm). The soft spring bends "
        "to lower frequencies and jumps, up when swept up and down when swept down, as the paper's Fig. 2b; the "
        "paper gives no numbers there, and the full equations, swept at a finite speed, fall "
        "off just past the folds found by continuation.",
        [
            Finding("resonance, Hz", f"{peak:.2f}", "133.13 (eigenmode), ~133 (response)"),
            Finding("length of the beam, mm", f"{1e3 * beam.length_m:.1f}", "not given"),
            Finding("static tip displacement at 100 V, µm", f"{1e6 * beam.tip_m:.0f}"),
            Finding("the same at resonance, linear, mm", f"{1e3 * beam.tip_m * linear.max():.0f}"),
            Finding("width at -3 dB, Hz", f"{half.max() - half.min():.2f}"),
            Finding(
                f"jump when swept up, ε = {DRIVES[-1]:g}", f"ω = {_jump(*ways[0]):.4f} (fold {strong.jump_up:.4f})"
            ),
            Finding(
                f"jump when swept down, ε = {DRIVES[-1]:g}", f"ω = {_jump(*ways[1]):.4f} (fold {strong.jump_down:.4f})"
            ),
            Finding("largest amplitude before the jump down", f"{strong.amplitude.max():.3f} of the hilltop"),
        ],
    )


def _jump(omega: Floats, top: Floats) -> float:
    """Where a sweep changes fastest."""
    at = int(np.abs(np.diff(top)).argmax())
    return float(omega[at])
