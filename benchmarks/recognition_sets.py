"""Icon sets fetched from npm when they are needed, and what an icon looks like to one who does not know the encoder.

Which sets the encoder may be tuned on, and which it is only reported on, is written here before anything is tuned.
"""

from __future__ import annotations

import io
import subprocess
import tarfile
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["REPORTED", "TUNED", "Class", "Drawn", "content", "drawn_icons", "laid"]

Floats = NDArray[np.float64]

PIXELS = 96
SEED = 20261122


@dataclass(frozen=True)
class Class:
    """A kind of icon: `folder` of the npm package `package`; names that end as `but` says are left out."""

    name: str
    package: str
    folder: str
    but: str = "\0"


TUNED = (
    Class("outlined", "lucide-static@1.62.0", "package/icons/"),
    Class("outlined, thin", "@tabler/icons@3.51.0", "package/icons/outline/"),
    Class("solid", "@tabler/icons@3.51.0", "package/icons/filled/"),
)
REPORTED = (
    Class("outlined", "@phosphor-icons/core@2.1.1", "package/assets/regular/"),
    Class("solid", "@fortawesome/fontawesome-free@7.3.1", "package/svgs/solid/"),
    Class("brands", "simple-icons@16.37.0", "package/icons/"),
    Class("sharp", "@material-symbols/svg-400@0.48.2", "package/sharp/", but="-fill.svg"),
)


@dataclass(frozen=True)
class Drawn:
    """An icon: its class, name, file, and `ink`, float64, shape (96, 96), 0..1, dark on white."""

    kind: str
    name: str
    data: bytes
    ink: Floats


def drawn_icons(classes: Sequence[Class], count: int, draw: int, kept: Path | None = None) -> list[Drawn]:
    """As many icons of each class, `count` in all, drawn at random; `draw` numbers the draws.

    Parameters
    ----------
    kept : a folder where the packages stay, so that they are fetched once; None for a temporary one.
    """
    with tempfile.TemporaryDirectory() as folder:
        place = kept or Path(folder)
        place.mkdir(parents=True, exist_ok=True)
        found = []
        for number, one in enumerate(classes):
            share = count // len(classes) + (number < count % len(classes))
            found += list(_drawn(one, share, np.random.default_rng([SEED, draw, number]), place))
        return found


def _drawn(one: Class, count: int, rng: np.random.Generator, place: Path) -> Iterator[Drawn]:
    files = _files(one, place)
    seen: set[bytes] = set()
    for index in rng.permutation(len(files)):
        name, data = files[index]
        ink = _ink(data)
        if data in seen or np.ptp(ink) < 0.5:
            continue
        seen.add(data)
        yield Drawn(one.name, name, data, ink)
        if len(seen) == count:
            return


def _files(one: Class, place: Path) -> list[tuple[str, bytes]]:
    archive = place / (one.package.removeprefix("@").replace("/", "-").replace("@", "-") + ".tgz")
    if not archive.exists():
        call = ["npm", "pack", one.package, "--silent", "--pack-destination", str(place)]
        subprocess.run(call, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    with tarfile.open(archive) as tar:
        wanted = {
            entry.name: entry
            for entry in tar
            if entry.name.startswith(one.folder) and entry.name.endswith(".svg") and not entry.name.endswith(one.but)
        }
        return [(name, _bytes(tar, wanted[name])) for name in sorted(wanted)]


def _bytes(tar: tarfile.TarFile, entry: tarfile.TarInfo) -> bytes:
    file = tar.extractfile(entry)
    assert file is not None
    return file.read()


def _ink(data: bytes) -> Floats:
    """The icon as the renderer draws it, nothing of the encoder in between."""
    import resvg_py
    from PIL import Image

    png = resvg_py.svg_to_bytes(svg_string=data.decode(), width=PIXELS, height=PIXELS, skip_system_fonts=True)
    image = Image.open(io.BytesIO(png)).convert("RGBA")
    seen = np.asarray(Image.alpha_composite(Image.new("RGBA", image.size, "white"), image).convert("L"))
    side = max(seen.shape)
    ink = np.zeros((side, side))
    top, left = (side - seen.shape[0]) // 2, (side - seen.shape[1]) // 2
    ink[top : top + seen.shape[0], left : left + seen.shape[1]] = 1 - seen / 255.0
    return ink


def content(ink: Floats) -> tuple[int, int, int, int]:
    """Top, bottom, left and right of what is inked."""
    rows, cols = np.flatnonzero((ink > 0.5).any(axis=1)), np.flatnonzero((ink > 0.5).any(axis=0))
    return int(rows[0]), int(rows[-1]) + 1, int(cols[0]), int(cols[-1]) + 1


def laid(
    ink: Floats, box: tuple[int, int, int, int], shape: tuple[int, int],
    stretch: tuple[float, float] = (1.0, 1.0), shift: tuple[float, float] = (0.0, 0.0),
) -> Floats:  # fmt: skip
    """Means over cells of a grid in which `box` is contained, in the middle; float64, of `shape`.

    Parameters
    ----------
    stretch : how much larger it becomes down and across; `shift` by how many cells it is moved.
    """
    tall, wide = box[1] - box[0], box[3] - box[2]
    pixels = max(tall / shape[0], wide / shape[1])
    shares = []
    for axis, (first, last) in enumerate(((box[0], box[1]), (box[2], box[3]))):
        step = pixels / stretch[axis]
        start = (first + last) / 2 - step * (shape[axis] / 2 + shift[axis])
        places = start + step * np.arange(shape[axis] + 1)
        shares.append(np.diff(np.clip(places[:, None] - np.arange(ink.shape[axis]), 0, 1), axis=0) / step)
    found: Floats = shares[0] @ ink @ shares[1].T
    return found
