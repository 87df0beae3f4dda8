"""Drawing SVG: what is let through, what is left out, and nothing outside the document is read."""

from __future__ import annotations

import base64
import contextlib
import gzip
import http.server
import io
import threading
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from encoders.picture.errors import EmptyPicture, PictureBroken, PictureError, PictureTooLarge
from encoders.picture.limits import PictureLimits
from encoders.picture.reading import Picture, read_picture
from encoders.picture.vector import tame_svg

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 8 8">'
DOT = '<rect width="1" height="1"/>'


def drawn(body: str, head: str = HEAD, px: int = 64) -> Picture:
    return read_picture((head + body + "</svg>").encode(), px)


def alpha(picture: Picture) -> np.ndarray:
    return picture.frames[0].light[..., 3]


def test_a_drawing() -> None:
    picture = drawn('<rect width="8" height="4" fill="#f00"/>')
    assert (picture.kind, picture.size, picture.notes) == ("SVG", (64, 64), ())
    light = picture.frames[0].light
    np.testing.assert_array_equal(light[:32], np.broadcast_to(np.array([1, 0, 0, 1], np.float32), (32, 64, 4)))
    np.testing.assert_array_equal(light[32:], 0)


def test_svgz_and_utf16_and_no_namespace_and_a_comment_first() -> None:
    text = HEAD + '<rect width="8" height="4"/></svg>'
    plain = alpha(read_picture(text.encode(), 64))
    for data in (
        gzip.compress(text.encode()),
        ('<?xml version="1.0" encoding="utf-16"?>' + text).encode("utf-16"),
        text.replace('xmlns="http://www.w3.org/2000/svg" ', "").encode(),
        b"\xef\xbb\xbf<!-- drawn by hand -->\n<!DOCTYPE svg>" + text.encode(),
    ):
        np.testing.assert_array_equal(alpha(read_picture(data, 64)), plain)


def test_the_longer_side_has_the_pixels_asked_for() -> None:
    for box, size in (("0 0 8 4", (32, 64)), ("0 0 4 8", (64, 32)), ("0 0 1000 1", (1, 64))):
        assert drawn(DOT, f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}">').size == size
    assert drawn(DOT, '<svg xmlns="http://www.w3.org/2000/svg" width="100000" height="100000">').size == (64, 64)


@pytest.mark.parametrize("link", ["href", "xlink:href"])
@pytest.mark.parametrize("element", ["image", "feImage", "use"])
def test_no_file_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, link: str, element: str) -> None:
    Image.new("RGB", (8, 8), "red").save(tmp_path / "secret.png")
    (tmp_path / "secret.svg").write_text(HEAD + '<rect id="a" width="8" height="8"/></svg>')
    monkeypatch.chdir(tmp_path)
    for name in ("secret.png", "secret.svg", "secret.svg#a"):
        for target in (name, f"./{name}", str(tmp_path / name), f"file://{tmp_path / name}"):
            made = drawn(f'<rect x="7" y="7" width="1" height="1"/><{element} {link}="{target}" width="8" height="8"/>')
            assert alpha(made)[:50, :50].max() == 0
            assert made.notes


def test_no_file_is_read_by_way_of_embedded_svg_styles_and_entities(tmp_path: Path) -> None:
    secret = tmp_path / "secret.png"
    Image.new("RGB", (8, 8), "red").save(secret)
    inner = f'{HEAD}<image href="{secret}" width="8" height="8"/></svg>'
    coded = base64.b64encode(inner.encode()).decode()
    for body in (
        f'<image href="data:image/svg+xml;base64,{coded}" width="8" height="8"/>',
        f'<style>rect {{ fill: url({secret}); }} @import url("{secret}");</style><rect width="7" height="7"/>',
        f'<rect width="7" height="7" fill="url(file://{secret})"/>',
        f'<rect width="7" height="7" style="fill:url(\'{secret}#a\')"/>',
    ):
        assert alpha(drawn(body + '<rect x="7" y="7" width="1" height="1"/>'))[:50, :50].max() == 0
    for system in (f"file://{secret}", "http://127.0.0.1:9/"):
        document = f'<!DOCTYPE svg [<!ENTITY e SYSTEM "{system}">]>{HEAD}<style>&e;</style>{DOT}</svg>'
        with contextlib.suppress(PictureBroken):
            assert "secret" not in tame_svg("a", document.encode(), PictureLimits())[0]


def test_no_address_is_fetched() -> None:
    asked: list[str] = []

    class Server(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append(self.path)
            self.send_response(404)
            self.end_headers()

    with http.server.HTTPServer(("127.0.0.1", 0), Server) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/x.png"
        picture = drawn(f'{DOT}<image href="{address}" width="8" height="8"/><style>@import "{address}";</style>')
        server.shutdown()
    assert asked == []
    assert picture.notes == ("references outside the document are not followed", "<image> is left out")


def test_text_is_left_out_and_said() -> None:
    picture = drawn(f'{DOT}<text x="2" y="8" font-size="8">A</text>')
    assert alpha(picture)[:, 16:].max() == 0
    assert picture.notes == ("<text> is left out",)
    with pytest.raises(EmptyPicture, match=r"draws no shape \(<text> is left out\); turn text into paths"):
        drawn('<text y="8" font-size="8">A</text>')


def test_an_embedded_bitmap_is_drawn() -> None:
    buffer = io.BytesIO()
    Image.new("RGB", (8, 8), "blue").save(buffer, "PNG")
    coded = base64.b64encode(buffer.getvalue()).decode()
    light = drawn(f'<image xlink:href="data:image/png;base64,{coded}" width="8" height="8"/>').frames[0].light
    np.testing.assert_allclose(light[20:40, 20:40], np.broadcast_to([0, 0, 1, 1], (20, 20, 4)), atol=0.01)
    assert drawn(DOT + '<image href="data:image/png;base64,AAAA" width="8" height="8"/>').notes


def test_dashes_patterns_filters() -> None:
    solid = alpha(drawn('<path d="M0 4H8" stroke="#000" stroke-width="2"/>'))
    dashed = '<path d="M0 4H8" stroke="#000" stroke-width="2" stroke-dasharray=".0001"/>'
    np.testing.assert_array_equal(alpha(drawn(dashed)), solid)
    dashed = '<path d="M0 4H8" style="stroke:#000;stroke-dasharray:1,1;stroke-width:2;filter:url(#f)"/>'
    np.testing.assert_array_equal(alpha(drawn(dashed)), solid)
    body = '<pattern id="p" width="1e9" height="1e9"><rect width="1" height="1"/></pattern>'
    picture = drawn(body + '<rect width="8" height="8" fill="url(#p)"/>')
    np.testing.assert_allclose(
        picture.frames[0].light, [[[0.2158, 0.2158, 0.2158, 1]]] * np.ones((64, 64, 1)), atol=1e-3
    )
    assert picture.notes == ("patterns are drawn as grey", "<pattern> is left out")
    blurred = (
        '<filter id="f"><feGaussianBlur stdDeviation="1000"/></filter><rect filter="url(#f)" width="8" height="4"/>'
    )
    assert alpha(drawn(blurred))[:32].min() == 1


def test_references_inside_the_document_work() -> None:
    body = '<defs><g id="a"><rect width="4" height="4"/></g></defs><use xlink:href="#a" x="4" y="4"/>'
    expected = np.zeros((64, 64))
    expected[32:, 32:] = 1
    np.testing.assert_array_equal(alpha(drawn(body)), expected)
    clipped = '<clipPath id="c"><rect x="4" y="4" width="4" height="4"/></clipPath>'
    np.testing.assert_array_equal(alpha(drawn(clipped + '<rect width="8" height="8" clip-path="url(#c)"/>')), expected)
    styled = "<style>.a { fill: none } /* url(x) */ .b { clip-path: url(#c) }</style>" + clipped
    both = styled + '<rect class="a" width="8" height="8"/><rect class="b" width="8" height="8"/>'
    np.testing.assert_array_equal(alpha(drawn(both)), expected)


def nested(count: int) -> str:
    chain = "".join(f'<g id="a{i}">' + f'<use href="#a{i - 1}"/>' * 10 + "</g>" for i in range(1, count))
    return f'<defs><g id="a0">{DOT}</g>{chain}</defs><use href="#a{count - 1}"/>'


def zigzag(points: int) -> str:
    return "M" + " ".join(f"{number % 8} {number % 7}" for number in range(points))


@pytest.mark.parametrize(
    ("body", "error", "says"),
    [
        (f'<path d="{zigzag(20_001)}"/>', PictureTooLarge, "of 20001 points; at most 20000 are drawn, simplify"),
        (f'<polygon points="{zigzag(20_001)[1:]}"/>', PictureTooLarge, "of 20001 points"),
        (f'<path d="{zigzag(15_000)}"/>' * 2, PictureTooLarge, "of 21213 points"),
        (f'<path id="a" d="{zigzag(1000)}"/>' + '<use href="#a"/>' * 400, PictureTooLarge, "of 20024 points"),
        (f"<{'x' * 9999}/>" + "".join(f"<x{number}/>" for number in range(999)), EmptyPicture, "<x18> is left out"),
        (nested(8), PictureTooLarge, "more than 20000 elements"),
        (nested(8).replace(DOT, ""), PictureTooLarge, "more than 20000 elements"),
        ("<g opacity='.5'>" * 500 + DOT + "</g>" * 500, PictureTooLarge, "inside one another"),
        ('<path d="M0 0L1e38 1e38"/>', PictureTooLarge, "d: the number 1e38 is above 1e"),
        ('<rect width="8" height="8" style="stroke-width:10000000"/>', PictureTooLarge, "number 10000000"),
        ('<g transform="scale(1e20)"><rect width="1" height="1"/></g>', PictureTooLarge, "transform: the number 1e20"),
        (f"{DOT}<g>", PictureBroken, "not XML"),
        ("&nothing;", PictureBroken, "not XML"),
        ("", EmptyPicture, "draws no shape"),
        ("<defs></defs>", EmptyPicture, "draws no shape"),
    ],
)  # fmt: skip
def test_refusals(body: str, error: type[PictureError], says: str) -> None:
    with pytest.raises(error, match=says) as caught:
        drawn(body)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize(
    "body",
    [
        f'<path d="{zigzag(20_000)}"/>',
        f'<path d="{zigzag(5000)}"/>' * 9,
        f'<path d="{zigzag(100)}"/>' * 1000,
        f'<g id="b"><path id="a" d="{zigzag(20_000)}"/></g>',
    ],
)
def test_as_many_points_as_are_drawn_in_time(body: str) -> None:
    assert alpha(drawn(body)).any()


def test_entities_that_grow_without_end_are_refused() -> None:
    entities = '<!ENTITY a0 "aaaaaaaaaa">' + "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 10))
    with pytest.raises(PictureError, match="picture"):
        read_picture(f"<!DOCTYPE svg [{entities}]>{HEAD}<style>&a9;</style>{DOT}</svg>".encode(), 64)


@pytest.mark.parametrize("size", ['width="0" height="5"', 'viewBox="0 0 0 0"', 'viewBox="0 0 nan 1"', 'width="-5"'])
def test_odd_sizes_are_drawn_or_refused(size: str) -> None:
    with contextlib.suppress(PictureError):
        assert max(drawn(DOT, f'<svg xmlns="http://www.w3.org/2000/svg" {size}>').size) <= 64


def test_a_style_sheet_that_comes_in_pieces_is_as_tame() -> None:
    path = '<path d="M0 4H8"/>'
    solid = alpha(drawn(f"<style>path{{stroke:#000;stroke-width:2}}</style>{path}"))
    for dashes in ("stroke-d&#97;sharray:1,1", "stroke-d<g/>asharray:1,1", "stroke-dash<!-- -->array:1,1"):
        sheet = f"<style>path{{stroke:#000;stroke-width:2;{dashes}}}</style>"
        np.testing.assert_array_equal(alpha(drawn(sheet + path)), solid)


PIXEL = "data:image/gif;base64,R0lGODlhAQABAIAAAAAAAP///yH5BAEAAAAALAAAAAABAAEAAAIBRAA7"


@pytest.mark.parametrize(
    "body",
    [
        "<style>zz g g g g g g rect{fill:red}</style>" + "<g>" * 45 + "<rect/>" * 5 + "</g>" * 45,
        "<style>zz>g+g~g g g g rect{fill:red}</style>" + "<g>" * 45 + "<rect/>" * 5 + "</g>" * 45,
        "<style>" + "rect{fill:red}" * 5000 + "</style>" + "<rect/>" * 6000,
        "<style>" + "a," * 5000 + "rect{fill:red}</style>" + "<rect/>" * 6000,
        "<style>rect{" + "fill:red;" * 5000 + "}</style>" + "<rect/>" * 6000,
        '<rect style="' + "fill:red;" * 20_001 + '"/>',
        f'<image href="{PIXEL}"/>' * 401,
        f'<g id="a"><image href="{PIXEL}"/></g>' + '<use href="#a"/>' * 400,
    ],
)
def test_what_takes_long_is_refused_before_it_is_drawn(body: str) -> None:
    with pytest.raises(PictureTooLarge, match="takes as long to draw as a path of"):
        tame_svg("a", f"{HEAD}{body}</svg>".encode(), PictureLimits())


@pytest.mark.parametrize("piece", ["url(", "/* ", "marker", "stroke-dash ", "filter ", "a{", "a", "1", ",", "@import "])
@pytest.mark.parametrize("head", ["", "url(", "{"])
def test_a_long_style_sheet_is_read_once(head: str, piece: str) -> None:
    """Of a megabyte each; an expression that goes back to where it was takes hours."""
    sheet = head + piece * (900_000 // len(piece))
    with contextlib.suppress(PictureError):
        tame_svg("a", f"{HEAD}<style>{sheet}</style>{DOT}</svg>".encode(), PictureLimits())


def test_comments_hide_nothing_from_what_is_left_out() -> None:
    sheet = "<style>path{stroke:#000;stroke-width:2;stroke-dasharray/* */:1,1}</style>"
    text, _ = tame_svg("a", f"{HEAD}{sheet}{DOT}</svg>".encode(), PictureLimits())
    assert "dash" not in text


def test_bitmaps_have_a_bound_together() -> None:
    buffer = io.BytesIO()
    Image.new("1", (1500, 1500)).save(buffer, "PNG")
    image = f'<image href="data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}"/>'
    tame_svg("a", f"{HEAD}{image}</svg>".encode(), PictureLimits())
    with pytest.raises(PictureTooLarge, match="embedded bitmaps of more than 4000000 pixels"):
        tame_svg("a", f"{HEAD}{image * 2}</svg>".encode(), PictureLimits())


def test_sheets_of_drawing_programs_are_taken() -> None:
    rules = "".join(
        f".cls-{number}, svg g .k{number} > path {{fill: #0{number:03x}; stroke: none;}}" for number in range(99)
    )
    body = f"<style>{rules}</style>" + '<g><g><path class="cls-1" d="M0 0H8V8z"/></g></g>' * 500
    tame_svg("a", f"{HEAD}{body}</svg>".encode(), PictureLimits())
