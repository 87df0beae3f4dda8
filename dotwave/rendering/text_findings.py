"""What happened to a text on its way to cells, in words: what was left out or split, and what comes back."""

from __future__ import annotations

from dataclasses import dataclass

from encoders import EncodingReport, TextFrames, TextScene, TextSource

__all__ = ["TextFindings", "text_findings"]

# Back-translation holds the whole text and its cells at once.
MOST_CHECKED = 100_000


@dataclass(frozen=True)
class TextFindings:
    """Sentences on a text: characters shown otherwise, words split, what does not come back, and notes."""

    undefined: tuple[str, ...]
    split: tuple[str, ...]
    differences: tuple[str, ...]
    notes: tuple[str, ...]


def text_findings(scene: TextScene) -> TextFindings:
    """What is to be said of a text whose frames were drawn."""
    encoded, source = scene.text_frames.report, scene.text_frames.source
    differences, sentence = _back_check(scene.text_frames)
    more = (f"{encoded.split_total} words were split; the first {len(encoded.splits)} are listed.",)
    return TextFindings(
        undefined=_undefined(encoded, source),
        split=tuple(
            f"{split.word!r} at {_place(source, split.span[0])}, page {split.page + 1}, "
            + ("hyphenated" if split.hyphenated else "not at a syllable")
            for split in encoded.splits
        ),
        differences=differences,
        notes=(*source.notes, sentence, *(more if encoded.split_total > len(encoded.splits) else ())),
    )


def _place(source: TextSource, position: int) -> str:
    """A position of a text, and of a document where that is in its file."""
    place = str(source.document.place_at(position)) if source.document else ""
    return f"character {position}" + (f" ({place})" if place else "")


def _undefined(encoded: EncodingReport, source: TextSource) -> tuple[str, ...]:
    return tuple(
        f"{use.characters} ({use.count} times, first at {_place(source, use.first)}): {use.action}"
        + (f" as {use.written!r}" if use.written else "")
        for use in encoded.undefined
    )


def _back_check(frames: TextFrames) -> tuple[tuple[str, ...], str]:
    """What does not come back when the cells are translated back, and a sentence on it."""
    if len(frames.source.text) > MOST_CHECKED:
        return (), f"A text of more than {MOST_CHECKED} characters is not translated back here; verify does it."
    check = frames.check()
    return tuple(one.sentence for one in (*check.differences, *check.alone)), check.sentence
