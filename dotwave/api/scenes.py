"""What should be felt, on which device: texts, textures and jobs as scenes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from chainsim import Device, complaint_of, load_device, words_of
from encoders import ImageChoice, Scene, TargetPattern, TextOptions, TextSource

from ..errors import AppError
from ..scenes import DeviceScene, shape_of, still_scene, text_scene

__all__ = ["USUAL_DEVICE", "AnyDevice", "device", "job", "text", "texture"]

AnyDevice = Device | str | PathLike[str] | Mapping[str, Any]
Model = TypeVar("Model", bound=BaseModel)
USUAL_DEVICE = "paper-6x6"


def device(name: AnyDevice = USUAL_DEVICE) -> Device:
    """The hardware as built.

    Parameters
    ----------
    name : str, path, mapping or Device
        A built-in profile's name, a YAML file, or a mapping with a `base` and what is different from it, as the
        section `device` of a job file has it. A `Device` is given back as it is.

    Returns
    -------
    chainsim.Device
        With `rows`, `cols`, `f0_hz` and so on; frozen.

    Raises
    ------
    chainsim.ChainError, dotwave.AppError
        When there is no such profile or file, or what is given contradicts itself.

    Examples
    --------
    >>> import dotwave as dw
    >>> dw.device("linked-6x6").rows
    6
    >>> wide = dw.device({"base": "paper-6x6", "grid": {"cols": 8}})
    >>> wide.rows, wide.cols
    (6, 8)
    """
    if isinstance(name, Device):
        return name
    if isinstance(name, Mapping):
        from ..jobs.job import DevicePart

        return _checked(DevicePart, name, "device").device(Path())
    return load_device(str(name))


def text(
    source: str | PathLike[str] | TextSource,
    device: AnyDevice = USUAL_DEVICE,
    options: TextOptions | None = None,
    **changes: Any,
) -> Scene:
    """A text as Braille, page by page.

    The text is encoded as its frames are drawn; a long one is never held whole.

    Parameters
    ----------
    source : str, path or encoders.TextSource
        The words themselves, or the path (`pathlib.Path`) of a text (UTF-8, UTF-16, Unicode Braille, BRF) or a document
        (`encoders.READERS`).
    device : Device, name, file or mapping
        Whose grid the pages are laid out for, as `dotwave.device` takes it.
    options : encoders.TextOptions, optional
        Table, layout, reading rate and so on.
    **changes
        Single options by their names in `encoders.TextOptions`, such as ``table="language:de grade:2"``.

    Returns
    -------
    encoders.Scene
        Iterate its `frames`; each has a `pattern`, `cells`, the `text` it shows and `dwell_s` in seconds. It is an
        `encoders.TextScene`, but where images are shown as pictures.

    Raises
    ------
    encoders.EncodeError
        When there is nothing to show, or the table or the grid will not do.

    Examples
    --------
    >>> import dotwave as dw
    >>> scene = dw.text("Hello world", "linked-6x6")
    >>> [frame.text for frame in scene.frames]
    ['Hello', 'world']
    """
    profile = _device(device)
    chosen = replace(options or TextOptions(), **changes)
    given = source if isinstance(source, TextSource) else _source(source, chosen)
    if chosen.images is ImageChoice.PICTURE:
        # Imported here: a text without pictures does without what encodes them.
        from ..documents import illustrated_scene

        return illustrated_scene(given, profile, chosen)
    return text_scene(given, shape_of(profile), chosen)


def texture(
    kind: Mapping[str, Any] | TargetPattern, device: AnyDevice = USUAL_DEVICE, *, dwell_s: float = 2.0
) -> Scene:
    """A wave, bars, rings, walking bars, beats, levels, regions of them; text or bars that scroll, a moving dot.

    Parameters
    ----------
    kind : mapping or encoders.TargetPattern
        As the key `texture` of a job file: ``{"wave": {"lag_deg": 60}}``, ``{"bars": {"width": 1, "gap": 1}}``,
        ``{"rings": {"row": 2.5, "col": 2.5, "width": 1, "gap": 1}}``, ``{"walking_bars": {"rate_hz": 3}}``,
        ``{"unlocked": {"depth": 0.3, "period_s": 1.6}}``, ``{"levels": [[1, 0.5, ...], ...]}`` (of full scale, row by
        row), ``{"scroll": {"text": "Hello", "columns_per_s": 3}}``,
        ``{"dot": {"arrow": "right", "actuators_per_s": 3}}``.
    device : Device, name, file or mapping
        Whose grid it covers.
    dwell_s : float
        Seconds it is felt; a text that scrolls takes as long as it is.

    Returns
    -------
    encoders.Scene
        Of one frame; of what moves one for each place it passes (`encoders.levels_at` says what is between).

    Raises
    ------
    dotwave.AppError, encoders.EncodeError
        When there is no such texture, or it does not fit the grid.

    Examples
    --------
    >>> import dotwave as dw
    >>> dw.texture({"bars": {"width": 1, "gap": 1}}).parts
    ('texture: bars',)
    """
    if isinstance(kind, TargetPattern):
        return still_scene(kind, dwell_s, "texture")
    from ..jobs.texture import TexturePart

    part = _checked(TexturePart, dict(kind) | {"dwell_s": dwell_s}, "texture")
    return part.scene(shape_of(_device(device)))


def job(path: str | PathLike[str]) -> DeviceScene:
    """A job file: texts, pictures, textures and pauses, on its own device and with its own tolerance.

    Parameters
    ----------
    path : path
        Of the YAML file; `dotwave schema` prints what may stand in it.

    Returns
    -------
    encoders.Scene
        Which `dotwave.plan` plans on its `device` when no other is given.

    Raises
    ------
    dotwave.AppError, chainsim.ChainError, encoders.EncodeError
        When the job, or what it names, cannot be used; the message says in which line.

    Examples
    --------
    >>> import dotwave as dw
    >>> dw.job("samples/jobs/mixed.yaml").device.name
    'wide'
    """
    from ..jobs.scene import read_job_scene

    return read_job_scene(Path(path))


_device = device


def _checked(model: type[Model], given: Mapping[str, Any], what: str) -> Model:
    try:
        return model.model_validate(dict(given))
    except ValidationError as error:
        complaint = complaint_of(error)
        place = ".".join(filter(None, (what, words_of(complaint.place) if complaint.place else "")))
        raise AppError(f"{place}: {complaint.sentence}") from None


def _source(source: str | PathLike[str], options: TextOptions) -> TextSource:
    if isinstance(source, str):
        return TextSource.of_text(source)
    return TextSource.of_path(Path(source), encoding=options.encoding, math=options.math)
