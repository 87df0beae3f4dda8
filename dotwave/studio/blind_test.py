"""A blind test of a set of icons: a pattern is felt, its icon is named, and what is taken for what is counted."""

from __future__ import annotations

import json
import random
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from drivers import atomic_file

from ..errors import AppError

__all__ = ["BlindTest"]

CHOICES = 8


@dataclass
class BlindTest:
    """A test that is going on, kept in a file.

    Attributes
    ----------
    path : of the file; nobody downloads it while the answer is open.
    answers : (icon that was shown, icon that was named) each.
    pending : the icon that is shown now.
    choices : the icons to choose from, that one among them.
    """

    path: Path
    answers: list[tuple[str, str]] = field(default_factory=list)
    pending: str = ""
    choices: tuple[str, ...] = ()

    @classmethod
    def of(cls, path: Path, icons: Sequence[Mapping[str, Any]]) -> BlindTest:
        """The test as it stands; a new one begins with an icon."""
        if path.is_file():
            told = json.loads(path.read_text(encoding="utf-8"))
            answers = [(shown, named) for shown, named in told["answers"]]
            return cls(path, answers, told["pending"], tuple(told["choices"]))
        test = cls(path)
        test.next(icons)
        return test

    def answer(self, named: str, icons: Sequence[Mapping[str, Any]]) -> None:
        """Take an answer, and show another icon.

        Raises
        ------
        AppError
            When it is none of the choices.
        """
        if named not in self.choices:
            raise AppError("Icon: choose one of the list")
        self.answers.append((self.pending, named))
        self.next(icons)

    def next(self, icons: Sequence[Mapping[str, Any]]) -> None:
        """Show one of those shown least, to be told from its nearest and from others."""
        chance = random.Random(f"{self.path.parent.name} {len(self.answers)}")
        names = [icon["name"] for icon in icons if icon["outcome"] == "ok" and not icon["same_as"]]
        if len(names) < 2:
            raise AppError("a blind test needs at least two icons that can be made")
        shown = Counter(one for one, _ in self.answers)
        least = min(shown[name] for name in names)
        self.pending = chance.choice([name for name in names if shown[name] == least])
        nearest = next(icon["nearest"] for icon in icons if icon["name"] == self.pending)
        others = [name for name in names if name not in (self.pending, nearest)]
        near = [nearest] if nearest in names else []
        some = chance.sample(others, min(len(others), CHOICES - 1 - len(near)))
        self.choices = tuple(sorted([self.pending, *near, *some]))
        told = {"answers": self.answers, "pending": self.pending, "choices": self.choices}
        with atomic_file(self.path) as file:
            file.write(json.dumps(told, ensure_ascii=False).encode())

    @property
    def right(self) -> int:
        """How many were named right."""
        return sum(shown == named for shown, named in self.answers)

    def confusion(self) -> tuple[list[str], list[tuple[str, list[int]]]]:
        """What was named (columns), and for each icon that was shown how often."""
        columns = sorted({named for _, named in self.answers})
        counts = Counter(self.answers)
        shown = sorted({one for one, _ in self.answers})
        return columns, [(one, [counts[one, named] for named in columns]) for one in shown]
