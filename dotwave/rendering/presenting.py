"""How the dots of a text are given to the fingers where a yield is asked for and nobody says it."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from chainsim import Device
from encoders import Presentation, Scene, TextScene, encode_text
from planner import kept_share

from ..request import Request

__all__ = ["Presented", "presented"]


# A text scrolls only where that is asked for.
PAGES = (Presentation.TOGETHER, Presentation.BY_ROW, Presentation.BY_DOT)


class Presented(NamedTuple):
    """A scene to plan, and sentences on why it is shown as it is."""

    scene: Scene
    notes: tuple[str, ...] = ()


def presented(scene: Scene, device: Device, request: Request) -> Presented:
    """The scene; a text whose presentation is open in the first that reaches the yield, else in the best.

    Together is tried first, for the others take more time.
    """
    if request.yield_ is None or not isinstance(scene, TextScene) or scene.text_frames.options.presentation:
        return Presented(scene)
    shares: dict[Presentation, float] = {}
    shown = {}
    for presentation in PAGES:
        frames = scene.text_frames
        encoded = encode_text(frames.source, scene.shape, replace(frames.options, presentation=presentation))
        shown[presentation] = replace(encoded, parts=scene.parts)
        share = kept_share(shown[presentation], device, contrast_db=request.contrast_db, yield_=request.yield_)
        if share is None:
            return Presented(scene)
        shares[presentation] = share
        if share >= request.yield_:
            break
    best = max(shares, key=lambda one: shares[one])
    tried = ", ".join(f"{one.value} {100 * share:.1f} %" for one, share in shares.items())
    notes = () if len(shares) == 1 else (f"Shown {best.value}; devices that keep the first pages: {tried}.",)
    return Presented(shown[best], notes)
