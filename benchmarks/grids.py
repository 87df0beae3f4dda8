"""How many of 1,000 random 6 x 6 patterns of raised and flat dots a grid with a lam on every link holds, by its drives.

python benchmarks/grids.py

A pattern counts where the planner's setting for it is ok. The way in of some of them is worked out, too: a part of the
patterns, since one drive takes long to try.
"""

from __future__ import annotations

import numpy as np

from chainsim import Device, Outcome, load_device
from planner.families import family_of, row_of
from planner.family import PatternFamily
from planner.operating_point import OperatingPoint
from planner.targets import AmplitudeTarget

PATTERNS, WAYS, SEED, CONTRAST_DB = 1000, 40, 0, 20.0


def main() -> None:
    device = load_device("linked-grid-6x6")
    patterns = (np.random.default_rng(SEED).random((PATTERNS, device.chain_length)) < 0.5).astype(np.float64)
    for where in ("corner", "column", "border"):
        coupling = device.coupling.model_copy(update={"drives": where})
        tried(device.model_copy(update={"coupling": coupling}), patterns)


def tried(device: Device, patterns: np.ndarray) -> None:
    family = family_of(row_of(AmplitudeTarget, device), device, CONTRAST_DB)
    wanted = [family.held(AmplitudeTarget.of(one), started=False) for one in patterns]
    points = family.points(wanted)
    held = [point for point in points if point.outcome is Outcome.OK]
    gains = [point.margins.noise_gain for point in held]
    print(
        f"{len(device.driven)} drives: {len(held)} of {len(points)} held; "
        f"a disturbance of the drive magnified {np.median(gains):.1e} times (median), {max(gains):.1e} at most; "
        + ways(family, family.points([family.held(AmplitudeTarget.of(0 * patterns[0]), started=False)])[0], points)
    )


def ways(family: PatternFamily, rest: OperatingPoint, points: list[OperatingPoint]) -> str:
    some = [point for point in points[:WAYS] if point.outcome is Outcome.OK]
    ramps = family.ramps([rest] * len(some), some)
    gone = [ramp.duration_s for ramp in ramps if ramp is not None and not ramp.lacking]
    ends = f"{np.median(gone):.2g} s (median), {max(gone):.2g} s at most" if gone else "none"
    return f"of {min(WAYS, len(points))} tried {len(gone)} have a way in: {ends}"


if __name__ == "__main__":
    main()
