"""What else a real actuator does, each off (None) unless asked for; only the integrator in `effects.ode` has it all.

The electric force e_m (drive, link and bias of an actuator) becomes force through hysteresis, then creep:

    f = H[e] + sum_i c_i
    z'' + delta z' + z + beta z^3 = f + preload
    q_j'' + delta_j q_j' + Omega_j^2 q_j = g_j f

and the next actuator senses the tip, z + sum_j q_j. All times are in tau, all forces in units of epsilon.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from ..errors import ChainError

__all__ = [
    "AmplifierDynamics",
    "BoucWen",
    "Creep",
    "Mode",
    "Play",
    "Terms",
    "TermsError",
    "Tone",
    "bending_modes",
    "modulated",
]


class TermsError(ChainError, ValueError):
    """A term has a value it cannot have.

    Examples: a play radius below 0; a creep that ends before it starts; an amplifier without bandwidth.
    """


@dataclass(frozen=True)
class BoucWen:
    """Hysteresis as the piezo's Bouc-Wen model (Low and Guo, J. Microelectromech. Syst. 4, 1995): H[e] = e - h with

    ``h' = gain e' - loading |e'| h - unloading e' |h|``. The loop saturates at h = gain/(loading + unloading).
    """

    gain: float
    loading: float
    unloading: float

    def __post_init__(self) -> None:
        _finite("hysteresis", self.gain, self.loading, self.unloading)
        if self.loading < abs(self.unloading):
            raise TermsError(f"hysteresis.loading: expected at least |unloading| = {abs(self.unloading)}, "
                             f"got {self.loading}; h would grow without bound")  # fmt: skip


@dataclass(frozen=True)
class Play:
    """Hysteresis as a Prandtl-Ishlinskii sum of play operators: H[e] = base e + sum_i weight_i P_i[e].

    P_i keeps its value while e stays within radius_i of it and is pushed along by e at that distance.
    """

    radius: tuple[float, ...]
    weight: tuple[float, ...]
    base: float

    def __post_init__(self) -> None:
        _finite("hysteresis", self.base, *self.radius, *self.weight)
        if len(self.radius) != len(self.weight) or not self.radius:
            raise TermsError(f"hysteresis.weight: expected one weight for each of {len(self.radius)} radii")
        if min(self.radius) < 0:
            raise TermsError(f"hysteresis.radius: expected numbers >= 0, got {min(self.radius)}")


@dataclass(frozen=True)
class Creep:
    """Logarithmic creep: under a constant force the response grows by `per_decade` of itself in every decade of time.

    Relaxations c_i' = (g f - c_i)/T_i with `each` times to a decade, from `first` to `last` in tau: between these the
    sum grows as a logarithm, g = per_decade/each.
    """

    per_decade: float
    first: float
    last: float
    each: int = 2

    def __post_init__(self) -> None:
        _finite("creep", self.per_decade, self.first, self.last)
        if not 0 < self.first < self.last:
            raise TermsError(f"creep.last: expected 0 < first < last, got {self.first} and {self.last}")
        if self.each < 1:
            raise TermsError(f"creep.each: expected 1 or more, got {self.each}")

    @property
    def times(self) -> tuple[float, ...]:
        """The relaxation times in tau."""
        count = round(self.each * math.log10(self.last / self.first)) + 1
        return tuple(self.first * 10 ** (k / self.each) for k in range(count))


@dataclass(frozen=True)
class Mode:
    """A higher bending mode: `omega` its frequency over f0, `delta` its damping, `gain` its share of the force."""

    omega: float
    delta: float
    gain: float

    def __post_init__(self) -> None:
        _finite("modes", self.omega, self.delta, self.gain)
        if not (self.omega > 0 and self.delta >= 0):
            raise TermsError(f"modes: expected omega > 0 and delta >= 0, got {self.omega} and {self.delta}")


@dataclass(frozen=True)
class AmplifierDynamics:
    """A first-order amplifier of the drive: ``u' = bandwidth (wanted - u)``, at most `slew` fast, cut off at `limit`.

    bandwidth : per tau (f_3dB/f0). slew : force per tau. limit : force.
    """

    bandwidth: float
    slew: float = math.inf
    limit: float = math.inf

    def __post_init__(self) -> None:
        if not (math.isfinite(self.bandwidth) and self.bandwidth > 0):
            raise TermsError(f"amplifier.bandwidth: expected a finite number > 0, got {self.bandwidth}")
        if not (self.slew > 0 and self.limit > 0):
            raise TermsError(f"amplifier: expected slew and limit > 0, got {self.slew} and {self.limit}")


@dataclass(frozen=True)
class Tone:
    """One tone of the drive: epsilon cos(omega tau + phase)."""

    epsilon: float
    omega: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        _finite("tones", self.epsilon, self.omega, self.phase)


@dataclass(frozen=True)
class Terms:
    """Which terms are on; None is off. `tones` replace the setting's one tone."""

    hysteresis: BoucWen | Play | None = None
    creep: Creep | None = None
    modes: tuple[Mode, ...] | None = None
    amplifier: AmplifierDynamics | None = None
    tones: tuple[Tone, ...] | None = None


def modulated(carrier: Tone, *, depth: float, omega: float) -> tuple[Tone, Tone, Tone]:
    """The three tones of an amplitude-modulated carrier, (1 + depth cos(omega tau)) times `carrier`."""
    _finite("modulation", depth, omega)
    side = 0.5 * depth * carrier.epsilon
    return (
        carrier,
        Tone(side, carrier.omega - omega, carrier.phase),
        Tone(side, carrier.omega + omega, carrier.phase),
    )


def bending_modes(f0_hz: float, others_hz: Iterable[float], *, delta: float) -> tuple[Mode, ...]:
    """The second and further bending modes of a cantilever bent by a moment along its length, as a bimorph is.

    Parameters
    ----------
    f0_hz, others_hz : natural frequencies, as the paper's finite elements give them (133.13; 661.03, 1258.3).
    delta : damping of the first; the others are given the same Q.

    The shares of the force are those of a uniform Euler-Bernoulli beam, phi(L) phi'(L) over that of the first with all
    phi of equal norm: an assumption, since the paper gives only the frequencies.
    """
    first = _end_slope(0)
    return tuple(
        Mode(hz / f0_hz, delta * hz / f0_hz, _end_slope(k + 1) / first) for k, hz in enumerate(others_hz)
    )  # fmt: skip


def _end_slope(k: int) -> float:
    """L phi_k'(L)/phi_k(L) of a cantilever; phi_k(L) = +-2 for all of them."""
    root = 1.875104068711961 if k == 0 else (k + 0.5) * math.pi
    for _ in range(20):
        f = math.cos(root) + 1 / math.cosh(root)
        root -= f / (-math.sin(root) - math.tanh(root) / math.cosh(root))
    sigma = (math.cosh(root) + math.cos(root)) / (math.sinh(root) + math.sin(root))
    slope = math.sinh(root) + math.sin(root) - sigma * (math.cosh(root) - math.cos(root))
    value = math.cosh(root) - math.cos(root) - sigma * (math.sinh(root) - math.sin(root))
    return root * slope / value


def _finite(name: str, *values: float) -> None:
    for value in values:
        if not math.isfinite(value):
            raise TermsError(f"{name}: expected finite numbers, got {value}")
