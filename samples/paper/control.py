"""The paper's question: do initial conditions, boundary, inhomogeneity or symmetry breaking control the pattern?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Closure, Outcome, Setting, solve
from chainsim.averaging.settle import reached
from chainsim.continuation.spectrum import delta_from_critical_lam

from .page import BLUE, GREEN, GREY, ORANGE, RED, Finding, Page, sheet
from .states import EPSILON_B, LAM

Floats = NDArray[np.float64]

N = 6
DRAWS = 120
SEED = 20240
WANTED = ((1, 1, 0.1, 0.1, 1, 1), (0.1, 1, 0.1, 1, 0.1, 1), (1, 0.1, 1, 1, 0.1, 1))
LEVEL = 0.02
OMEGA_2 = 1.12
# Below resonance a strong drive leaves two stable answers for the first actuator; here each of six may have two.
MULTISTABLE = {"epsilon": 2e-3, "lam": 0.01, "omega": 0.98}


@dataclass(frozen=True)
class Trial:
    """Amplitude profiles (K, n) that one factor led to, and how many distinct ones there are."""

    name: str
    profiles: Floats

    @property
    def distinct(self) -> int:
        """Profiles that differ by more than 1 % of the largest amplitude."""
        kept: list[Floats] = []
        top = self.profiles.max()
        for row in self.profiles:
            if all(np.abs(row - other).max() > 0.01 * top for other in kept):
                kept.append(row)
        return len(kept)


def starts(delta: float, rng: np.random.Generator, values: dict[str, float], name: str) -> Trial:
    """The end states of an open chain from random amplitudes and phases."""
    chain = Chain(N, delta, -1.0)
    drive = np.full(DRAWS, values["epsilon"])
    setting = Setting.of(chain, epsilon=drive, lam=values["lam"], omega=values["omega"])
    size = 0.35 * rng.random((DRAWS, N)) * np.exp(2j * np.pi * rng.random((DRAWS, N)))
    arrival = reached(chain, setting, start=size)
    return Trial(name, np.abs(arrival.phasor[arrival.outcome == Outcome.OK]))


def boundary(delta: float, epsilons: Floats) -> tuple[Floats, Floats]:
    """Amplitudes (K, n) of the open chain and of the ring at the same drives; NaN where the ring does not lock."""
    found = []
    for closure in (Closure.OPEN, Closure.RING):
        chain = Chain(N, delta, -1.0, closure)
        arrival = reached(chain, Setting.of(chain, epsilon=epsilons, lam=LAM, omega=1.0), start="rest")
        found.append(np.abs(arrival.phasor))
    return found[0], found[1]


def inhomogeneous(delta: float, spread: float, rng: np.random.Generator) -> Trial:
    """Chains whose natural frequencies differ by `spread` (one standard deviation), at the drive of state (b)."""
    rows = []
    for _ in range(DRAWS):
        chain = Chain.of(N, delta=delta, beta=-1.0, stiffness=(1 + spread * rng.standard_normal(N)) ** 2)
        found = solve(chain, Setting.of(chain, epsilon=EPSILON_B, lam=LAM, omega=1.0), tol=1e-4)
        if found.outcome[0] == Outcome.OK:
            rows.append(np.abs(found.phasor[0]))
    return Trial(f"natural frequencies ± {spread:.1%}", np.array(rows))


def random_links(delta: float, rng: np.random.Generator) -> Trial:
    """Equal actuators, but every link drawn on its own between 0 and 3 lam."""
    chain = Chain(N, delta, -1.0)
    setting = Setting.of(chain, epsilon=EPSILON_B, lam=3 * LAM * rng.random((DRAWS, N - 1)), omega=1.0)
    found = reached(chain, setting, start="rest")
    return Trial("λ of every link random", np.abs(found.phasor[found.outcome == Outcome.OK]))


def chosen_links(delta: float, profile: tuple[float, ...]) -> Floats:
    """The profile reached from rest with the links that the closed form asks for, over the wanted level; shape (n,).

    lam is the positive root of (a'^2 - a^2) lam^2 - 2 kappa a^2 lam - a^2 (kappa^2 + delta^2 omega^2) = 0, with a' the
    amplitude before and kappa = 1 - omega^2 - 3/4 a^2.
    """
    omega, amplitude = float(np.sqrt(OMEGA_2)), LEVEL * np.array(profile)
    kappa = 1 - OMEGA_2 - 0.75 * amplitude**2
    g2 = (delta * omega) ** 2
    links = []
    for before, a, k in zip(amplitude[:-1], amplitude[1:], kappa[1:], strict=True):
        roots = np.roots([before**2 - a**2, -2 * k * a**2, -(a**2) * (k * k + g2)])
        links.append(float(min(r.real for r in roots if abs(r.imag) < 1e-12 and r.real > 0)))
    epsilon = amplitude[0] * float(np.hypot(kappa[0], np.sqrt(g2)))
    chain = Chain(N, delta, -1.0)
    setting = Setting.of(chain, epsilon=epsilon, lam=np.array(links), omega=omega)
    found = solve(chain, setting, tol=1e-6)
    over_level: Floats = np.abs(found.phasor[0]) / LEVEL
    return over_level


def figure(out: Path) -> Page:
    """Run the four experiments and draw them."""
    delta, rng = delta_from_critical_lam(6.13e-3, 6), np.random.default_rng(SEED)
    one = starts(delta, rng, {"epsilon": EPSILON_B, "lam": LAM, "omega": 1.0}, "ω = 1")
    many = starts(delta, rng, MULTISTABLE, "ω = 0.98, stronger drive")
    epsilons = np.array([2e-4, 6e-4, 1.2e-3, 2e-3, 4e-3])
    open_, ring = boundary(delta, epsilons)
    spreads = [inhomogeneous(delta, spread, rng) for spread in (1e-3, 1e-2)]
    links = random_links(delta, rng)
    made = [chosen_links(delta, profile) for profile in WANTED]

    def paint(axes: Any) -> None:
        place = np.arange(1, N + 1)
        (a, b, c), (d, e, f) = axes
        for ax, trial, color in ((a, one, BLUE), (b, many, BLUE), (d, spreads[0], ORANGE), (e, links, GREEN)):
            ax.plot(place, trial.profiles.T, color=color, alpha=0.25, lw=1)
        d.plot(place, spreads[1].profiles.T, color=RED, alpha=0.12, lw=1)
        a.set(title=f"initial conditions, ω = 1: {DRAWS} starts, {one.distinct} end")
        b.set(title=f"initial conditions, ω = 0.98: {DRAWS} starts, {many.distinct} ends")
        d.set(title="inhomogeneity: f0 ± 0.1 % (orange), ± 1 % (red)")
        e.set(title="symmetry breaking: every link random")
        for k, epsilon in enumerate(epsilons):
            c.plot(place, open_[k], color=GREY, lw=1)
            c.plot(place, ring[k], color=BLUE, lw=1.4, label=f"ε = {epsilon:g}")
        locked = int(np.isfinite(ring[:, 0]).sum())
        c.set(title=f"boundary: open (grey) locks 5 of 5, ring (blue) {locked}")
        for k, (wanted, got) in enumerate(zip(WANTED, made, strict=True)):
            f.bar(place + 0.26 * (k - 1), got, width=0.24, color=(BLUE, ORANGE, GREEN)[k])
            f.plot(place + 0.26 * (k - 1), wanted, "_", color="black", ms=9)
        f.set(title="symmetry breaking: every link chosen (marks: wanted)")
        for ax in axes.flat:
            ax.set(xlabel="actuator", ylim=(0, 1.08 * ax.get_ylim()[1]))
        a.set(ylabel="amplitude z")
        d.set(ylabel="amplitude z")

    sheet(out, "control", (2, 3), (13.5, 7.2), paint)
    error = max(float(np.abs(got - np.array(wanted)).max()) for got, wanted in zip(made, WANTED, strict=True))
    return Page("control", "The paper's question: what controls the pattern?", _verdict(), _findings(
        one, many, spreads, links, ring, error))  # fmt: skip


def _verdict() -> str:
    return (
        "Symmetry breaking controls the pattern. With every link chosen by the closed form, any of these on/off "
        "profiles is reached from rest; random links give as many patterns as draws. Initial conditions control "
        "nothing at ω = 1, where an open chain has one answer; below resonance, where the soft spring has several, "
        "they choose among a finite list, so they must be planned (how the drive is raised) but are no knob. The "
        "boundary decides whether the chain locks at all, not which profile it takes: along a locked ring the "
        "profile nears the open chain's. Inhomogeneity is a symmetry breaking nobody chose: 1 % in the natural "
        "frequencies, twice the resonance's width, spoils the profile altogether. All this is for the inferred "
        "damping and an assumed length scale of z; the paper asks the question and argues for symmetry breaking "
        "without an experiment."
    )


def _findings(
    one: Trial, many: Trial, spreads: list[Trial], links: Trial, ring: Floats, error: float
) -> list[Finding]:  # fmt: skip
    def wobble(trial: Trial) -> str:
        return f"{100 * np.mean(trial.profiles.std(axis=0) / trial.profiles.mean(axis=0)):.0f} % of an amplitude"

    return [
        Finding(f"end states of {DRAWS} random starts, ω = 1", str(one.distinct), "assumed z = z' = 0"),
        Finding("the same at ω = 0.98", str(many.distinct)),
        Finding("drives of five at which the ring locks", str(int(np.isfinite(ring[:, 0]).sum())), "can be omitted"),
        Finding("spread of profiles, f0 ± 0.1 %", wobble(spreads[0]), "assumed homogeneous"),
        Finding("spread of profiles, f0 ± 1 %", wobble(spreads[1]), "assumed homogeneous"),
        Finding("spread of profiles, random links", wobble(links), "`the only remaining factor`"),
        Finding("largest error of three chosen on/off profiles", f"{error:.3f} of full scale"),
    ]
