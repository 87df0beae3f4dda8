"""What acts on a device beside what it is made of and told to do, as its profile states it."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["DeviceSurroundings"]

Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


class DeviceSurroundings(BaseModel):
    """The section `surroundings` of a profile; what it leaves out is nothing.

    Attributes
    ----------
    amplifier_noise : root mean square of what an amplifier adds to its output, spread evenly up to half of `rate_hz`,
        as a share of `amplifier.volts`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    amplifier_noise: Share = 0.0
