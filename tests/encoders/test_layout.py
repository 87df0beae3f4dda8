"""Words on pages: nothing lost, nothing doubled, and the dots alone say where words end."""

from collections.abc import Collection

import pytest
from hypothesis import example, given, settings, strategies as st

from encoders import GoesOn, GridShape, LayoutError, join_pages
from encoders.braille.filling import paginate
from encoders.braille.joining import unmarked
from encoders.braille.layout import NARROW, Cut, Layout, PlacedWord, cut_anywhere

# Blank-free cells with many hyphens, the one cell that is special.
WORD = st.text(st.sampled_from("⠁⠃⠤"), min_size=1, max_size=30)


def words_of(cells: list[str], glued: Collection[int] = frozenset()) -> list[PlacedWord]:
    placed, at = [], 0
    for index, word in enumerate(cells):
        joined = index in glued and index > 0
        if index and not joined:
            at += 1
        placed.append(PlacedWord(word, word, at, at + len(word), None, at, 0, joined))
        at += len(word)
    return placed


def every_other(layout: Layout):
    """Cuts after every second cell, with the hyphen, and one cell restated where there is room for it."""

    def cut(word: PlacedWord, room: int) -> Cut:
        most = room - len(layout.hyphen)
        again = word.cells[0] if layout.run >= 4 else ""
        at = most // 2 * 2 if most >= 2 + len(again) else most
        first = word.cells[:at] + layout.hyphen
        return Cut(max(0, len(word.text) - len(word.cells) + at), at, first, layout.hyphen, again)

    return cut


def lined(page: str, layout: Layout) -> str:
    width = layout.cells_per_line
    return "\n".join(page[at : at + width] for at in range(0, len(page), width))


@given(
    st.lists(WORD, min_size=1, max_size=20), st.sets(st.integers(1, 19)), st.integers(1, 3), st.integers(1, 12),
    st.booleans(),
)  # fmt: skip
@example(["⠁⠁⠁⠁⠁⠤", "⠁"], {1}, 2, 3, True)
@example(["⠤" * 30, "⠤⠤", "⠁"], {1}, 2, 3, True)
@example(["⠁⠁⠁⠁⠁⠤", "⠁⠁⠁⠁⠁⠁", "⠁⠁⠁⠁⠁⠁"], set(), 2, 3, True)
@settings(max_examples=400)
def test_pages_join_to_the_words_again(words, glued, lines, width, hyphenating):
    layout = Layout(GridShape(3 * lines, 2 * width), 3, hyphen="⠤" if hyphenating and lines * width >= 4 else "")
    if layout.hyphen and layout.run < 4:
        return
    placed = words_of(words, glued)
    pages = list(paginate(placed, layout, every_other(layout)))
    expected = "".join(("" if word.glued else "⠀") + word.cells for word in placed).strip("⠀")
    encoding = {"run": layout.run, "hyphen": layout.hyphen}
    shown = [lined(page.cells, layout) for page in pages]
    assert join_pages(shown, encoding, [page.goes_on for page in pages]) == expected
    assert all(len(page.cells) == layout.capacity for page in pages)
    assert [page.end_of_paragraph for page in pages] == [False] * (len(pages) - 1) + [True]
    if layout.run > 1:
        assert all(page.cells.strip("⠀") for page in pages), "no page is there for a blank only"


@given(st.lists(WORD, min_size=1, max_size=20), st.integers(1, 3), st.integers(1, 12))
def test_without_notes_the_dots_alone_join_the_pages(words, lines, width):
    layout = Layout(GridShape(3 * lines, 2 * width), 3)
    placed = words_of(words)
    pages = [lined(page.cells, layout) for page in paginate(placed, layout, cut_anywhere)]
    assert join_pages(pages, {"run": layout.run, "hyphen": ""}) == "⠀".join(words)


@given(st.lists(WORD, min_size=1, max_size=20), st.integers(1, 3), st.integers(1, 12))
def test_every_cell_is_shown_once_in_order_and_spans_cover_the_source(words, lines, width):
    layout = Layout(GridShape(3 * lines, 2 * width), 3)
    placed = words_of(words)
    pages = list(paginate(placed, layout, cut_anywhere))
    assert "".join(page.cells for page in pages).replace("⠀", "") == "".join(words)
    covered = [at for page in pages for at in range(page.start, page.end)]
    source = {at for word in placed for at in range(word.start, word.end)}
    assert source <= set(covered)
    assert covered == sorted(set(covered)), "no position is shown on two pages"


@given(st.lists(WORD, min_size=1, max_size=20), st.integers(1, 3), st.integers(1, 12))
def test_only_words_longer_than_a_run_are_split(words, lines, width):
    layout = Layout(GridShape(3 * lines, 2 * width), 3)
    split = [word.cells for page in paginate(words_of(words), layout, cut_anywhere) for word, _ in page.cuts]
    assert {word for word in words if len(word) > layout.run} == {word for word in split if len(word) > layout.run}
    # A word that fills a run may meet the blank owed to the word before it.
    assert all(len(word) >= layout.run for word in split)


def test_a_word_that_ends_in_the_last_cell_owes_a_blank_only_without_hyphens():
    for hyphen, then in (("", "⠀⠸⠺⠀⠀⠀"), ("⠤", "⠸⠺⠀⠀⠀⠀")):
        layout = Layout(GridShape(6, 6), 3, hyphen=hyphen)
        pages = paginate(words_of(["⠠⠓⠑⠇⠇⠕", "⠸⠺"]), layout, cut_anywhere)
        assert [page.cells for page in pages] == ["⠠⠓⠑⠇⠇⠕", then]


def test_a_word_keeps_to_its_line_when_it_fits_one():
    layout = Layout(GridShape(6, 6), 3)
    pages = [page.cells for page in paginate(words_of(["⠁⠁", "⠃⠃", "⠉⠉⠉⠉"]), layout, cut_anywhere)]
    assert pages == ["⠁⠁⠀⠃⠃⠀", "⠉⠉⠉⠉⠀⠀"]


def test_what_was_added_at_a_cut_is_noted_and_taken_out_again():
    layout, encoding = Layout(GridShape(6, 6), 3, hyphen="⠤"), {"run": 6, "hyphen": "⠤"}
    # Three cells, one of them only at the end of a word; then the hyphen. One cell is left out, one restated.
    cut = Cut(4, 4, "⠼⠃⠒⠤", "⠤", "⠼", "⠒", "⠃⠃")
    pages = list(paginate(words_of(["⠼" + "⠃" * 7]), layout, lambda *_: cut))
    assert [page.cells for page in pages] == ["⠼⠃⠒⠤⠀⠀", "⠼⠃⠃⠃⠃⠀"]
    goes_on = [page.goes_on for page in pages]
    assert goes_on == [(GoesOn(0, "⠤", "⠼", "⠒", "⠃⠃"),), ()]
    assert [[one for _, one in page.cuts] for page in pages] == [[cut], []]
    assert join_pages([page.cells for page in pages], encoding, goes_on) == "⠼⠃⠃⠃⠃⠃⠃⠃"
    # What was to be there and is not felt is not taken out, so that it makes a difference.
    assert join_pages(["⠼⠃⠒⠀⠀⠀", pages[1].cells], encoding, goes_on) == "⠼⠃⠒⠀⠼⠃⠃⠃⠃"
    assert join_pages([pages[0].cells, "⠃⠃⠃⠃⠀⠀"], encoding, goes_on) == "⠼⠃⠀⠃⠃⠃⠃"
    # Alone the first page ends as a word does, without the hyphen.
    assert unmarked(pages[0].cells, encoding, pages[0].goes_on) == "⠼⠃⠒"


def test_a_first_part_without_a_sign_ends_with_its_run():
    layout, cut = Layout(GridShape(6, 6), 3), Cut(4, 4, "⠁" * 4)
    pages = [page.cells for page in paginate(words_of(["⠁" * 8]), layout, lambda *_: cut)]
    assert pages == ["⠀⠀⠁⠁⠁⠁", "⠁⠁⠁⠁⠀⠀"]


def test_no_page_is_only_the_blank_that_a_word_owes_the_next():
    layout = Layout(GridShape(6, 6), 3)
    pages = [page.cells for page in paginate(words_of(["⠁" * 6, "⠃" * 6]), layout, cut_anywhere)]
    assert pages == ["⠁⠁⠁⠁⠁⠁", "⠀⠃⠃⠃⠃⠃", "⠃⠀⠀⠀⠀⠀"]


def test_wide_grids_are_filled_line_by_line():
    layout = Layout(GridShape(6, 2 * NARROW), 3)
    pages = paginate(words_of(["⠁" * 5, "⠃" * 5, "⠉" * 2]), layout, cut_anywhere)
    assert [lined(page.cells, layout) for page in pages] == ["⠁⠁⠁⠁⠁⠀⠀⠀\n⠃⠃⠃⠃⠃⠀⠉⠉"]


def test_cells_on_grids():
    assert (Layout(GridShape(6, 6), 3).lines, Layout(GridShape(6, 6), 3).cells_per_line) == (2, 3)
    spaced = Layout(GridShape(6, 6), 3, cell_gap=2, line_gap=1)
    assert (spaced.lines, spaced.cells_per_line) == (1, 2)
    large = Layout(GridShape(40, 96), 3)
    assert (large.lines, large.cells_per_line, large.run) == (13, 48, 48)


@pytest.mark.parametrize(
    ("rows", "cols", "gap", "says"), [(2, 6, 0, "no room"), (6, 1, 0, "no room"), (6, 6, -1, "cell-gap")]
)
def test_impossible_layouts_are_refused(rows, cols, gap, says):
    with pytest.raises(LayoutError, match=says):
        Layout(GridShape(rows, cols), 3, cell_gap=gap)
