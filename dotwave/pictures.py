"""Pictures as scenes, each with a line that says what it is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from chainsim import Device
from encoders import GridShape, PictureOptions, PictureReport, PictureScene, encode_picture

__all__ = ["picture_scene", "pitched"]


def pitched(options: PictureOptions, device: Device) -> PictureOptions:
    """The options for pictures on the grid of a device."""
    return replace(options, pitch_m=(device.pitch_m, device.pitch_m))


def picture_scene(source: Path | bytes, shape: GridShape, options: PictureOptions) -> PictureScene:
    """A picture; raises as `encoders.encode_picture` does."""
    scene = encode_picture(source, shape, options)
    return replace(scene, parts=(_picture_words(scene.report),))


def _picture_words(report: PictureReport) -> str:
    """File, style, similarity, what was left out, what textures mean, and what speaks against it."""
    frames = f", {len(report.frames)} frames" if len(report.frames) > 1 else ""
    first = report.frames[0]
    said = "".join(f"; {clause}" for clause in (*first.legend, first.doubt.rstrip(".")) if clause)
    notes = f" ({'; '.join(report.notes)})" if report.notes else ""
    return f"{report.style}: {Path(report.name).name}{frames}, similarity {report.similarity:.2f}{notes}{said}"
