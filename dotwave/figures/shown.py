"""Figures that show themselves in a notebook, with words for who cannot see them."""

from __future__ import annotations

import base64
import html
import io
from typing import Any

from matplotlib.figure import Figure

__all__ = ["ShownFigure"]


class ShownFigure(Figure):
    """A figure that a notebook draws also where pyplot was never imported.

    Parameters
    ----------
    words : str
        The same as text: the alternative of the picture.
    **given
        As `matplotlib.figure.Figure` takes it.
    """

    def __init__(self, words: str, **given: Any) -> None:
        super().__init__(**given)
        self.words = words

    def _repr_html_(self) -> str:
        png = io.BytesIO()
        self.savefig(png, format="png")
        data = base64.b64encode(png.getvalue()).decode()
        return f'<img alt="{html.escape(self.words)}" src="data:image/png;base64,{data}">'
