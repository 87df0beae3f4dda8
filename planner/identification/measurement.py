"""What was measured of a page while it stood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Measured"]


@dataclass(frozen=True)
class Measured:
    """How every actuator moved while a frame stood: z(tau) = mean + Re(harmonic e^{i omega tau}).

    omega is that of the frame in the actuator's row. tau = 2 pi f0_hz t is counted from the start of the plan, which is
    sample 0 of its waveform, as that of the drive is: where a chain is driven by `OperatingPoint.epsilon`, `harmonic`
    compares with its `phasor`, and ``harmonic e^{-i arg epsilon}`` has its phases against the drive.

    Attributes
    ----------
    frame : number of the frame on the time line, from 0.
    mean : float64, shape (actuators,), row by row, dimensionless (`Device.full_scale` is what is felt as 1).
    harmonic : complex128, shape (actuators,), dimensionless; NaN where nothing was measured, as in rows that are
        held still. Of amplitudes alone the phase says nothing.
    change : complex128, shape (actuators,), by how much the harmonic changed while it was measured, as what rings on
        from before makes it; None where that was not measured.
    rest : float64, shape (actuators,), mean square of what moved besides; None as of `change`.
    """

    frame: int
    mean: NDArray[np.float64]
    harmonic: NDArray[np.complex128]
    change: NDArray[np.complex128] | None = None
    rest: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        if self.mean.ndim != 1 or self.mean.shape != self.harmonic.shape:
            shapes = f"{self.mean.shape} and {self.harmonic.shape}"
            raise ValueError(f"measured: expected one mean and one harmonic an actuator, got {shapes}")
