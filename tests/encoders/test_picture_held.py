"""What a blur does not see and a finger does: solid bodies, small parts, straight edges, the form of framed signs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from encoders import GridShape, PictureOptions, encode_picture

ICONS = Path(__file__).resolve().parents[2] / "samples/icons"
SIX, TWELVE = GridShape(6, 6), GridShape(12, 12)

# Arrows of a set of outlined icons: up, and the same turned by quarters.
ARROW = '<path d="m16 12-4-4-4 4M12 16V8"/>'
CIRCLE, SQUARE = '<circle cx="12" cy="12" r="10"/>', '<rect width="18" height="18" x="3" y="3" rx="2"/>'
BAR = '<path d="M8 12h8"/>'


def felt(drawing: str, shape: GridShape, candidates: int = 1) -> np.ndarray:
    """The best pattern of strokes two units wide in a box of 24."""
    start = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 24 24" fill="none" stroke="#000" stroke-width="2"'
    data = f'{start} stroke-linecap="round" stroke-linejoin="round">{drawing}</svg>'.encode()
    return np.array(
        encode_picture(data, shape, PictureOptions(candidates=candidates)).report.frames[0].candidates[0].dots
    )


def turned(quarters: int) -> str:
    return f'<g transform="rotate({90 * quarters} 12 12)">{ARROW}</g>'


def test_a_triangle_has_no_hole_and_a_sun_has_rays() -> None:
    play, sun = (encode_picture(ICONS / f"{name}.svg", SIX).report.frames[0] for name in ("play", "sun"))
    covered = play.figure.reshape(6, 4, 6, 4).mean(axis=(1, 3))
    assert play.candidates[0].dots[covered >= 0.65].all()
    wanted = ["..oo..", ".o..o.", "o.oo.o", "o.oo.o", ".o..o.", "..oo.."]
    assert ["".join(".o"[dot] for dot in row) for row in sun.candidates[0].dots.astype(int)] == wanted


@pytest.mark.parametrize("frame", [CIRCLE, SQUARE])
def test_a_framed_arrow_points_where_it_points(frame: str) -> None:
    patterns = [felt(frame + turned(quarters), SIX) for quarters in range(4)]
    for quarters, dots in enumerate(patterns):
        assert np.array_equal(dots, np.rot90(patterns[0], -quarters))
        assert np.array_equal(dots, felt(turned(quarters), SIX))
    assert len({dots.tobytes() for dots in patterns}) == 4


def test_a_frame_stays_around_a_sign_without_a_form_and_where_patterns_are_chosen_from() -> None:
    for dots in (felt(CIRCLE + BAR, TWELVE), felt(CIRCLE + ARROW, SIX, candidates=8)):
        edge = np.concatenate([dots[0], dots[-1], dots[:, 0], dots[:, -1]])
        assert edge.sum() >= len(edge) / 2


@pytest.mark.parametrize("name", ["eye", "bell"])
def test_a_slash_tells_an_icon_from_the_same_without(name: str) -> None:
    drawings = {
        "eye": '<path d="M2 12c4-9 16-9 20 0c-4 9-16 9-20 0"/><circle cx="12" cy="12" r="3"/>',
        "bell": '<path d="M3.3 15.3A1 1 0 0 0 4 17h16C19 14 18 12 18 8A6 6 0 0 0 6 8c0 4-1 6-2.7 7.3"/>',
    }
    plain, crossed = felt(drawings[name], SIX), felt(drawings[name] + '<path d="m2 2 20 20"/>', SIX)
    assert (plain != crossed).sum() >= 4
    assert np.diagonal(crossed).all()


def test_a_line_between_two_rows_is_a_line_and_no_comb() -> None:
    # Each side of the square covers half of two rows or columns of dots.
    dots = felt('<path d="M3 3h18v18H3zM3 12h18"/>', TWELVE)
    for row in dots:
        assert len(set(row[3:9].tolist())) == 1
