"""The devices that pages offer: built-in profiles, and those that were saved here."""

from __future__ import annotations

from chainsim import device_names

from ..errors import AppError
from .page import Studio

__all__ = ["PROFILE", "device_choices", "device_path"]

PROFILE = "profile.yaml"
MOST = 50


def device_choices(studio: Studio) -> list[tuple[str, str]]:
    """What a list of devices offers, and the words for it."""
    saved = [one for one in studio.results.latest(1000) if one.page == "device"][:MOST]
    own = [] if studio.device in device_names() else [(studio.device, studio.device)]
    return own + [(name, name) for name in device_names()] + [(one.name, f"{one.title} (saved here)") for one in saved]


def device_path(studio: Studio, chosen: str) -> str:
    """Name or file of a device that was chosen from the list.

    Raises
    ------
    AppError
        When it is not one of them.
    """
    if chosen in device_names() or chosen == studio.device:
        return chosen
    profile = studio.results.find(chosen).files().get(PROFILE) if chosen.startswith("device-") else None
    if profile is None:
        raise AppError(f"Device: there is no {chosen!r}; choose one of the list")
    return str(profile.absolute())
