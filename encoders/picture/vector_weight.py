"""How much an SVG draws: its elements and the points of its paths, those by reference counted each time."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field

from .errors import PictureTooLarge

__all__ = ["BITMAP", "DEEPEST", "STYLES", "Weight", "Weights", "weight_of_sheets"]

DEEPEST = 48
STYLES = "\0styles"  # stands for all style sheets: any of their rules may apply to any element


@dataclass(frozen=True)
class Weight:
    """What is drawn.

    Attributes
    ----------
    elements : how many.
    squares : of the number of points of each path, added up; the time that a path takes grows with its square. What
        else takes time counts as so many squares.
    """

    elements: int = 0
    squares: int = 0

    def __add__(self, other: Weight) -> Weight:
        return Weight(self.elements + other.elements, self.squares + other.squares)

    @property
    def points(self) -> int:
        """Points of one path that takes as long as all of them."""
        return math.isqrt(self.squares)


# A bitmap is scaled anew wherever it is drawn, which takes up to 9 ms; a square takes about 10 ns.
BITMAP = Weight(1, 1_000_000)
# Squares that a rule, a declaration or a step from an element to its parent takes for each element of the document.
STEP = 16

_COMBINATOR = re.compile(r"[\s>+~]+")


def weight_of_sheets(text: str, elements: int, depth: int) -> Weight:
    """What it takes to find which rules of the style sheets `text` apply to which of so many elements.

    A selector of several parts is tried with every choice of the elements, `depth` at most, that an element is in.
    """
    steps = text.count(";")
    for before in text.split("{")[:-1]:
        for selector in before.rpartition("}")[2].split(","):
            parts = len(_COMBINATOR.split(selector.strip()))
            steps += sum(math.comb(depth, choice) for choice in range(min(parts, depth + 1)))
    return Weight(0, STEP * steps * elements)


@dataclass
class _Part:
    """What an identified part, or the whole, draws: itself, and parts it refers to."""

    itself: Weight = Weight()
    refers: list[str] = field(default_factory=list)


class Weights:
    """The weights of all identified parts of a document, and who refers to whom; ``""`` is the whole.

    A part that stands inside another one must be referred to by it.
    """

    def __init__(self) -> None:
        self._parts: dict[str, _Part] = defaultdict(_Part)

    def add(self, owner: str, weight: Weight, refers: Iterable[str] = ()) -> None:
        """Something in part `owner`."""
        part = self._parts[owner]
        part.itself += weight
        part.refers += refers

    def total(self) -> Weight:
        """All that is drawn, references followed.

        Raises
        ------
        PictureTooLarge
            When references go too deep.
        """
        sums: dict[str, Weight] = {}

        def drawn(ident: str, above: frozenset[str]) -> Weight:
            if ident in above or ident not in self._parts:
                return Weight()
            if ident not in sums:
                part = self._parts[ident]
                if len(above) > DEEPEST:
                    raise PictureTooLarge(f"more than {DEEPEST} references to references; flatten the drawing")
                sums[ident] = sum((drawn(other, above | {ident}) for other in part.refers), part.itself)
            return sums[ident]

        return drawn("", frozenset())
