"""Render the sample textures and photographs: ``python samples/make_pictures.py``. Same bytes on every run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

HERE = Path(__file__).parent
Floats = NDArray[np.float64]


def save(path: Path, colour: Floats, **options: Any) -> None:
    """Write linear light 0..1 as sRGB."""
    coded = np.where(colour <= 0.0031308, 12.92 * colour, 1.055 * np.clip(colour, 1e-9, 1) ** (1 / 2.4) - 0.055)
    path.parent.mkdir(exist_ok=True)
    Image.fromarray((np.clip(coded, 0, 1) * 255 + 0.5).astype(np.uint8)).save(path, **options)


def painted(mask: NDArray[np.bool_], inside: tuple[float, ...], outside: Floats) -> Floats:
    """Give a part of a picture one colour."""
    return np.where(mask[..., None], np.array(inside), outside)


def waves() -> Floats:
    """Wide wavy stripes, dark on bright."""
    y, x = np.mgrid[0:96, 0:96] / 96
    return painted(
        np.sin(2 * np.pi * (3 * y + 0.12 * np.sin(2 * np.pi * x))) > 0, (0.02, 0.05, 0.2), np.ones((96, 96, 3))
    )


def weave() -> Floats:
    """Strands over and under one another."""
    y, x = np.mgrid[0:96, 0:96]
    over = (y // 27 + x // 27) % 2 == 0
    along, across = np.sin(np.pi * (y % 27) / 27), np.sin(np.pi * (x % 27) / 27)
    strand = np.where(over, along, across)[..., None]
    woven: Floats = strand * np.where(over[..., None], [0.75, 0.5, 0.2], [0.12, 0.06, 0.03])
    return woven


def fields() -> Floats:
    """Three fields of different colour on a white ground."""
    y, x = np.mgrid[0:96, 0:96]
    colour = np.ones((96, 96, 3))
    colour = painted((y > 8) & (y < 44) & (x > 8) & (x < 88), (0.6, 0.02, 0.02), colour)
    colour = painted((y >= 44) & (y < 88) & (x > 8) & (x < 48), (0.02, 0.35, 0.05), colour)
    return painted((y >= 44) & (y < 88) & (x >= 48) & (x < 88), (0.03, 0.05, 0.5), colour)


def lighthouse(chance: np.random.Generator) -> Floats:
    """A white lighthouse before an evening sky, on a dark rock in the sea."""
    y, x = np.mgrid[0:360, 0:480] / 360
    sky = np.array([0.05, 0.12, 0.3]) * (1 - y[..., None]) + np.array([0.5, 0.25, 0.12]) * y[..., None] ** 2
    ripple = 0.5 + 0.5 * np.sin(140 * y**2 + 9 * np.sin(7 * x + 20 * y))
    scene = np.where((y > 0.72)[..., None], np.array([0.02, 0.07, 0.1]) * (0.6 + 0.8 * ripple[..., None]), sky)
    scene = painted(((x - 0.72) / 0.42) ** 2 + ((y - 0.86) / 0.2) ** 2 < 1, (0.015, 0.012, 0.01), scene)
    half = 0.055 + 0.04 * (y - 0.15)
    shade = np.clip(1.1 - np.abs(x - 0.68) / half, 0.15, 1)[..., None]
    tower = (np.abs(x - 0.72) < half) & (y > 0.22) & (y < 0.76)
    band = ((y * 7).astype(int) % 2 == 0)[..., None]
    scene = np.where(tower[..., None], shade * np.where(band, [0.95, 0.93, 0.88], [0.75, 0.1, 0.07]), scene)
    scene = painted((np.abs(x - 0.72) < 0.04) & (y > 0.13) & (y <= 0.22), (1.0, 0.9, 0.5), scene)
    scene = painted((np.abs(x - 0.72) < 0.06 - (0.13 - y)) & (y > 0.07) & (y <= 0.13), (0.2, 0.02, 0.02), scene)
    return scene * (1 + 0.04 * chance.standard_normal(scene.shape))


def ball(chance: np.random.Generator) -> Floats:
    """A bright ball on a table, lit from the upper left, with its shadow."""
    y, x = np.mgrid[0:400, 0:400] / 400
    wall = np.array([0.16, 0.18, 0.2]) * (1.1 - 0.4 * x[..., None])
    scene = np.where((y > 0.62)[..., None], np.array([0.2, 0.12, 0.06]) * (0.7 + 0.5 * y[..., None]), wall)
    grain = 0.9 + 0.1 * np.sin(60 * y + 4 * np.sin(9 * x))
    scene = np.where((y > 0.62)[..., None], scene * grain[..., None], scene)
    shadow = np.exp(-(((x - 0.62) / 0.26) ** 2 + ((y - 0.8) / 0.06) ** 2) * 1.5)[..., None]
    scene = scene * (1 - 0.85 * shadow)
    across, down = (x - 0.47) / 0.27, (y - 0.52) / 0.27
    depth = np.sqrt(np.clip(1 - across**2 - down**2, 0, 1))
    light = np.clip(-0.45 * across - 0.6 * down + 0.66 * depth, 0, 1)
    lit = (0.08 + 0.9 * light + 0.6 * light**40)[..., None] * np.array([0.95, 0.55, 0.12])
    scene = np.where((across**2 + down**2 < 1)[..., None], lit, scene)
    grainy: Floats = scene * (1 + 0.04 * chance.standard_normal(scene.shape))
    return grainy


if __name__ == "__main__":
    chance = np.random.default_rng(7)
    for texture in (waves, weave, fields):
        save(HERE / "textures" / f"{texture.__name__}.png", texture())
    for photo in (lighthouse, ball):
        save(HERE / "photos" / f"{photo.__name__}.jpg", photo(chance), quality=88)
