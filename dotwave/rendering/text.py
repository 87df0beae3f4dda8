"""From what a person gives to what is written: encode, plan, drive, and say what came of it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from chainsim import Device, Outcome, load_device
from drivers import EXCHANGE_SUFFIXES, Encoding, WrittenWaveform, write_exchange, write_waveform
from encoders import EncodingReport, GridShape, TextFrames, TextOptions, TextScene, encode_text
from planner import DEFAULT_CONTRAST_DB, FramePlan, Plan, plan_scene

from ..progress import progress
from ..reports.text import TextReport
from ..reports.totals import PlanStopped, Tally, nearest_lines, peak_volts
from ..source import text_source
from ..studies.study import Study
from .extent import extent_of, go_on

__all__ = ["render_text"]

# Back-translation holds the whole text and its cells at once.
MOST_CHECKED = 100_000


def render_text(
    source: str,
    *,
    device: str,
    out: Path | None,
    options: TextOptions,
    encoding: Encoding,
    contrast_db: float = DEFAULT_CONTRAST_DB,
    actuator: tuple[int, int] | None = None,
    study: Study | None = None,
    yes: bool = False,
) -> TextReport:
    """Encode text, plan it on a device and, with `out`, write the waveform.

    Nothing is written when a frame cannot be made as asked: the report then says what is lacking and what
    the nearest pattern is.

    Parameters
    ----------
    source : a file, ``-``, or the text itself. device : profile name or file.
    out : samples (.wav, .npz, .csv, .raw) or a haptic file (.hjif, .ahap, .haptic).
    actuator : (row, col) that an .ahap or .haptic shows; None is the mean over the grid.
    contrast_db : how far unraised dots of a vibrating chain stay below raised ones.
    study : what is asked beside, and what is seen of the plan. yes : do not ask before a very large file.

    Raises
    ------
    Declined
        When a person was asked, and said no.
    EncodeError, ChainError, PlanError, DriverError, AppError
        When something that was given cannot be used.
    """
    began = time.perf_counter()
    profile = load_device(device)
    text = text_source(source)
    scene = encode_text(text, GridShape(profile.rows, profile.cols), options)
    plan = plan_scene(scene, profile, contrast_db=contrast_db)
    if out is not None and out.suffix.lower() not in EXCHANGE_SUFFIXES:
        go_on(extent_of(scene.frames, profile, out, encoding), out, yes=yes)
    watch = _Watch(plan, study or Study(), stop_at_failure=out is not None)
    written: WrittenWaveform | None = None
    with progress("rendering") as update:
        try:
            if out is None:
                for frame in watch:
                    update(frame.end_s)
            else:
                plan = replace(plan, frames=watch)
                if out.suffix.lower() in EXCHANGE_SUFFIXES:
                    write_exchange(plan, out, actuator=actuator)
                else:
                    written = write_waveform(plan, out, encoding=encoding, progress=update)
        except PlanStopped:
            pass
    report = _report(profile, scene, watch, written)
    if out is not None and written is None and report.ok:
        report = replace(report, files=(str(out),))
    return replace(report, seconds=time.perf_counter() - began)


@dataclass
class _Watch:
    """The plan's frames passed through, and what is to be said of them."""

    plan: Plan
    study: Study
    stop_at_failure: bool
    outcomes: dict[str, int] = field(default_factory=dict)
    tally: Tally = field(default_factory=Tally)
    failed: FramePlan | None = None
    failed_number: int = 0

    def __iter__(self) -> Iterator[FramePlan]:
        for number, frame in enumerate(self.study.watched(self.plan), 1):
            self.outcomes[frame.outcome] = self.outcomes.get(frame.outcome, 0) + (frame.frame is not None)
            self.tally.add(frame)
            if frame.outcome is not Outcome.OK and self.failed is None:
                self.failed, self.failed_number = frame, number
                if self.stop_at_failure or frame.outcome is Outcome.OUT_OF_BUDGET:
                    raise PlanStopped
            yield frame


def _report(device: Device, scene: TextScene, watch: _Watch, written: WrittenWaveform | None) -> TextReport:
    frames = scene.text_frames
    encoded = frames.report
    differences, sentence = _back_check(frames)
    return TextReport(
        device=device.name,
        tables=tuple(scene.encoding["tables"]),
        text=frames.source.text[:200],
        frames=encoded.frames,
        pages=encoded.pages,
        duration_s=watch.tally.duration_s,
        files=(str(written.samples_path), str(written.manifest_path)) if written else (),
        peak_volts=peak_volts(written, watch.tally, device),
        limit_volts=device.amplifier.volts,
        ramp_s=watch.tally.ramp_s,
        error=watch.tally.error,
        well=watch.tally.well,
        noise_gain=watch.tally.noise_gain,
        slew=watch.tally.slew,
        multiplier=watch.tally.multiplier,
        spread=watch.tally.spread,
        outcomes=watch.outcomes,
        undefined=_undefined(encoded),
        split=tuple(
            f"{split.word!r} at character {split.span[0]}, page {split.page + 1}, "
            + ("hyphenated" if split.hyphenated else "not at a syllable")
            for split in encoded.splits
        ),
        differences=differences,
        notes=(sentence, *_notes(device, encoded, watch)),
    )


def _undefined(encoded: EncodingReport) -> tuple[str, ...]:
    return tuple(
        f"{use.characters} ({use.count} times, first at character {use.first}): {use.action}"
        + (f" as {use.written!r}" if use.written else "")
        for use in encoded.undefined
    )


def _back_check(frames: TextFrames) -> tuple[tuple[str, ...], str]:
    """What does not come back when the cells are translated back, and a sentence on it."""
    if len(frames.source.text) > MOST_CHECKED:
        return (), f"A text of more than {MOST_CHECKED} characters is not translated back here; verify does it."
    check = frames.check()
    return tuple(one.sentence for one in (*check.differences, *check.alone)), check.sentence


def _notes(device: Device, encoded: EncodingReport, watch: _Watch) -> Iterator[str]:
    if encoded.split_total > len(encoded.splits):
        yield f"{encoded.split_total} words were split; the first {len(encoded.splits)} are listed."
    if watch.failed is None:
        return
    yield f"Frame {watch.failed_number}: {watch.failed.note}"
    if watch.failed.outcome is not Outcome.OUT_OF_BUDGET:
        yield from nearest_lines(watch.failed, device)
    if watch.stop_at_failure:
        yield "Nothing was written."
