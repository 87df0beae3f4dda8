"""What a frame becomes under spread, as values: error, yield, the accuracy that is needed, and what detuning buys."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["FACTORS", "FrameSpread", "MeansTried", "TradePoint", "needed_for", "spread_words"]

NAMES = ("frequency", "damping", "beta", "lam")
FACTORS = 2.0 ** -np.arange(0.0, 8.0, 0.5)
"""Parts of the spread that are tried for the accuracy that is needed."""


def needed_for(devices: NDArray[np.bool_], wanted: float) -> float:
    """The part of the spread under which a share `wanted` of devices is right, between the parts that were tried.

    Parameters
    ----------
    devices : bool, shape (parts, draws), which devices are right under each of `FACTORS`.
    wanted : 0 to 1.

    Returns
    -------
    float, 1 where the spread is good enough, 0 where no part of it that was tried is.
    """
    shares = devices.mean(axis=1)
    reached = np.flatnonzero(shares >= wanted)
    if not len(reached) or reached[0] == 0:
        return 1.0 if len(reached) else 0.0
    good = int(reached[0])
    part = (wanted - shares[good - 1]) / (shares[good] - shares[good - 1])
    return float(FACTORS[good - 1] * (FACTORS[good] / FACTORS[good - 1]) ** part)


def spread_words(spread: Sequence[float], factor: float) -> str:
    """A part of a spread in words: ``frequency 1 %, lam 2 %``."""
    known = zip(NAMES, spread, strict=True)
    return ", ".join(f"{name} {100 * value * factor:.2g} %" for name, value in known if value) or "nothing"


@dataclass(frozen=True)
class MeansTried:
    """Means that a scene was tried with.

    Attributes
    ----------
    omega : frequency over f0.
    loudest : how strong raised dots may be aimed at, in units of full scale;
    steepest_db : decibels that a step up from one actuator to the next may have. 1 and None: all dots are aimed at as
        they are wished.
    share : of devices that keep the first frames; 0 where one of them cannot be made.
    """

    omega: float
    loudest: float
    steepest_db: float | None
    share: float

    def __str__(self) -> str:
        aims = "dots as wished"
        if self.steepest_db is not None:
            aims = f"raised dots up to {self.loudest:g} of full scale, steps up to {self.steepest_db:g} dB"
        return f"omega {self.omega:.3f}, {aims}: {100 * self.share:.1f} %"


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
    yield_ : share of draws on which the wish is felt: of dots, none wrong and the contrast kept; of levels and waves,
        every actuator within `tolerance` and on its side of the dot threshold.
    dots_right : share of draws with every actuator on its side of the threshold.
    draws : how many there were.
    needed : what the spread must be multiplied by so that a plan for it has a yield of `wanted`; 1 where it is good
        enough, 0 where no accuracy tried is.
    devices : bool, shape (parts, draws), read-only, on which draws it is, under each of `FACTORS`.
    least_db : of dots, the contrast that is to be kept; None where there is none, or the frame is judged as levels.
    aim : how far the plan itself aims beside the wish, for the yield of dots or the expected error of levels.
    held : of dots, what the frame is made with; empty else.
    tried : means that the scene was tried with, where there was a choice.
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
    devices: NDArray[np.bool_] = field(repr=False, compare=False)
    least_db: float | None = None
    aim: float = 0.0
    held: str = ""
    tried: tuple[MeansTried, ...] = ()
    worst: TradePoint | None = None
    trade: tuple[TradePoint, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types, as in a manifest."""
        apart = ("yield_", "worst", "trade", "spread", "devices", "tried")
        plain = {name: value for name, value in vars(self).items() if name not in apart}
        return {
            "spread": dict(zip(NAMES, self.spread, strict=True)), "yield": self.yield_, **plain,
            "worst": None if self.worst is None else self.worst.as_dict(),
            "trade": [point.as_dict() for point in self.trade], "tried": [asdict(means) for means in self.tried],
        }  # fmt: skip

    def lines(self) -> Iterator[str]:
        """Sentences for a person."""
        yield f"Under a spread of {self._words(1.0)} (1 sigma), over {self.draws} draws, of the worst frame:"
        yield (
            f"- error expected {100 * self.expected:.3g} % of full scale, median {100 * self.median:.3g} %, "
            f"90 % of draws below {100 * self.quantile_90:.3g} %"
        )
        if self.held:
            contrast = "" if self.least_db is None else f" and a contrast of {self.least_db:g} dB"
            right = f"dots right in {100 * self.dots_right:.1f} %"
            yield f"- yield {100 * self.yield_:.1f} % with no wrong dot{contrast}; {right}"
            yield f"- made with {self.held}"
        else:
            yield (
                f"- yield {100 * self.yield_:.1f} % within {100 * self.tolerance:g} %; "
                f"dots right in {100 * self.dots_right:.1f} %"
            )
        if len(self.tried) > 1:
            yield "- tried, with the share of devices that keep the first frames: " + "; ".join(map(str, self.tried))
        if self.aim > 0 and not self.held:
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
        return spread_words(self.spread, factor)
