"""What accuracy costs for a text, measured now, and which terms of the model it needs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from planner import trade_off

from ...api.plans import plan
from ...api.scenes import device as device_of, text as text_scene
from ...progress import progress
from .tell import Tell

__all__ = ["do"]


def do(folder: Path, asked: Mapping[str, Any], tell: Tell) -> dict[str, Any]:
    """Measure, and say which terms matter, plain JSON types.

    Parameters
    ----------
    asked : `device`, `text`, `tol` (relative to the largest amplitude) and `budget_s` (seconds).
    """
    device = device_of(asked["device"])
    planned = plan(text_scene(asked["text"], device), device)
    with progress("what it requires") as update:
        update(0)
        required = planned.explain(asked["tol"])
    with progress("measuring every rung") as update:
        update(0)
        found = trade_off(planned.frames, device)
    choices = [found.cheapest(asked["tol"]), found.within(asked["budget_s"])]
    return {
        **found.as_dict(), "required": required.as_dict(), "verdict": required.as_text().splitlines(),
        "choices": [one.sentence for one in choices], "auto": choices[0].row.rung, "met": choices[0].met,
    }  # fmt: skip
