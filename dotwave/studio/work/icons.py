"""A set of icons as patterns that are told apart."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...icon_sets.build import IconOptions, render_icons
from .tell import Tell

__all__ = ["do"]

KEPT = {"contact.png": "contact.png", "index.html": "icons.html", "manifest.csv": "icons.csv"}
"""What is offered of the set's folder, and under which name."""


def do(folder: Path, asked: Mapping[str, Any], tell: Tell) -> dict[str, Any]:
    """Encode and plan the set, and say what came of each icon, plain JSON types.

    Parameters
    ----------
    asked : `device`, `source` (an archive or a picture in the folder) and `distinct`.
    """
    made = folder / "set"
    options = IconOptions(device=asked["device"], distinct=bool(asked["distinct"]), yes=True)
    report = render_icons([str(folder / asked["source"])], made, options)
    for name, kept in KEPT.items():
        if (made / name).is_file():
            os.replace(made / name, folder / kept)
    return {**report.manifest(), "lines": report.as_text().splitlines(), "ok": report.ok}
