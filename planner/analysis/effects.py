"""What leaving a term out of the model does to a standing chain, to first order in the term.

Every term is a small force on each actuator of a motion that is known. The linearised equations about that motion
(one harmonic, theory.md section 2.1) say how far it moves; links carry what happens at one actuator to those behind it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chainsim import ActuatorSpread, Chain, HigherMode, Setting, Surroundings

from ..operating_point import OperatingPoint, PointTone, setting_of

__all__ = ["Linearisation", "pattern_error"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# First harmonic of a square wave of height 1: the most a force that saturates at 1 can have.
SQUARE = 4 / math.pi
DECADES, RELAXATIONS_A_DECADE = 3, 2


@dataclass(frozen=True)
class Linearisation:
    """The equations of a chain about an operating point: what small forces do to its motion.

    Attributes
    ----------
    chain : what was built.
    point : what it is driven at, and its motion.
    """

    chain: Chain
    point: OperatingPoint

    @cached_property
    def lam(self) -> Floats:
        """Links, float64, shape (n,); the first closes a ring and is 0 otherwise."""
        return np.asarray(self._setting.lam[0])

    @cached_property
    def _setting(self) -> Setting:
        return setting_of(self.chain, [self.point])

    @cached_property
    def _links(self) -> Floats:
        """What the links add to the matrix of stiffness, float64, shape (n, n)."""
        down = None if self.chain.rows == 1 else self._setting.lam_y
        return np.asarray(self.chain.law.matrix(self._setting.lam, down)[0])

    def along(self, motion: Complexes) -> Complexes:
        """What the links pull each actuator with under a motion; complex128, shape (n,)."""
        return np.asarray(-(self._links @ motion))

    @cached_property
    def lines(self) -> tuple[PointTone, ...]:
        """Of its vibration, the first is that at the point's own frequency; one of omega 0 for a deflection."""
        if not self.moving:
            return (PointTone(0.0, 0j, self.point.mean.astype(np.complex128)),)
        return tuple(tone for tone in self.point.every_tone if not tone.place)

    @cached_property
    def moving(self) -> bool:
        """Whether it vibrates."""
        return self.point.moving

    @cached_property
    def scale(self) -> float:
        """Largest amplitude that is felt."""
        return float(self.size.max())

    @cached_property
    def size(self) -> Floats:
        """Largest amplitude of each actuator, all lines in step; float64, shape (n,)."""
        return np.asarray(np.sum([np.abs(line.phasor) for line in self.lines], axis=0))

    def driven(self, line: PointTone) -> Complexes:
        """Force of the drives at the line's frequency on each actuator; complex128, shape (n,)."""
        force = np.zeros(self.chain.n, dtype=np.complex128)
        for tone in self.point.every_tone:
            if tone.omega == line.omega:
                force[tone.place] += tone.epsilon
        return force

    def electric(self, line: PointTone) -> Complexes:
        """Force through the piezo of each actuator: drive, bias, and what its link brings; complex128, shape (n,)."""
        force = self.along(line.phasor) + self.driven(line)
        return force + (self.point.bias if line.omega == 0 else 0.0)

    def impedance(self, omega: float, stiffening: Floats | float = 0.0) -> Complexes:
        """Linear equations ``impedance @ A = force`` at a frequency, links in; complex128, shape (n, n)."""
        chain = self.chain
        own = chain.stiffness + stiffening - omega**2 + 1j * chain.deltas * omega
        return np.asarray(np.diag(np.broadcast_to(own, (chain.n,)).astype(np.complex128)) + self._links)

    def moved(self, line: PointTone, force: Complexes) -> Complexes:
        """How a line changes under further forces of shape (n,) or (n, k), to first order; complex128, same shape."""
        beta, size2 = self.chain.betas, self.size**2
        if not self.moving:
            return np.asarray(np.linalg.solve(self.impedance(0.0, 3 * beta * size2), force))
        others = sum((np.abs(other.phasor) ** 2 for other in self.lines if other is not line), np.zeros_like(size2))
        straight = self.impedance(line.omega, 1.5 * beta * (np.abs(line.phasor) ** 2 + others))
        mirrored = np.diag(0.75 * beta * line.phasor**2)
        both, away = straight + mirrored, straight - mirrored
        matrix = np.block([[both.real, -away.imag], [both.imag, away.real]])
        answer = np.linalg.solve(matrix, np.concatenate([force.real, force.imag]))
        return np.asarray(answer[: self.chain.n] + 1j * answer[self.chain.n :])

    def without_cubic(self) -> list[Complexes]:
        """What each line would be in a linear chain, less what it is."""
        found = []
        for line in self.lines:
            force = self.point.bias.astype(np.complex128) if line.omega == 0 else np.zeros(self.chain.n, np.complex128)
            force[0] += line.epsilon
            found.append(np.linalg.solve(self.impedance(line.omega), force) - line.phasor)
        return found

    def without_third(self) -> list[Complexes]:
        """What the third harmonics, which the cubic term makes, do back to each line."""
        if not self.moving:
            return [np.zeros(self.chain.n, np.complex128)]
        beta, found = self.chain.betas, []
        for line in self.lines:
            # Of several lines the worst: all in step.
            motion = line.phasor if len(self.lines) == 1 else self.size + 0j
            third = np.linalg.solve(
                self.impedance(3 * line.omega, 1.5 * beta * self.size**2), -0.25 * beta * motion**3
            )  # fmt: skip
            found.append(self.moved(line, 0.75 * beta * np.conj(motion) ** 2 * third))
        return found

    def pressed(self, around: Surroundings) -> list[Complexes]:
        """What a fingertip does: a constant force on the first actuator, stiffness and damping on every one."""
        stiff, damping = around.touch_stiffness, around.touch_damping
        held = [self.moved(line, -(stiff + 1j * damping * line.omega) * line.phasor) for line in self.lines]
        return [one + other for one, other in zip(self._preloaded(around.preload), held, strict=True)]

    def _preloaded(self, preload: float) -> list[Complexes]:
        push = np.zeros(self.chain.n, np.complex128)
        push[0] = preload
        if not self.moving:
            return [self.moved(self.lines[0], push)]
        beta = self.chain.betas
        mean = np.linalg.solve(self.impedance(0.0, 1.5 * beta * self.size**2), push).real
        found = []
        for line in self.lines:
            second = np.linalg.solve(self.impedance(2 * line.omega), -1.5 * beta * mean * line.phasor**2)
            force = 3 * beta * (mean**2 * line.phasor + mean * np.conj(line.phasor) * second)
            found.append(self.moved(line, -force))
        return found

    def with_hysteresis(self, around: Surroundings) -> list[Complexes]:
        """What the loop of the piezo takes from every force through it; the most it can take, in phase."""
        found = []
        for line in self.lines:
            force = self.electric(line)
            size = np.maximum(np.abs(force), 1e-300)
            share = np.minimum(around.hysteresis, SQUARE * around.largest_loop / size)
            found.append(self.moved(line, -share * force))
        return found

    def creeping(self, around: Surroundings, tau_per_s: float, held_s: float) -> list[Complexes]:
        """What creep adds to every force, after `held_s` for a constant one."""
        exponents = np.arange(DECADES * RELAXATIONS_A_DECADE + 1) / RELAXATIONS_A_DECADE
        times_s, gain = around.creep_first_s * 10**exponents, around.creep_per_decade / RELAXATIONS_A_DECADE
        found = []
        for line in self.lines:
            grown = 1 / (1 + 1j * line.omega * times_s * tau_per_s) if line.omega else 1 - np.exp(-held_s / times_s)
            found.append(self.moved(line, gain * complex(grown.sum()) * self.electric(line)))
        return found

    def with_modes(self, modes: tuple[HigherMode, ...]) -> list[Complexes]:
        """What higher modes add to the tips, and through the links to what follows."""
        found = []
        for line in self.lines:
            pliant = sum(one.gain / (one.omega**2 - line.omega**2 + 1j * one.delta * line.omega) for one in modes)
            tip = pliant * self.electric(line)
            found.append(tip + self.moved(line, self.along(tip)))
        return found

    def without_down(self) -> list[Complexes]:
        """What a grid's links downwards do."""
        if self.chain.rows == 1:
            return []
        down = np.asarray(self._setting.lam_y)[0]
        pulls = [down * (np.roll(line.phasor, self.chain.cols) - line.phasor) for line in self.lines]
        return [self.moved(line, -pull) for line, pull in zip(self.lines, pulls, strict=True)]

    def pulled(self, row_lam: float, above: Linearisation) -> list[Complexes]:
        """What links from the chain above do; lines of other frequencies than its own only stiffen it.

        A chain at rest is moved along by every line of the one above; all in step.
        """
        if self.scale == 0:
            moved = (self._moved_along(row_lam, line) for line in above.lines)
            return [np.asarray(sum(moved, np.zeros(self.chain.n)) + 0j)]
        found = []
        for line in self.lines:
            same = [other.phasor for other in above.lines if other.omega == line.omega]
            found.append(self.moved(line, row_lam * ((same[0] if same else 0.0) - line.phasor)))
        return found

    def _moved_along(self, row_lam: float, line: PointTone) -> Floats:
        return np.asarray(np.abs(np.linalg.solve(self.impedance(line.omega, row_lam), row_lam * line.phasor)))

    def through_amplifier(self, bandwidth: float, slew: float) -> list[Complexes]:
        """What an amplifier of that bandwidth (over f0) and a drive at `slew` of its fastest change do."""
        found = []
        for line in self.lines:
            factor = (1 / (1 + 1j * line.omega / bandwidth)) / max(1.0, slew)
            found.append(self.moved(line, (factor - 1) * self.driven(line)))
        return found

    def scattered(self, spread: ActuatorSpread, phased: NDArray[np.bool_]) -> Floats:
        """Standard deviation of each actuator's amplitude, or of its phasor where `phased`; float64, shape (n,)."""
        total, chain = np.zeros(self.chain.n), self.chain
        for line in self.lines:
            cubic = (0.75 if line.omega else 1.0) * chain.betas * np.abs(line.phasor) ** 2 * line.phasor
            causes = (
                2 * spread.frequency * chain.stiffness * line.phasor,
                1j * spread.damping * chain.deltas * line.omega * line.phasor,
                spread.beta * cubic,
                spread.lam * self.along(line.phasor),
            )
            unit = line.phasor / np.maximum(np.abs(line.phasor), 1e-300)
            for cause in causes:
                if np.any(cause):
                    away = self.moved(line, np.diag(cause))
                    felt = np.where(phased[:, None], np.abs(away), np.real(np.conj(unit)[:, None] * away))
                    total += np.sum(felt**2, axis=1)
        return np.sqrt(total)


def pattern_error(
    states: tuple[OperatingPoint, ...], chains: list[Linearisation], changes: list[list[Complexes]]
) -> float:
    """Worst change of an actuator: of its amplitude, or of its phasor but for a turn that a frequency has in common."""
    worst = 0.0
    shared: dict[float, complex] = {}
    for state, chain, lines in zip(states, chains, changes, strict=True):
        for line, change in zip(chain.lines, lines, strict=False):
            if state.phase is not None:
                common = complex(np.vdot(line.phasor, line.phasor + change))
                shared[line.omega] = shared.get(line.omega, 0j) + common
    for state, chain, lines in zip(states, chains, changes, strict=True):
        off = np.zeros(chain.chain.n)
        for line, change in zip(chain.lines, lines, strict=False):
            moved = np.abs(np.abs(line.phasor + change) - np.abs(line.phasor))
            if not chain.moving:
                moved = np.abs(change)
            elif state.phase is not None:
                turned = (line.phasor + change) * np.exp(-1j * np.angle(shared[line.omega]))
                moved = np.where(np.isfinite(state.phase), np.abs(turned - line.phasor), moved)
            off += moved
        worst = max(worst, float(off.max()))
    return worst
