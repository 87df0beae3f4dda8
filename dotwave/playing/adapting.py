"""A written waveform played from its frames, which are corrected by what the controller measures of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers import FrameMark, Manifest
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import Adaptation, Plan, plan_scene

from ..errors import AppError

__all__ = ["Adapting", "plan_of"]


@dataclass(frozen=True)
class Adapting:
    """How what plays is corrected.

    Attributes
    ----------
    noise, phases : as of `Adaptation`.
    """

    noise: float = 0.002
    phases: bool = True

    def to(self, manifest: Manifest) -> tuple[Adaptation, Plan]:
        """What corrects a written waveform, and its plan, corrected as it is drawn.

        Raises
        ------
        AppError
            When it cannot be planned again.
        planner.EstimateError
            When its chains are rings.
        """
        adaptation = Adaptation(manifest.device, noise=self.noise, phases=self.phases)
        return adaptation, adaptation.adapted(plan_of(manifest))


def plan_of(manifest: Manifest) -> Plan:
    """The plan of a written waveform, from what its manifest says was wished.

    Raises
    ------
    AppError
        When it has frames that a manifest does not say enough of, or was written by another version.
    """
    if any(any(mark.tones) for mark in manifest.frames):
        raise AppError("--adapt: bars that walk are not corrected while they play; leave it out")
    device = manifest.device
    scene = Scene(GridShape(device.rows, device.cols), tuple(map(_frame, manifest.frames)), encoding=manifest.encoding)
    contrast = {mark.wish.contrast_db for mark in manifest.frames}
    plan = plan_scene(scene, device, contrast_db=contrast.pop() if len(contrast) == 1 else None)
    frames = list(plan.frames)
    if round(frames[-1].end_s * manifest.rate_hz) != manifest.samples:
        raise AppError("--adapt: this waveform is planned otherwise by now; write it anew")
    return Plan(device, frames, plan.encoding)


def _frame(mark: FrameMark) -> Frame:
    level, known = np.nan_to_num(mark.wish.level), ~np.isnan(mark.wish.level)
    phased = ~np.isnan(mark.phase)
    pattern = TargetPattern(
        level * np.exp(1j * np.nan_to_num(mark.phase)), weight=None if known.all() else known.astype(np.float64),
        phase_matters=bool(phased.any()), any_phase=None if phased.all() or not phased.any() else ~phased,
    )  # fmt: skip
    return Frame(
        pattern, mark.end_s - mark.start_s, mark.page, mark.text, mark.span, mark.cells, mark.goes_on
    )  # fmt: skip
