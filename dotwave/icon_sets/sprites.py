"""The figures of a set as a few large pictures: a browser takes ten thousand small ones one after the other."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from .contact_sheet import figure_picture

__all__ = ["Sprites"]

Pixels = NDArray[np.uint8]

# The longer side of a figure on the page, and how much one sheet holds.
SIDE_PX, SHEET_PIXELS = 72, 1 << 22


class Sprites:
    """Where each figure is on its sheet.

    Parameters
    ----------
    figures : uint8, all of one shape, 255 = figure.

    Attributes
    ----------
    style : the CSS that holds the sheets.
    """

    def __init__(self, figures: Sequence[Pixels]) -> None:
        rows, cols = figures[0].shape
        most = max(1, SHEET_PIXELS // (rows * cols))
        self._across = max(1, min(len(figures), round((most * rows / cols) ** 0.5)))
        self._each = self._across * max(1, most // self._across)
        scale = SIDE_PX / max(rows, cols)
        self._high, self._wide = rows * scale, cols * scale
        self.style = f".figure {{ width: {self._wide:g}px; height: {self._high:g}px; }}\n" + "\n".join(
            f".sheet-{number} {{ background: url({self._sheet(figures[start : start + self._each])}) "
            f"0 0 / {self._across * self._wide:g}px auto; }}"
            for number, start in enumerate(range(0, len(figures), self._each))
        )

    def _sheet(self, figures: Sequence[Pixels]) -> str:
        rows, cols = figures[0].shape
        down = -(-len(figures) // self._across)
        sheet = np.full((down * rows, self._across * cols), 255, np.uint8)
        for place, figure in enumerate(figures):
            top, left = place // self._across * rows, place % self._across * cols
            sheet[top : top + rows, left : left + cols] = figure_picture(figure)
        file = io.BytesIO()
        Image.fromarray(sheet).save(file, "PNG")
        return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()

    def drawn(self, place: int) -> str:
        """The element that shows a figure by its place in the set; what it says is said in words beside it."""
        number, within = divmod(place, self._each)
        down, across = divmod(within, self._across)
        at = f"{-across * self._wide:g}px {-down * self._high:g}px"
        return f'<span class="figure sheet-{number}" aria-hidden="true" style="background-position: {at}"></span>'
