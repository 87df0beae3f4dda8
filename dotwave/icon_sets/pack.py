"""A set of icons as one pack: what a phone ships, and a firmware plays from its memory."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from drivers import PackWriter, atomic_file, naming

from ..progress import progress
from .set import Icon
from .work import Recipe, icon_plan

__all__ = ["PackedSet", "write_icon_pack"]


@dataclass(frozen=True)
class PackedSet:
    """What was written. `left_out` : icons that cannot be made on the device."""

    path: str
    size: int
    icons: int
    left_out: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """What it takes."""
        left = f"; {len(self.left_out)} that cannot be made are left out" if self.left_out else ""
        return f"Pack: {self.icons} icons in {self.size} bytes{left}."


def write_icon_pack(icons: Sequence[Icon], recipe: Recipe, path: Path) -> PackedSet:
    """Put every icon that can be made into the pack `path`, each from rest to its pattern and back.

    Raises
    ------
    drivers.DriverError
        When nothing can be put in, or the disk refuses; nothing is written then.
    """
    made = [icon for icon in icons if icon.outcome == "ok"]
    names = _names([icon.name for icon in icons])
    writer = PackWriter(recipe.device)
    with atomic_file(path) as file:
        with progress("packing") as update:
            for number, icon in enumerate(made):
                update(number, len(made))
                plan = icon_plan(recipe, icon.pattern.amplitude)
                code_point = int(icon.code_point.removeprefix("U+") or "0", 16)
                writer.add(plan, names[icon.name], spoken=icon.label or _spoken(icon.name), code_point=code_point)
        with naming(path):
            writer.write(file, path)
            size = file.tell()
    left_out = tuple(icon.name for icon in icons if icon.outcome != "ok")
    return PackedSet(str(path), size, len(made), left_out)


def _names(icons: Sequence[str]) -> dict[str, str]:
    """By which each is found: the name of its file without folder and ending, where no other has the same."""
    stems = {name: PurePosixPath(name).stem for name in icons}
    times = Counter(stems.values())
    return {name: stem if times[stem] == 1 else name for name, stem in stems.items()}


def _spoken(name: str) -> str:
    """The last part of a name as words."""
    return " ".join(PurePosixPath(name).stem.replace("_", " ").replace("-", " ").split())
