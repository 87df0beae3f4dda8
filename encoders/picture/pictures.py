"""Pictures to a scene: what should be felt of an icon or a photograph on a handful of actuators."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..braille.presentation import MIN_PART_S
from ..scene import Frame, GridShape, PatternKind, Scene, TargetPattern
from .doubt import doubt_of, is_block
from .errors import EmptyPicture
from .figure import Step, figure_steps, spaced_steps, style_of
from .fit import Candidate, Window, best_patterns, choose_window, plain_size, sampled
from .held import dot_means
from .limits import PictureLimits
from .options import Fit, Invert, Output, PictureOptions, RegionsBy, Style
from .reading import Picture, read_picture
from .regions import TEXTURES, TexturedRegion, dot_regions, legend, textured
from .sign import framed_sign
from .similarity import agreement, target_of
from .steps import background_light, composite, content_box, luminance
from .views import views

if TYPE_CHECKING:
    from PIL.Image import Image

__all__ = ["PICTURES_VERSION", "FrameReport", "PictureReport", "PictureScene", "encode_picture", "explain_picture"]

Floats = NDArray[np.float64]

PICTURES_VERSION = 3
"""One more whenever a picture gives other patterns: what was kept of icons before is not used."""

PIXELS_PER_ACTUATOR = 12
FEWEST_PIXELS, MOST_PIXELS = 72, 1536
GAINS = (0.7, 0.85, 1.0, 1.2, 1.4, 1.7)


@dataclass(frozen=True)
class FrameReport:
    """How one frame was made.

    Attributes
    ----------
    view : ``overview``, or which part of the picture.
    steps : names of the steps taken, in order.
    similarity : of the frame's dots (or levels) with the figure, at most 1 (see `encoders.picture_similarity`).
    candidates : good on/off patterns of the figure, best first.
    regions : of a texture, else empty.
    doubt : why its dots may not be known, in one sentence; empty where nothing speaks against them.
    figure : float64, shape (4 rows, 4 cols), read-only, 0..1: the figure as the best candidate's window cuts it out.
    """

    view: str
    steps: tuple[str, ...]
    similarity: float
    candidates: tuple[Candidate, ...]
    figure: Floats
    regions: tuple[TexturedRegion, ...] = ()
    doubt: str = ""

    @property
    def legend(self) -> tuple[str, ...]:
        """What each region of a texture is and feels like, in words."""
        return legend(self.regions)


@dataclass(frozen=True)
class PictureReport:
    """How a picture was encoded.

    Attributes
    ----------
    name : how it is called.
    kind : its format.
    size : (height, width) in pixels.
    style : the defaults used.
    notes : what was left out while reading.
    frames : one for each frame of the scene.
    """

    name: str
    kind: str
    size: tuple[int, int]
    style: Style
    notes: tuple[str, ...]
    frames: tuple[FrameReport, ...]

    @property
    def similarity(self) -> float:
        """Mean over the frames."""
        return sum(frame.similarity for frame in self.frames) / len(self.frames)


@dataclass(frozen=True, repr=False)
class PictureScene(Scene):
    """A scene made of a picture, with its report."""

    frames: tuple[Frame, ...]
    report: PictureReport = field(kw_only=True)


@dataclass(frozen=True)
class _Made:
    """A frame's pattern and how it came about."""

    pattern: TargetPattern
    report: FrameReport
    steps: tuple[Step, ...]
    seconds: float = 0.0


def encode_picture(
    source: str | os.PathLike[str] | bytes | Image,
    shape: GridShape,
    options: PictureOptions | None = None,
    limits: PictureLimits | None = None,
) -> PictureScene:
    """The scene that shows a picture on a grid: one frame, or those of an animation, an overview and its parts.

    Parameters
    ----------
    source : path, bytes of a file, or Pillow image.
    limits : how much is read.

    Returns
    -------
    PictureScene
        Its frames' targets are 0 or 1 (on/off), 0 or one of the levels, or complex amplitudes of waves and bars
        (texture; `phase_matters` is then set). A frame of an animation lasts as the file says, but at least 0.6 s.

    Raises
    ------
    PictureError
        When the picture cannot be read, or an option does not fit; `EmptyPicture` when nothing can be felt of it.
    """
    options = options or PictureOptions()
    picture, options = _read(source, shape, options, limits)
    # The steps' images are many times larger than what is kept of a frame.
    made = [replace(one, steps=()) for one in _frames(picture, shape, options)]
    if not any(one.pattern.amplitude.any() for one in made):
        raise EmptyPicture(
            f"{picture.name}: nothing to feel, it is one flat tone; give another background or even out its contrast"
        )
    frames = tuple(
        Frame(one.pattern, max(one.seconds, MIN_PART_S) if one.seconds else options.dwell_s, page)
        for page, one in enumerate(made)
    )
    reports = tuple(one.report for one in made)
    notes = (*picture.notes, *_cut(picture, reports[0].candidates[0].window, options))
    report = PictureReport(picture.name, picture.kind, picture.size, options.style, notes, reports)
    return PictureScene(shape, frames, _encoding(picture, options), report=report)


def _cut(picture: Picture, window: Window, options: PictureOptions) -> tuple[str, ...]:
    """What `cover` leaves out, as a note."""
    if options.fit is not Fit.COVER:
        return ()
    height, width = picture.frames[0].light.shape[:2]
    down = max(0.0, min(window.bottom, height) - max(window.top, 0))
    across = max(0.0, min(window.right, width) - max(window.left, 0))
    percent = round(100 * (1 - down * across / (height * width)))
    return (f"cover cuts {percent} % of the picture away, contain shows all of it",) if percent else ()


def explain_picture(
    source: str | os.PathLike[str] | bytes | Image,
    shape: GridShape,
    options: PictureOptions | None = None,
    limits: PictureLimits | None = None,
) -> tuple[Step, ...]:
    """The steps of the first frame in order, each with its picture; raises as `encode_picture` does."""
    picture, options = _read(source, shape, options or PictureOptions(), limits)
    made = next(_frames(picture, shape, options))
    added = [np.kron(made.report.figure, np.ones((4, 4))).astype(np.float32), _drawn(made.pattern.amplitude)]
    if options.crop:
        top, bottom, left, right = content_box(made.steps[-1].image)
        added.insert(0, made.steps[-1].image[top:bottom, left:right])
    names = made.report.steps[len(made.steps) :]
    return (*made.steps, *(Step(name, image) for name, image in zip(names, added, strict=True)))


def _read(
    source: Any, shape: GridShape, options: PictureOptions, limits: PictureLimits | None
) -> tuple[Picture, PictureOptions]:
    longest = PIXELS_PER_ACTUATOR * max(shape.rows, shape.cols) * options.zoom
    picture = read_picture(source, min(max(longest, FEWEST_PIXELS), MOST_PIXELS), limits)
    if options.style is not Style.AUTO:
        return picture, options.resolved(options.style)
    light = picture.frames[0].light
    drawn = picture.kind == "SVG" or float(light[..., 3].min()) < 0.5
    style = Style.ICON if drawn else style_of(luminance(composite(light, background_light(light, options.background))))
    return picture, options.resolved(style)


def _encoding(picture: Picture, options: PictureOptions) -> dict[str, Any]:
    return {
        "kind": "picture",
        "picture": Path(picture.name).name,
        "format": picture.kind,
        "style": str(options.style),
        "fit": str(options.fit),
        "output": str(options.output),
        "zoom": options.zoom,
        "overlap": options.overlap,
    }


def _frames(picture: Picture, shape: GridShape, options: PictureOptions) -> Iterator[_Made]:
    """Every frame of an animation; of each the overview, then its parts in reading order."""
    high_m, wide_m = shape.rows * options.pitch_m[0], shape.cols * options.pitch_m[1]
    for raster in picture.frames:
        height, width = raster.light.shape[:2]
        plain = figure_steps(raster.light, options)
        high, wide = plain_size(plain[-1].image, shape, options.fit or Fit.CONTAIN, options.pitch_m, bool(options.crop))
        pixels_per_m = (high * wide / (high_m * wide_m)) ** 0.5
        steps = plain + spaced_steps(plain[-1].image, options, pixels_per_m)
        made = _viewed(steps, "overview", _window(steps, shape, options), shape, options)
        if options.crop and options.invert is Invert.AUTO:
            made = _unframed(made, steps, shape, options)
        yield replace(made, report=_doubted(made, picture.notes, options), seconds=raster.seconds)
        parts = views(height, width, wide_m / high_m, options.zoom, options.overlap)[1:]
        if parts:
            steps = plain + spaced_steps(plain[-1].image, options, pixels_per_m / options.zoom)
        for view in parts:
            window = Window(view.top, view.bottom, view.left, view.right)
            yield replace(_viewed(steps, view.name, window, shape, options), seconds=raster.seconds)


def _doubted(made: _Made, notes: tuple[str, ...], options: PictureOptions) -> FrameReport:
    """The report of an overview, with what speaks against it."""
    bright = next(step.image for step in made.steps if step.name == "luminance")
    best = made.report.candidates[0]
    doubt = doubt_of(bright, made.steps[-1].image, best.dots, best.similarity, notes, options.style is Style.ICON)
    return replace(made.report, doubt=doubt)


def _unframed(made: _Made, steps: list[Step], shape: GridShape, options: PictureOptions) -> _Made:
    """The sign alone where the grid is too coarse to show its form inside its tile or ring, and it has one.

    Where several patterns are asked for, what is shown of it is enough: choosing among them tells signs apart.
    """
    framed = framed_sign(steps[-1].image)
    if framed is None:
        return made
    best = made.report.candidates[0]
    inside = dot_means(sampled(framed.inside.astype(np.float32), [best.window], shape)[0], shape) >= 0.5
    left = framed.left(best.dots, inside)
    if left.any() and (options.candidates > 1 or not is_block(left)):
        return made
    steps = [*steps, Step("sign without its frame", framed.sign)]
    alone = _viewed(steps, "overview", _window(steps, shape, options), shape, options)
    return made if left.any() and is_block(alone.report.candidates[0].dots) else alone


def _window(steps: list[Step], shape: GridShape, options: PictureOptions) -> Window:
    return choose_window(steps[-1].image, shape, options.fit or Fit.CONTAIN, options.pitch_m, bool(options.crop))


def _viewed(steps: list[Step], view: str, window: Window, shape: GridShape, options: PictureOptions) -> _Made:
    figure = steps[-1].image
    fitted = best_patterns(figure, window, shape, options.candidates)
    best = fitted.candidates[0]
    similarity, regions = best.similarity, tuple[TexturedRegion, ...]()
    if options.output is Output.LEVELS:
        pattern, similarity = _levelled(steps, best.window, shape, options)
    elif options.output is Output.TEXTURE:
        pattern, regions = _textured(steps, best, shape, options)
    else:
        pattern = TargetPattern(_frozen(best.dots.astype(np.complex128)))
    last = [f"fit ({options.fit})", str(options.output).replace("_", "/")]
    names = (*(step.name for step in steps), *(["crop"] if options.crop else []), *last)
    lattice = fitted.figure.copy()
    lattice.flags.writeable = False
    report = FrameReport(view, names, similarity, fitted.candidates, lattice, regions)
    return _Made(pattern, report, tuple(steps))


def _levelled(
    steps: list[Step], window: Window, shape: GridShape, options: PictureOptions
) -> tuple[TargetPattern, float]:
    """Tone to the nearest level, with the gain that is most similar; similarity is with the tone."""
    tone = _tone(steps)
    target = target_of(sampled(tone, [window], shape), shape)
    means = dot_means(target.figure[0], shape)
    levels = np.append(0.0, 10 ** (-options.level_step_db / 20 * np.arange(options.levels)))
    tries = np.stack([levels[np.abs(gain * means[..., None] - levels).argmin(axis=-1)] for gain in GAINS])
    scores = agreement(target, tries)[0]
    best = int(scores.argmax())
    return TargetPattern(_frozen(tries[best].astype(np.complex128))), float(scores[best])


def _tone(steps: list[Step]) -> NDArray[np.float32]:
    """Brightness as it is seen, from the second to the 98th percentile as 0..1, turned over as the figure is."""
    named = {step.name: step.image for step in steps}
    seen = named.get("local contrast", np.sqrt(np.clip(named["luminance"], 0, 1)))
    low, high = np.percentile(seen, (2, 98))
    tone: NDArray[np.float32] = np.clip((seen - low) / max(high - low, 1e-6), 0, 1).astype(np.float32)
    figure = steps[-1].image
    falling = float(((tone - tone.mean()) * (figure - figure.mean())).sum()) < 0
    return 1 - tone if falling else tone


def _textured(
    steps: list[Step], best: Candidate, shape: GridShape, options: PictureOptions
) -> tuple[TargetPattern, tuple[TexturedRegion, ...]]:
    colour = np.ascontiguousarray(np.moveaxis(steps[0].image, 2, 0))
    means = np.stack([dot_means(sampled(one, [best.window], shape)[0], shape) for one in colour], axis=-1)
    labels = dot_regions(means, best.dots.astype(np.float64), options.regions, options.regions_by is RegionsBy.COLOUR)
    regions = []
    for index in range(int(labels.max()) + 1):
        mine = labels == index
        if mine.any():
            red, green, blue = (float(value) for value in means[mine].mean(axis=0))
            texture = TEXTURES[index - 1] if index else None
            regions.append(TexturedRegion((red, green, blue), int(mine.sum()), texture))
    waves = any(region.texture and region.texture.kind is PatternKind.SINE for region in regions)
    kind = PatternKind.SINE if waves else PatternKind.BARS
    return TargetPattern(_frozen(textured(labels)), kind, phase_matters=True), tuple(regions)


def _drawn(amplitude: NDArray[np.complex128]) -> NDArray[np.float32]:
    """Dots as discs of 16 pixels, as bright as they are strong; a phase is drawn as it is at one moment."""
    side = np.arange(16) - 7.5
    disc = (np.hypot(side[:, None], side) < 6.5).astype(np.float32)
    strength = np.where(amplitude.imag == 0, np.abs(amplitude), 0.5 * np.abs(amplitude) + 0.5 * amplitude.real)
    return np.kron(0.06 + 0.94 * strength, disc).astype(np.float32)


def _frozen(amplitude: NDArray[np.complex128]) -> NDArray[np.complex128]:
    amplitude.flags.writeable = False
    return amplitude
