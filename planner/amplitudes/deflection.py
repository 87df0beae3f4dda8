"""Patterns held still by a DC bias on every actuator (the paper's goal 1, theory.md section 2.4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chainsim import Closure, Outcome, Setting
from encoders import SMOOTHNESS

from ..closed_forms.links import Stage, stages
from ..family import AmplitudeFamily
from ..margins import WELL_SHARE
from ..operating_point import Margins, OperatingPoint
from ..plan import Ramp
from ..transitions import jets

__all__ = ["Deflection"]

Floats = NDArray[np.float64]

# A blend of eight resonance periods, smooth to the fifth derivative, has next to no content at the resonance:
# the bias that follows it exactly hardly differs from the static one, and an actuator whose f0 is a few per
# cent off does not ring.
RAMP_PERIODS = 8
QUICK = 5
NODES = 65
TOL = 1e-12


class Deflection(AmplitudeFamily):
    """b_m = z_m + beta z_m^3 - lam (z_{m-1} - z_m) for any wanted deflection, with the smallest lam there is."""

    @property
    def ramp_s(self) -> float:
        """Length of every ramp in seconds."""
        return RAMP_PERIODS / self.device.f0_hz

    def _bias(self, z: Floats, force: Floats) -> Floats:
        """Bias that balances deflections z, shape (..., n), plus `force`, what moves them."""
        law, own, links = self.device.chain.law, self._own, self._links.copy()
        if not law.closed:
            links[0] = 0.0
        pulled = np.zeros_like(z)
        law.pull(pulled, z, links)
        return np.asarray(force + own.stiffness * z + own.beta * z**3 - pulled)

    @cached_property
    def _own(self) -> Stage:
        return stages(self.device.chain)

    @cached_property
    def _links(self) -> Floats:
        """What the links into each actuator make of the smallest lam; the first of a ring closes it."""
        device = self.device
        links = np.full(device.chain_length, device.coupling.lam.min)
        if device.actuators and device.chains == 1:
            links[1:] *= device.lam_gain(0)
        return links

    def states(self, targets: Floats) -> list[OperatingPoint]:
        """Static settings for `targets`, checked by the static solver."""
        # Imported here: what was planned before comes from the cache, and needs no solver.
        from chainsim import solve

        device = self.device
        biases = self._bias(targets * device.full_scale, np.zeros_like(targets))
        step = device.amplifier.volt_step * device.bias_per_volt
        if step:
            biases = step * np.rint(biases / step)
        ring = device.coupling.closure is Closure.RING
        lam, links = self._links[1:], self._links if ring else self._links[1:]
        setting = Setting.of(device.chain, epsilon=0.0, lam=links if len(links) else 0.0, omega=1.0, bias=biases)
        rung = "static" if device.chain.feed_forward else "auto"
        response = solve(device.chain, setting, tol=TOL, rung=rung, start="rest")
        error = np.abs(response.mean / device.full_scale - targets).max(axis=1)
        return [
            OperatingPoint(
                target=targets[i],
                epsilon=0j,
                lam=lam,
                bias=biases[i],
                omega=1.0,
                phasor=np.zeros(device.chain_length, dtype=np.complex128),
                mean=response.mean[i],
                error=float(error[i]),
                margins=self._margins(biases[i]),
                outcome=self._outcome(response.outcome[i], targets[i], biases[i]),
                lacking=self._lacking(targets[i], biases[i]),
            )
            for i in range(len(targets))
        ]

    def _margins(self, bias: Floats) -> Margins:
        own = self._own
        soft = np.minimum(own.beta, 0.0)
        with np.errstate(divide="ignore"):
            fold = 2 * np.power(own.stiffness, 1.5) / (3 * np.sqrt(3 * -soft))
        volts = float(np.abs(bias).max()) / self.device.bias_max
        return Margins(volts=volts, well=float((np.abs(bias) / fold).max()))

    def _outcome(self, solved: Outcome, target: Floats, bias: Floats) -> Outcome:
        return Outcome.UNREACHABLE if solved is Outcome.OK and self._lacking(target, bias) else solved

    def _lacking(self, target: Floats, bias: Floats) -> str:
        device, margins = self.device, self._margins(bias)
        if margins.volts > 1:
            share = f"{100 * margins.volts:.0f} % of the amplifier's volts"
            return f"it takes {share}; it lacks volts, or a lower full_scale"
        # Past the fold the bias that balances a deflection falls again, but nothing stable stands there.
        own = self._own
        stiffness = own.stiffness + device.coupling.lam.min + 3 * own.beta * (target * device.full_scale) ** 2
        if np.any(stiffness <= 0):
            return "it lies beyond the fold of the softening well; it lacks depth of the well, or a lower full_scale"
        if margins.well > WELL_SHARE:
            return (
                f"its bias is {100 * margins.well:.0f} % of that at which the well folds, {100 * WELL_SHARE:.0f} % are "
                "allowed; it lacks depth of the well, or a lower full_scale"
            )
        return ""

    def note(self) -> str:
        """What is lacking when a deflection cannot be held."""
        return f"{self.device.name} cannot hold this deflection: it lacks volts or depth of the softening well."

    def ramps(
        self,
        before: Sequence[OperatingPoint],
        after: Sequence[OperatingPoint],
        moves: bool = True,
        length_s: float | None = None,
    ) -> list[Ramp | None]:
        """Every deflection follows one smooth blend; the bias is what the equations ask for on the way."""
        ramp_s, smoothness = (self.ramp_s, QUICK) if length_s is None else (length_s, SMOOTHNESS)
        duration, own = ramp_s * self.device.tau_per_s, self._own
        blend = jets.smoothstep(smoothness, NODES, 4)
        x = np.linspace(0.0, ramp_s, NODES)
        begin, end = (np.array([point.target for point in points])[:, None] for points in (before, after))
        step = (end - begin) * self.device.full_scale
        z, speed, push, jerk = (blend[k][:, None] * math.factorial(k) * duration**-k * step for k in range(4))
        z = z + begin * self.device.full_scale
        bias = self._bias(z, push + own.delta * speed)
        linear = self._bias(speed, jerk + own.delta * push)
        slope = (linear + own.beta * (3 * z**2 * speed - speed**3)) * self.device.tau_per_s
        changed = step.any(axis=(1, 2))
        # Copies: a view would keep all of them in memory.
        return [
            Ramp(t_s=x, bias=bias[i].copy(), bias_slope=slope[i].copy()) if changed[i] else None
            for i in range(len(changed))
        ]
