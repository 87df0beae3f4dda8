"""A map of a sweep over two ranges: outcome, lag of the last link and stability, and as built yield, side by side."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from drivers import atomic_file, naming

from ..errors import AppError

if TYPE_CHECKING:
    from chainsim import SettingSweep

__all__ = ["NEEDED", "draw_map"]

NEEDED = ("outcome", "phase_step_deg", "stable")
"""Fields a map is drawn from; beside them, where they are there, the yield as built and the effect that spoils most."""

Colours = dict[str, tuple[int, int, int]]

COLOURS: Colours = {
    "ok": (38, 102, 148), "unstable": (214, 96, 77), "escaped": (60, 20, 60), "not_locked": (230, 171, 2),
    "no_convergence": (120, 120, 120), "out_of_budget": (180, 180, 180), "unreachable": (0, 0, 0),
}  # fmt: skip
SPOILERS: Colours = {
    "spread": (38, 102, 148), "hysteresis": (214, 96, 77), "creep": (230, 171, 2), "higher modes": (60, 20, 60),
    "amplifier dynamics": (102, 166, 30), "amplifier noise": (117, 112, 179), "rounding": (180, 180, 180),
    "preload": (0, 0, 0),
}  # fmt: skip
MARGIN, TITLE = 90, 40
TALLEST = 2000


@dataclass(frozen=True)
class _Axis:
    name: str
    first: float
    last: float


def draw_map(source: Path, solved: Path, picture: Path) -> None:
    """Draw the NPZ `solved`, made from the sweep file `source`, as the PNG `picture`.

    The first range runs upwards, the second to the right.

    Raises
    ------
    AppError
        When the sweep has not two ranges, or its file lacks one of `NEEDED`.
    drivers.FileError
        When `picture` cannot be written.
    """
    from chainsim import read_sweep

    sweep = read_sweep(source)
    rows, cols, up, right = _axes(source, sweep)
    with np.load(solved, allow_pickle=False) as stored:
        missing = [name for name in NEEDED if name not in stored]
        if missing:
            raise AppError(f"{solved}: has no {missing[0]}; a map needs {', '.join(NEEDED)}")
        outcome, steps, stable = (stored[name] for name in NEEDED)
        drawn = [stored[name].reshape(rows, cols) for name in ("yield", "spoiler") if name in stored]
    shape = (rows, cols)
    lag = steps[:, -1].reshape(shape) if steps.shape[1] else np.full(shape, np.nan)
    panels = [
        ("outcome", _coloured(outcome.reshape(shape), COLOURS)),
        ("lag of the last link, -180 (dark) .. 180 deg", _shaded(lag)),
        ("stable (light)", _grey(stable.reshape(shape))),
    ]
    legends = [COLOURS]
    if len(drawn) == 2:
        panels.append(("yield as built, 0 (dark) .. 1", _grey(np.nan_to_num(drawn[0]))))
        panels.append(("what spoils most", _coloured(drawn[1], SPOILERS)))
        legends.append(SPOILERS)
    _paint(panels, legends, up, right, picture)


def _axes(source: Path, sweep: SettingSweep) -> tuple[int, int, _Axis, _Axis]:
    names = ("epsilon", "lam", "omega")
    wide = [at for at, size in enumerate(sweep.shape) if size > 1]
    if len(sweep.shape) != 3 or len(wide) != 2:
        raise AppError(f"{source}: a map needs exactly two ranges among {', '.join(names)}")
    ends = [_Axis(names[at], float(sweep.columns[at].flat[0]), float(sweep.columns[at].flat[-1])) for at in wide]
    return sweep.shape[wide[0]], sweep.shape[wide[1]], ends[0], ends[1]


def _coloured(words: NDArray[np.str_], colours: Colours) -> NDArray[np.uint8]:
    image = np.full((*words.shape, 3), 255, dtype=np.uint8)
    for name, colour in colours.items():
        image[words == name] = colour
    return image


def _shaded(lag: NDArray[np.float64]) -> NDArray[np.uint8]:
    level = np.nan_to_num((lag + 180) / 360, nan=0.0)
    low, high = np.array([20.0, 15.0, 70.0]), np.array([250.0, 230.0, 60.0])
    image = low + level[..., None] * (high - low)
    image[~np.isfinite(lag)] = 255
    shades: NDArray[np.uint8] = image.astype(np.uint8)
    return shades


def _grey(share: NDArray[Any]) -> NDArray[np.uint8]:
    return np.repeat((60 + 175 * share).astype(np.uint8)[..., None], 3, axis=2)


def _paint(
    panels: list[tuple[str, NDArray[np.uint8]]], legends: list[Colours], up: _Axis, right: _Axis, picture: Path
) -> None:
    # Imported here: only a picture needs it.
    from PIL import Image, ImageDraw

    height, width = (min(size, TALLEST) for size in panels[0][1].shape[:2])
    whole = Image.new("RGB", (len(panels) * (width + MARGIN) + MARGIN, height + TITLE + MARGIN), "white")
    pen = ImageDraw.Draw(whole)
    for number, (title, pixels) in enumerate(panels):
        left = MARGIN + number * (width + MARGIN)
        image = Image.fromarray(np.ascontiguousarray(pixels[::-1])).resize((width, height), Image.Resampling.NEAREST)
        whole.paste(image, (left, TITLE))
        pen.text((left, TITLE // 3), title, fill="black", font_size=10 + height // 100)
        bottom = TITLE + height
        pen.text((left, bottom + 8), f"{right.first:.4g}", fill="black", font_size=10 + height // 100)
        pen.text((left + width - 50, bottom + 8), f"{right.last:.4g}", fill="black", font_size=10 + height // 100)
        pen.text((left + width // 2, bottom + 8), right.name, fill="black", font_size=10 + height // 100)
        if not number:
            pen.text((4, bottom - 12), f"{up.first:.4g}", fill="black", font_size=10 + height // 100)
            pen.text((4, TITLE), f"{up.last:.4g}", fill="black", font_size=10 + height // 100)
            pen.text((4, TITLE + height // 2), up.name, fill="black", font_size=10 + height // 100)
    for number, colours in enumerate(legends):
        _legend(pen, colours, height, number)
    with atomic_file(picture) as file, naming(picture):
        whole.save(file, format="PNG", **_FAST)


def _legend(pen: Any, colours: Colours, height: int, line: int) -> None:
    for number, (name, colour) in enumerate(colours.items()):
        top, left = TITLE + height + 36 + line * (14 + height // 100), MARGIN + number * (90 + height // 8)
        pen.rectangle((left, top, left + 10, top + 10), fill=colour)
        pen.text((left + 14, top - 2), name, fill="black", font_size=10 + height // 100)


# Level 1 is several times faster than the default and a few per cent larger.
_FAST: dict[str, Any] = {"compress_level": 1}
