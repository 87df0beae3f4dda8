"""How often a pattern is taken for its own icon, by judges that know nothing of the encoder.

python benchmarks/recognition.py                    the sets never tuned on, beside what is kept
python benchmarks/recognition.py --keep             write benchmarks/results/recognition.json
python benchmarks/recognition.py --tuned --draw 1   another draw, of the sets that may be tuned on
python benchmarks/recognition.py --packages DIR     keep the packages of npm there

300 icons are drawn. A pattern, blurred, must find its own among the originals: by correlation as placed; by
correlation over shifts, stretches and polarity (aligned); by a classifier of gradients. The intervals are Wilson's,
those of the lead over the best rival by bootstrap, both of 95 %. On 40 x 96, where an icon takes long, it is a third of
the icons and retrieval alone. Needs npm, scikit-image and scikit-learn.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from recognition_judges import JUDGES, RETRIEVAL, Gallery  # noqa: E402
from recognition_rivals import RIVALS  # noqa: E402
from recognition_sets import REPORTED, TUNED, Drawn, drawn_icons  # noqa: E402

from encoders import (  # noqa: E402
    PICTURES_VERSION,
    Choice,
    GridShape,
    PictureOptions,
    choose_distinct,
    encode_picture,
    margins,
)

Bools = NDArray[np.bool_]

KEPT = ROOT / "benchmarks" / "results" / "recognition.json"
SHAPES = ((6, 6), (8, 6), (12, 12), (40, 96))
COUNT, BOOTSTRAPS = 300, 2000
# Grids of more dots: only every third icon, and judges that need no training.
MANY_DOTS, FEWER = 1000, 3
OURS = f"dotwave, version {PICTURES_VERSION}"
DISTINCT = f"{OURS}, --distinct"


def ours(icons: Sequence[Drawn], shape: tuple[int, int]) -> Bools:
    """Our patterns of all icons."""
    grid = GridShape(*shape)
    scenes = (encode_picture(icon.data, grid) for icon in icons)
    return np.stack([np.abs(scene.frames[0].pattern.amplitude) > 0 for scene in scenes])


def told_apart(icons: Sequence[Drawn], shape: tuple[int, int]) -> Bools:
    """Our patterns where the set is known beforehand."""
    options = PictureOptions(candidates=64)
    frames = [encode_picture(icon.data, GridShape(*shape), options).report.frames[0] for icon in icons]
    patterns = [np.stack([one.dots for one in frame.candidates]) for frame in frames]
    similarity = [np.array([one.similarity for one in frame.candidates]) for frame in frames]
    figures = np.stack([frame.figure for frame in frames])
    worth = margins(figures, [some.astype(np.float64) for some in patterns], similarity)
    codes = [some.reshape(len(some), -1).astype(np.uint8) for some in patterns]
    chosen = choose_distinct([Choice(*pair) for pair in zip(codes, worth, strict=True)])
    return np.stack([some[index] for some, index in zip(patterns, chosen.tolist(), strict=True)])


def methods(icons: Sequence[Drawn], shape: tuple[int, int]) -> Iterator[tuple[str, Bools]]:
    """Every way to patterns, its name first."""
    for name, rival in RIVALS.items():
        yield name, np.stack([rival(icon.ink, shape) for icon in icons])
    yield OURS, ours(icons, shape)
    if shape == (6, 6):
        yield DISTINCT, told_apart(icons, shape)


def judged(icons: Sequence[Drawn], shapes: Sequence[tuple[int, int]]) -> Iterator[dict[str, Any]]:
    """A line for each size and method: of each judge how many were found in each class, and the lead."""
    for shape in shapes:
        many = shape[0] * shape[1] > MANY_DOTS
        asked, judges = (icons[::FEWER], RETRIEVAL) if many else (icons, JUDGES)
        kinds = [icon.kind for icon in asked]
        gallery = Gallery(asked, shape)
        hits = {name: {judge: gallery.found(judge, dots) for judge in judges} for name, dots in methods(asked, shape)}
        for name, by_judge in hits.items():
            line: dict[str, Any] = {"rows": shape[0], "cols": shape[1], "method": name, "icons": dict(Counter(kinds))}
            line["found"] = {
                judge: {kind: Counter(np.array(kinds)[hit].tolist())[kind] for kind in dict.fromkeys(kinds)}
                for judge, hit in by_judge.items()
            }
            if name not in RIVALS:
                line["lead"] = {
                    judge: _lead(hit, [hits[rival][judge] for rival in RIVALS]) for judge, hit in by_judge.items()
                }
            yield line


def _lead(ours_found: Bools, rivals: Sequence[Bools]) -> list[float]:
    """Percent by which we are ahead of the best rival, and the ends of the interval by drawing icons again."""
    best = max(rivals, key=lambda hit: int(hit.sum()))
    apart = ours_found.astype(np.float64) - best
    again = np.random.default_rng(0).integers(0, len(apart), (BOOTSTRAPS, len(apart)))
    means = apart[again].mean(axis=1)
    return [round(100 * float(value), 1) for value in (apart.mean(), *np.percentile(means, (2.5, 97.5)))]


def words(line: dict[str, Any]) -> str:
    """For a person: percent of all with its interval, then of each class."""
    from scipy.stats import binomtest

    counts = line["icons"]
    parts = [f"{line['rows']} x {line['cols']}  {line['method']:30}"]
    for judge, by_kind in line["found"].items():
        total, count = sum(by_kind.values()), sum(counts.values())
        span = binomtest(total, count).proportion_ci(method="wilson")
        classes = " ".join(f"{100 * found / counts[kind]:.0f}" for kind, found in by_kind.items())
        lead = f" lead {line['lead'][judge][0]:+.0f}" if "lead" in line else ""
        parts.append(
            f"{judge} {100 * total / count:.0f} ({100 * span.low:.0f}..{100 * span.high:.0f}; {classes}){lead}"
        )
    return "; ".join(parts)


def main() -> None:
    """Judge, print, and keep when asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", action="store_true", help=f"write {KEPT.name}")
    parser.add_argument("--tuned", action="store_true", help="the sets that may be tuned on")
    parser.add_argument("--draw", type=int, default=0, help="which draw")
    parser.add_argument("--packages", type=Path, help="folder where the packages stay")
    parser.add_argument("--shape", action="append", help="such as 6x6; more than once for several")
    given = parser.parse_args()
    shapes = [tuple(map(int, one.split("x"))) for one in given.shape] if given.shape else list(SHAPES)
    classes = TUNED if given.tuned else REPORTED
    icons = drawn_icons(classes, COUNT, given.draw, given.packages)
    counts = {one.name: sum(icon.kind == one.name for icon in icons) for one in classes}
    print(f"{len(icons)} icons, draw {given.draw}: " + ", ".join(f"{n} {kind}" for kind, n in counts.items()))
    lines = []
    for line in judged(icons, [(shape[0], shape[1]) for shape in shapes]):
        lines.append(line)
        print(words(line), flush=True)
    if given.keep:
        _keep(lines, counts, [one.package for one in classes])


def _keep(lines: list[dict[str, Any]], counts: dict[str, int], packages: list[str]) -> None:
    """What earlier versions of the encoder reached stays."""
    before = json.loads(KEPT.read_text(encoding="utf-8"))["lines"] if KEPT.exists() else []
    new = {(line["rows"], line["cols"], line["method"]) for line in lines}
    lines = [line for line in before if (line["rows"], line["cols"], line["method"]) not in new] + lines
    lines.sort(key=lambda line: (line["rows"] * line["cols"], line["method"]))
    facts = {"schema": "dotwave/recognition/1", "packages": packages, "icons": counts, "lines": lines}
    KEPT.write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
