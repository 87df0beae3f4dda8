"""The hardware as built: one `Device`, read from a YAML profile; the only place where SI meets dimensionless."""

from __future__ import annotations

import math
from difflib import get_close_matches
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ..equations.chain import Chain
from ..errors import ProfileError
from ..yamlfile import read_model
from .calibrated import Actuator, ActuatorSpread, far_off, misplaced
from .parts import Amplifier, Coupling, Finite, Modulation, Note, Positive, ProfilePart, Span, Surroundings

__all__ = ["Amplifier", "Coupling", "Device", "Modulation", "Note", "Span", "device_names", "load_device"]

PROFILES = Path(__file__).parent / "profiles"

Count = Annotated[int, Field(ge=1, le=1024)]


class _Places:
    """Measured actuators by row and column."""

    def __init__(self, actuators: tuple[Actuator, ...]) -> None:
        self.actuators = actuators
        self.at = {(one.row, one.col): one for one in actuators}


class Device(ProfilePart):
    """A grid of actuators, its chains, its drive and its amplifier.

    Each row is cut into chains of `chain_length` actuators, which must divide `cols`; the first actuator
    of every chain is driven. Where actuators are coupled in two dimensions (`coupling.lam_y`) all of them are one
    chain, row by row, and `coupling.drives` says which are driven. A dimensionless amplitude z is ``z * length_m``
    metres; the target 1 of a pattern is the amplitude `full_scale`.

    Attributes
    ----------
    rows, cols : size of the grid.
    `pitch_m` : distance between neighbours in metres.
    f0_hz : resonance of one actuator in hertz; tau = 2 pi f0_hz t.
    delta, beta : damping and cubic term of `chainsim.Chain`.
    length_m : metres per unit of z.
    full_scale : dimensionless amplitude of target 1.
    epsilon_per_volt, bias_per_volt : dimensionless force per volt at the actuator (drive, bias).
    omega : drive frequencies the device can make, over f0.
    drive : whether every chain has its own drive, or all chains are driven alike (`device`).
    bias : whether every actuator has its own DC bias channel.
    actuators : what was measured of single actuators (`dotwave calibrate`). Every chain is planned with its own.
    spread : how far actuators may lie from what is known of them, ``{frequency: 0.01, damping: 0.0, beta: 0.0,
        lam: 0.0}`` (relative standard deviations); plans are then made for many such devices. None: none is known.
    modulation : how the envelope of a carrier goes that is not felt itself; levels are then those of the modulation.
        None: what vibrates is felt.
    surroundings : what acts on the device beside all that; plans count its `amplifier_noise` as error, `explain` and
        as-built studies all of it.
    notes : field name, or ``surroundings.`` and a name in there -> where the value comes from.

    Examples
    --------
    >>> from chainsim import load_device
    >>> device = load_device("linked-6x6")
    >>> device
    Device('linked-6x6', 6 x 6)
    >>> device.amplifier.rate_hz, device.chains_per_row
    (24000, 1)
    """

    schema_: Literal["dotwave/device/1"] = Field("dotwave/device/1", alias="schema")
    name: Annotated[str, Field(min_length=1, max_length=80)]
    description: str = ""
    rows: Count
    cols: Count
    chain_length: Annotated[int, Field(ge=1, le=1024 * 1024)]
    pitch_m: Positive
    f0_hz: Positive
    delta: Annotated[float, Field(gt=0, lt=1)]
    beta: Finite
    length_m: Positive
    full_scale: Positive
    epsilon_per_volt: Positive
    bias_per_volt: Positive
    omega: Span
    coupling: Coupling
    drive: Literal["chain", "device"] = "chain"
    bias: Literal["none", "actuator"]
    amplifier: Amplifier
    actuators: tuple[Actuator, ...] = ()
    spread: ActuatorSpread | None = None
    modulation: Modulation | None = None
    surroundings: Surroundings | None = None
    notes: dict[str, Note] = Field(default={})

    @model_validator(mode="after")
    def _consistent(self) -> Device:
        if self.grid:
            self._check_grid()
        elif self.cols % self.chain_length:
            raise ValueError(f"chain_length {self.chain_length} does not divide cols {self.cols}")
        if self.omega.min <= 0:
            raise ValueError("omega.min must be above 0")
        if self.coupling.scope == "none" and self.chain_length > 1:
            raise ValueError("coupling.scope none needs chain_length 1")
        wrong = misplaced(self.actuators, self.rows, self.cols, self.chain_length)
        wrong = wrong or far_off(self.actuators, self.f0_hz)
        if self.modulation is not None and self.modulation.hz > self.f0_hz / 20:
            wrong = wrong or f"modulation.hz {self.modulation.hz:g} is too fast for a carrier of {self.f0_hz:g} Hz"
        if wrong:
            raise ValueError(wrong)
        known = {*type(self).model_fields, *(f"surroundings.{name}" for name in Surroundings.model_fields)}
        unknown = sorted(set(self.notes) - known)
        if unknown:
            raise ValueError(f"notes.{unknown[0]}: the profile has no such field")
        if self.beta < 0 and self.full_scale >= self.escape_amplitude:
            raise ValueError(
                f"full_scale {self.full_scale} is beyond the softening hilltop {self.escape_amplitude:.4g}"
            )
        return self

    def _check_grid(self) -> None:
        """What a grid coupled in two dimensions must be, and cannot have."""
        if min(self.rows, self.cols) < 2:
            raise ValueError(
                f"coupling.lam_y: a grid of {self.rows} x {self.cols} is no grid but a chain; remove lam_y"
            )
        if self.chain_length != self.rows * self.cols:
            wanted = self.rows * self.cols
            raise ValueError(f"chain_length {self.chain_length}: with coupling.lam_y it is rows times cols, {wanted}")
        if self.bias != "none" or self.drive != "chain":
            raise ValueError("a grid with coupling.lam_y takes bias none and drive chain")
        for name in ("actuators", "spread"):
            if getattr(self, name):
                raise ValueError(f"{name}: of a grid with coupling.lam_y actuators count as equal; remove {name}")
        if self.modulation is not None:
            raise ValueError("modulation: a grid with coupling.lam_y takes none; remove modulation")

    def __repr__(self) -> str:
        return f"Device({self.name!r}, {self.rows} x {self.cols})"

    @property
    def chains_per_row(self) -> int:
        """How many chains a row has; 1 where all rows are one chain."""
        return max(1, self.cols // self.chain_length)

    @property
    def chains(self) -> int:
        """How many chains the device has."""
        return self.rows * self.cols // self.chain_length

    @property
    def grid(self) -> bool:
        """Whether actuators are coupled in two dimensions: one chain of all of them, row by row."""
        return self.coupling.lam_y is not None

    @property
    def links(self) -> int:
        """How many links a chain has: to the right, row by row, and in a grid those downwards after them."""
        down = (self.rows - 1) * self.cols
        return self.rows * (self.cols - 1) + down if self.grid else self.chain_length - 1

    @property
    def driven(self) -> tuple[tuple[int, int], ...]:
        """Row and column of every actuator that has a drive, in the order of the channels: chain by chain."""
        if not self.grid:
            starts = range(0, self.cols, self.chain_length)
            return tuple((row, col) for row in range(self.rows) for col in starts)
        column = tuple((row, 0) for row in range(self.rows))
        border = column + tuple((0, col) for col in range(1, self.cols))
        return {"corner": column[:1], "column": column, "border": border}[self.coupling.drives or "corner"]

    @property
    def chain(self) -> Chain:
        """One chain of the device, for the solvers: as measured where there is no other, else as the profile says."""
        if self.actuators and self.chains == 1:
            return self.chain_at(0)
        rows = self.rows if self.grid else 1
        return Chain(n=self.chain_length, delta=self.delta, beta=self.beta, closure=self.coupling.closure, rows=rows)

    def chain_at(self, row: int, index: int = 0) -> Chain:
        """Chain `index` of `row` (both from 0) with the numbers of its actuators."""
        if self.grid:
            return self.chain
        measured = self._measured(row, index)
        return Chain.of(
            self.chain_length,
            delta=[self.delta if one is None or one.delta is None else one.delta for one in measured],
            beta=[self.beta if one is None or one.beta is None else one.beta for one in measured],
            stiffness=[1.0 if one is None or one.f0_hz is None else (one.f0_hz / self.f0_hz) ** 2 for one in measured],
            closure=self.coupling.closure,
        )

    def lam_gain(self, row: int, index: int = 0) -> NDArray[np.float64]:
        """What the links of a chain make of the lam they are set to; float64, shape (n-1,), 1 where not measured."""
        if self.grid:
            return np.ones(self.links)
        return np.array(
            [
                1.0 if one is None or one.lam is None or one.lam_set is None else one.lam / one.lam_set
                for one in self._measured(row, index)[1:]
            ]
        )

    def drive_per_volt(self, row: int, index: int = 0) -> float:
        """Dimensionless force per volt on the first actuator of a chain."""
        first = self._measured(row, index)[0]
        return self.epsilon_per_volt if first is None or first.epsilon_per_volt is None else first.epsilon_per_volt

    def alone(self, row: int, index: int = 0) -> Device:
        """A device of nothing but this chain, with its own numbers; equal chains give equal devices.

        Where a lam belongs to more than one link its range is what links make of it on average, and `lam_gain` how
        much each differs from that; `drive_per_volt` has become `epsilon_per_volt`.
        """
        gain, unit = self.lam_gain(row, index), self.lam_unit(row, index)
        chain, lam = self.chain_at(row, index), self.coupling.lam
        own: tuple[Actuator, ...] = ()
        if chain.spread is not None or np.any(gain != unit):
            numbers = np.broadcast_arrays(chain.stiffness, chain.deltas, chain.betas, np.append(1.0, gain / unit))
            own = tuple(
                Actuator(
                    row=0, col=col, f0_hz=self.f0_hz * math.sqrt(stiffness), delta=delta, beta=beta,
                    lam=factor if col else None, lam_set=1.0 if col else None,
                )
                for col, (stiffness, delta, beta, factor) in enumerate(zip(*(n.tolist() for n in numbers), strict=True))
            )  # fmt: skip
        span = Span(min=lam.min * unit, max=lam.max * unit)
        return self.model_copy(
            update={
                "rows": 1, "cols": self.chain_length, "delta": chain.delta, "beta": chain.beta,
                "epsilon_per_volt": self.drive_per_volt(row, index), "actuators": own,
                "coupling": self.coupling.model_copy(update={"lam": span}),
            }
        )  # fmt: skip

    def lam_unit(self, row: int, index: int = 0) -> float:
        """What the links of a chain make of a lam of 1 they share, on average; 1 where each has its own."""
        gain = self.lam_gain(row, index)
        return 1.0 if self.coupling.scope == "link" or not len(gain) else float(np.mean(gain))

    def _measured(self, row: int, index: int) -> list[Actuator | None]:
        known = self._places
        if known.actuators is not self.actuators:
            # A copy with other actuators has brought the places of those it had before.
            known = self.__dict__["_places"] = _Places(self.actuators)
        start = index * self.chain_length
        return [known.at.get((row, col)) for col in range(start, start + self.chain_length)]

    @cached_property
    def _places(self) -> _Places:
        return _Places(self.actuators)

    @property
    def escape_amplitude(self) -> float:
        """Dimensionless hilltop sqrt(1/|beta|) of an uncoupled actuator; infinite unless beta < 0."""
        return math.sqrt(-1.0 / self.beta) if self.beta < 0 else math.inf

    @property
    def tau_per_s(self) -> float:
        """tau = tau_per_s * t."""
        return 2 * math.pi * self.f0_hz

    @property
    def epsilon_max(self) -> float:
        """Largest dimensionless drive the amplifier can give."""
        return self.amplifier.volts * self.epsilon_per_volt

    @property
    def bias_max(self) -> float:
        """Largest dimensionless bias the amplifier can give."""
        return self.amplifier.volts * self.bias_per_volt

    def as_dict(self) -> dict[str, Any]:
        """The whole profile in plain JSON types, as it stands in a manifest."""
        optional = ("modulation", "spread", "surroundings")
        left_out: dict[str, Any] = {name: True for name in optional if getattr(self, name) is None}
        if not self.grid:
            left_out["coupling"] = {"lam_y", "drives"}
        return self.model_dump(mode="json", by_alias=True, exclude=left_out)


def device_names() -> list[str]:
    """Names of the built-in profiles, sorted."""
    return sorted(path.stem for path in PROFILES.glob("*.yaml"))


def load_device(name: str) -> Device:
    """A built-in profile by name, or the profile in the YAML file of that path, as the file is now.

    Raises
    ------
    ProfileError
        When there is no such profile or file, or the file does not fit; the message says where.
    """
    if name in device_names():
        return _built_in(name)
    path = Path(name)
    if path.suffix.lower() in {".yaml", ".yml"}:
        return read_model(path, Device)
    close = get_close_matches(name.casefold(), device_names(), n=1)
    meant = f"; did you mean {close[0]}?" if close else ""
    known = ", ".join(device_names())
    raise ProfileError(f"device {name!r}: not a built-in profile ({known}) and not a .yaml file{meant}")


@cache
def _built_in(name: str) -> Device:
    return read_model(PROFILES / f"{name}.yaml", Device)
