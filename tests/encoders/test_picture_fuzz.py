"""Mutated files end in a scene or in one line, within bounds of work and memory."""

from __future__ import annotations

import importlib
import io
import resource
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from encoders.picture.errors import PictureError
from encoders.picture.limits import PictureLimits
from encoders.picture.pictures import encode_picture
from encoders.scene import GridShape

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
LIMITS = PictureLimits(pixels=4_000_000, frames=20)
# The dearest of 20,000 files takes 92,000 calls.
MOST_CALLS = 200_000
TOKENS = (
    b"1e9", b"-1", b"0", b"nan", b"99999", b"1e-9", b"url(#a)", b"#a", b"<g>", b"</g>", b"<use href='#a'/>", b"%",
    b"&lt;", b"<!--", b"]]>", b"opacity='.5'", b"mask='url(#a)'", b"transform='scale(1000)'", b"id='a'", b"A9 9 0 1 1 ",
    b"stroke='red' stroke-width='9'", b"<clipPath id='a'>", b"<mask id='a'>", b"\xff\xfe", b"\0",
)  # fmt: skip
RICH = b"""<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 24 24" width="2em"><defs><linearGradient id="g">
<stop offset="0" stop-color="red"/><stop offset="1"/></linearGradient><mask id="m">
<rect width="20" height="9" fill="#fff"/></mask>
<clipPath id="c"><circle cx="12" cy="12" r="9"/></clipPath>
<g id="a"><path d="M1 1h8v8q4 4 9 9z"/></g></defs>
<style>.k{fill:url(#g);stroke:#222;stroke-width:1.5}</style><g opacity=".6" transform="rotate(12 3 4) skewX(3)">
<use href="#a" x="3"/><ellipse class="k" cx="9" cy="9" rx="7" ry="3" mask="url(#m)"/></g>
<polygon points="1,2 3,4 20 9" clip-path="url(#c)" stroke="#000" stroke-dasharray="1 2"
stroke-linejoin="round"/></svg>"""


def seeds() -> list[bytes]:
    grey = np.random.default_rng(0).integers(0, 256, (20, 20), np.uint8)
    images = [Image.fromarray(grey), Image.fromarray(grey).convert("P"), Image.fromarray(np.dstack([grey] * 4))]
    found = [RICH, (SAMPLES / "icons" / "alarm.svg").read_bytes(), (SAMPLES / "icons" / "cart.svg").read_bytes()]
    for image in images:
        buffer = io.BytesIO()
        image.save(buffer, "PNG")
        found.append(buffer.getvalue())
    buffer = io.BytesIO()
    images[0].save(
        buffer, "GIF", save_all=True, append_images=[images[0].rotate(90), images[0].rotate(180)], duration=50
    )
    return [*found, buffer.getvalue()]


def mutated(count: int, seed: int) -> Iterator[bytes]:
    chance = np.random.default_rng(seed)
    sources = seeds()
    for index in range(count):
        data = bytearray(sources[index % len(sources)])
        for _ in range(int(chance.integers(1, 6))):
            place = int(chance.integers(0, len(data)))
            match int(chance.integers(0, 5)):
                case 0:
                    data[place] = int(chance.integers(0, 256))
                case 1:
                    data[place] ^= 1 << int(chance.integers(0, 8))
                case 2:
                    del data[place : place + int(chance.integers(1, 20))]
                case 3:
                    end = place + int(chance.integers(1, 60))
                    data[place:place] = data[place:end]
                case _:
                    data[place:place] = TOKENS[int(chance.integers(0, len(TOKENS)))]
            if not data:
                break
        yield bytes(data)


class Calls:
    """Counts the functions called inside a `with`: work that is the same on every machine, busy or not."""

    def __init__(self) -> None:
        self.made = 0

    def __enter__(self) -> None:
        sys.setprofile(self._count)

    def __exit__(self, *error: object) -> None:
        sys.setprofile(None)

    def _count(self, frame: object, event: str, argument: object) -> None:
        self.made += event in ("call", "c_call")


def feed(count: int, seed: int) -> tuple[int, int]:
    """Encode mutated files; how many made a scene, and how many were refused."""
    # Loading it is no work of a picture's.
    importlib.import_module("scipy.ndimage")
    made = refused = 0
    for data in mutated(count, seed):
        refusal, calls = "", Calls()
        try:
            with calls:
                scene = encode_picture(data, GridShape(6, 6), limits=LIMITS)
        except PictureError as error:
            refusal = str(error)
            refused += 1
        else:
            assert all(np.isfinite(frame.pattern.amplitude).all() for frame in scene.frames)
            made += 1
        assert "\n" not in refusal
        assert len(refusal) < 400
        assert calls.made < MOST_CALLS, data
    return made, refused


def test_some_hundred_mutated_files() -> None:
    made, refused = feed(420, seed=1)
    assert made > 40
    assert refused > 40


@pytest.mark.slow
def test_twenty_thousand_mutated_files() -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    made, refused = feed(20_000, seed=2)
    assert made + refused == 20_000
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 500_000
