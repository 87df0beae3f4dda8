"""Figures on sheets: each is where its element says, and a large set takes few pictures."""

from __future__ import annotations

import base64
import io
import re

import numpy as np
import pytest
from PIL import Image

from dotwave.icon_sets.contact_sheet import figure_picture
from dotwave.icon_sets.sprites import SHEET_PIXELS, SIDE_PX, Sprites


@pytest.mark.parametrize(("count", "shape"), [(1, (24, 24)), (50, (32, 24)), (150, (160, 384))])
def test_each_figure_is_where_its_element_says(count: int, shape: tuple[int, int]) -> None:
    figures = list(np.random.default_rng(count).integers(0, 256, (count, *shape), np.uint8))
    sprites = Sprites(figures)
    encoded = re.findall(r"base64,([^)]*)\)", sprites.style)
    sheets = [np.asarray(Image.open(io.BytesIO(base64.b64decode(one)))) for one in encoded]
    assert max(sheet.size for sheet in sheets) <= SHEET_PIXELS
    assert len(sheets) <= 1 + 2 * count * figures[0].size // SHEET_PIXELS
    scale = SIDE_PX / max(shape)
    for place, figure in enumerate(figures):
        found = re.search(r"sheet-(\d+).*position: (-?[\d.]+)px (-?[\d.]+)px", sprites.drawn(place))
        assert found
        sheet, left, top = int(found[1]), round(-float(found[2]) / scale), round(-float(found[3]) / scale)
        seen = sheets[sheet][top : top + shape[0], left : left + shape[1]]
        assert np.array_equal(seen, figure_picture(figure))
