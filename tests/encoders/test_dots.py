"""Cells as characters, bits, ASCII Braille and dots on the grid."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from encoders import (
    GridShape,
    InvalidText,
    LayoutError,
    Presentation,
    bits_to_cell,
    brf_to_cells,
    cell_to_bits,
    cells_to_brf,
    read_cells,
)
from encoders.braille.dots import blocks
from encoders.braille.layout import Layout
from encoders.braille.presentation import presenter


def encoding_of(layout: Layout) -> dict[str, int]:
    return {
        "dots": 6 if layout.height == 3 else 8,
        "cell_gap": layout.cell_gap,
        "line_gap": layout.line_gap,
        "lines": layout.lines,
        "cells_per_line": layout.cells_per_line,
    }


@given(st.integers(0, 255))
def test_bits_and_cells_are_inverse(bits):
    assert cell_to_bits(bits_to_cell(bits)) == bits
    assert ord(bits_to_cell(bits)) == 0x2800 + bits


@pytest.mark.parametrize("bad", ["", "a", "\u27ff", "\u2900", "⠁⠁"])
def test_what_is_no_cell_is_refused(bad):
    with pytest.raises(ValueError, match="cell"):
        cell_to_bits(bad)


@pytest.mark.parametrize("bad", [-1, 256])
def test_what_are_no_bits_is_refused(bad):
    with pytest.raises(ValueError, match="bits"):
        bits_to_cell(bad)


def test_dots_stand_where_iso_11548_has_them():
    # n = dots 1345, and dots 7, 8 in the fourth row.
    assert blocks(3)[cell_to_bits("⠝")].tolist() == [[True, True], [False, True], [True, False]]
    assert blocks(4)[0b11000000].tolist() == [[False, False], [False, False], [False, False], [True, True]]
    assert blocks(4).sum() == 256 * 4


@given(st.text(st.characters(min_codepoint=0x2800, max_codepoint=0x283F) | st.sampled_from("\n\f")))
def test_brf_round_trip(cells):
    assert brf_to_cells(cells_to_brf(cells)) == cells


@given(st.binary())
def test_brf_reading_is_total(data):
    readable = {*range(0x20, 0x7F), *b"\t\n\f\r"}
    bad = next((at for at, byte in enumerate(data.rstrip(b"\x1a")) if byte not in readable), None)
    if bad is None:
        assert all(0x2800 <= ord(cell) <= 0x283F or cell in "\n\f" for cell in brf_to_cells(data))
    else:
        with pytest.raises(InvalidText, match=f"at byte {bad} "):
            brf_to_cells(data)


def test_brf_known_text_and_case():
    assert brf_to_cells(b",HELLO #123\r\n\x0c,A\x1a") == "⠠⠓⠑⠇⠇⠕⠀⠼⠂⠆⠒\n\f⠠⠁"
    assert brf_to_cells(b",hello") == brf_to_cells(b",HELLO")


def test_brf_names_the_offset():
    with pytest.raises(InvalidText, match=r"at byte 2 \(0xe9\)"):
        brf_to_cells(b"AB\xe9")
    with pytest.raises(InvalidText, match="character 1"):
        cells_to_brf("⠁⡀")


@given(
    st.integers(3, 14), st.integers(2, 14), st.integers(0, 2), st.integers(0, 2), st.sampled_from([3, 4]),
    st.sampled_from(list(Presentation)), st.data(),
)  # fmt: skip
def test_dots_read_back_are_the_cells_shown(rows, cols, cell_gap, line_gap, height, presentation, data):
    if rows < height:
        with pytest.raises(LayoutError):
            Layout(GridShape(rows, cols), height, cell_gap, line_gap)
        return
    layout = Layout(GridShape(rows, cols), height, cell_gap, line_gap)
    highest = 0x283F if height == 3 else 0x28FF
    char = st.characters(min_codepoint=0x2800, max_codepoint=highest)
    page = data.draw(st.text(char, min_size=layout.capacity, max_size=layout.capacity))
    shown = presenter(layout, presentation)(page)
    felt = np.zeros((rows, cols), dtype=int)
    for part in shown.parts:
        assert part.amplitude.dtype == np.complex128
        assert not part.amplitude.flags.writeable
        felt += part.amplitude.real.astype(int)
    assert felt.max() <= 1, "no dot is shown in two parts"
    assert felt.sum() == sum(bin(ord(cell) & 0xFF).count("1") for cell in page)
    assert read_cells(felt.astype(bool), encoding_of(layout)) == shown.cells
    assert shown.cells.replace("\n", "") == page


def test_six_by_six_is_the_board_of_six_cells():
    layout = Layout(GridShape(6, 6), 3)
    (pattern,) = presenter(layout, Presentation.TOGETHER)("⠁⠂⠄⠈⠐⠠").parts
    assert pattern.amplitude.real.astype(int).tolist() == [
        [1, 0, 0, 0, 0, 0],
        [0, 0, 1, 0, 0, 0],
        [0, 0, 0, 0, 1, 0],
        [0, 1, 0, 0, 0, 0],
        [0, 0, 0, 1, 0, 0],
        [0, 0, 0, 0, 0, 1],
    ]


def test_parts_go_by_row_and_by_dot():
    layout = Layout(GridShape(6, 6), 3)
    page = "⠿⠿⠿⠀⠀⠀"
    rows = presenter(layout, Presentation.BY_ROW)(page).parts
    assert [np.flatnonzero(part.amplitude.any(axis=1)).tolist() for part in rows] == [[0], [1], [2]]
    dots = presenter(layout, Presentation.BY_DOT)(page).parts
    places = [np.argwhere(part.amplitude)[0].tolist() for part in dots]
    assert places == [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]], "dots 1..6 in this order"
    assert all(part.amplitude.sum() == 3 for part in dots), "in all cells at once"


def test_a_blank_page_is_one_part():
    layout = Layout(GridShape(6, 6), 3)
    assert all(len(presenter(layout, way)("⠀" * 6).parts) == 1 for way in Presentation)


def test_read_cells_names_the_size_it_needs():
    with pytest.raises(LayoutError, match="at least 6 x 6"):
        read_cells(np.zeros((5, 6), dtype=bool), encoding_of(Layout(GridShape(6, 6), 3)))
