"""What a frame becomes under spread, as values: error, yield, the accuracy that is needed, and what detuning buys."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

__all__ = ["FrameSpread", "TradePoint"]

NAMES = ("frequency", "damping", "beta", "lam")


@dataclass(frozen=True)
class TradePoint:
    """A frame's worst chain held at one frequency.

    Attributes
    ----------
    omega : frequency over f0.
    volts : peak drive over the amplifier's.
    expected, median : error under the spread in units of full scale.
    yield_ : share of draws within the tolerance.
    """

    omega: float
    volts: float
    expected: float
    median: float
    yield_: float

    def as_dict(self) -> dict[str, float]:
        """Plain JSON types."""
        return {
            "omega": self.omega, "volts": self.volts, "expected": self.expected, "median": self.median,
            "yield": self.yield_,
        }  # fmt: skip

    def __str__(self) -> str:
        return (
            f"omega {self.omega:.3f}: {100 * self.volts:.0f} % of the volts, error expected "
            f"{100 * self.expected:.3g} %, median {100 * self.median:.3g} %, yield {100 * self.yield_:.0f} %"
        )


@dataclass(frozen=True)
class FrameSpread:
    """One frame over many draws of the device's actuators; errors in units of full scale.

    Attributes
    ----------
    spread : relative standard deviations of frequency, damping, beta and lam.
    expected, median, quantile_90 : of the worst actuator's error.
    yield_ : share of draws with every actuator within `tolerance` and on its side of the dot threshold.
    dots_right : share of draws with every actuator on its side of the threshold.
    draws : how many there were.
    needed : what the spread must be multiplied by so that a plan for it has a yield of `wanted`; 1 where it is good
        enough, 0 where no accuracy tried is.
    aim : how far the plan itself aims beside the wish, so that the expected error is least.
    worst : the worst chain as planned;
    trade : the same held by the closed form, at ever higher frequencies. None and empty where no closed form makes its
        pattern.
    """

    spread: tuple[float, float, float, float]
    expected: float
    median: float
    quantile_90: float
    yield_: float
    dots_right: float
    tolerance: float
    wanted: float
    draws: int
    needed: float
    aim: float = 0.0
    worst: TradePoint | None = None
    trade: tuple[TradePoint, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types, as in a manifest."""
        plain = {
            name: value for name, value in vars(self).items() if name not in ("yield_", "worst", "trade", "spread")
        }
        return {
            "spread": dict(zip(NAMES, self.spread, strict=True)), "yield": self.yield_, **plain,
            "worst": None if self.worst is None else self.worst.as_dict(),
            "trade": [point.as_dict() for point in self.trade],
        }  # fmt: skip

    def lines(self) -> Iterator[str]:
        """Sentences for a person."""
        yield f"Under a spread of {self._words(1.0)} (1 sigma), over {self.draws} draws, of the worst frame:"
        yield (
            f"- error expected {100 * self.expected:.3g} % of full scale, median {100 * self.median:.3g} %, "
            f"90 % of draws below {100 * self.quantile_90:.3g} %"
        )
        yield (
            f"- yield {100 * self.yield_:.1f} % within {100 * self.tolerance:g} %; "
            f"dots right in {100 * self.dots_right:.1f} %"
        )
        if self.aim > 0:
            yield f"- it aims up to {100 * self.aim:.3g} % beside the wish, where the expected error is least"
        if self.needed >= 1:
            yield f"- good enough for a yield of {100 * self.wanted:g} %"
        elif self.needed > 0:
            yield f"- calibrate to {self._words(self.needed)} for a yield of {100 * self.wanted:g} %"
        else:
            yield f"- no accuracy tried gives a yield of {100 * self.wanted:g} %"
        if self.worst is not None:
            yield "Its worst chain, held exactly at ever higher frequencies, and as planned:"
            yield from (f"- {point}" for point in self.trade)
            yield f"- planned, {self.worst}"

    def _words(self, factor: float) -> str:
        known = zip(NAMES, self.spread, strict=True)
        return ", ".join(f"{name} {100 * value * factor:.2g} %" for name, value in known if value) or "nothing"
