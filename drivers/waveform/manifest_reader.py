"""Reading a manifest: every complaint names the file and the field."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from chainsim import Device, Outcome, complaint_of, shown, words_of
from encoders import GoesOn, PageNumber
from planner import FrameWish

from ..channels import Channel, Role
from ..errors import UnreadableWaveform
from ..files.whole import first_of_plain
from ..formats.table import PACK_SUFFIX, SUFFIXES
from .coupling import CouplingEvent
from .manifest import MOST_BYTES, FrameMark, HeadingMark, Manifest

__all__ = ["manifest_of", "read_manifest"]

# As many as an amplifier has; as many as a file of 64 bits can hold.
MOST_HZ = 10_000_000
MOST_SAMPLES = 1 << 60
Finite = Annotated[float, Field(allow_inf_nan=False)]
Seconds = Annotated[float, Field(ge=0, le=1e12, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
# A length to hold to also makes sure that it is text which can be written: JSON can name half a character.
Words = Annotated[str, Field(max_length=1_000_000)]
Index = Annotated[int, Field(ge=0)]


class _Part(BaseModel):
    model_config = ConfigDict(strict=True)


class _Channel(_Part):
    index: Index
    role: Annotated[Role, Field(strict=False)]
    row: Index
    col: Index | None = None
    volts_per_unit: Positive


class _Event(_Part):
    t_s: Seconds
    row: Index
    lam: list[Finite]
    ramp_s: Seconds
    lam_y: list[Finite] = []


class _GoesOn(_Part):
    run: Index
    mark: Words = ""
    restated: Words = ""
    ending: Words = ""
    left_out: Words = ""


class _PageNumber(_Part):
    at: Index
    cells: Annotated[Words, Field(min_length=1)]


class _Frame(_Part):
    start_s: Seconds
    settled_s: Seconds
    end_s: Seconds
    omega: list[NotNegative]
    target: list[list[Finite]]
    wish: list[list[Finite | None]] | None = None
    contrast_db: Positive | None = None
    cells: Words = ""
    text: Words = ""
    outcome: Annotated[Outcome, Field(strict=False)]
    page: Index = 0
    span: Annotated[list[Index], Field(min_length=2, max_length=2)] = [0, 0]
    tones: list[list[Positive]] | None = None
    phase: list[list[Finite | None]] | None = None
    moving: list[bool] | None = None
    modulated: list[bool] | None = None
    goes_on: list[_GoesOn] = []
    number: _PageNumber | None = None
    smoothness: Literal[0, 9] = 0
    beats: list[Annotated[list[Positive], Field(min_length=2, max_length=2)] | None] | None = None


class _Heading(_Part):
    level: Annotated[int, Field(ge=1, le=6)]
    text: Words
    frame: Index
    page: Index
    start_s: Seconds


class _File(_Part):
    schema_: Literal["dotwave/waveform/1"] = Field(alias="schema")
    samples_file: Annotated[Words, Field(min_length=1)]
    rate_hz: Annotated[int, Field(ge=1, le=MOST_HZ)]
    samples: Annotated[int, Field(ge=0, le=MOST_SAMPLES)]
    digest: Annotated[str, Field(pattern="^sha256:[0-9a-f]{64}$")]
    device: Device
    channels: Annotated[list[_Channel], Field(min_length=1)]
    coupling: list[_Event]
    frames: list[_Frame]
    encoding: dict[str, Any] = {}
    headings: list[_Heading] = []


def read_manifest(path: Path) -> Manifest:
    """Read and check the manifest at `path`. Keys it does not know are passed over.

    Raises
    ------
    FileError
        When the file cannot be read.
    UnreadableWaveform
        When it is not JSON, or a field is missing, of another type, or contradicts the device; the message
        is one line such as ``hello.json: frames[3].target: expected 6 rows of 6 numbers``.
    """
    raw = first_of_plain(path, MOST_BYTES + 1)
    if len(raw) > MOST_BYTES:
        raise UnreadableWaveform(f"{path}: more than {MOST_BYTES} bytes; a manifest has at most so many")
    try:
        data = json.loads(raw, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise UnreadableWaveform(f"{path}: not JSON: {error}") from None
    if not isinstance(data, dict):
        raise UnreadableWaveform(f"{path}: not a manifest: expected an object with a schema")
    return manifest_of(path, data)


def manifest_of(path: Path, data: Mapping[str, Any]) -> Manifest:
    """The manifest that plain JSON types are; `path` is for messages.

    Raises
    ------
    UnreadableWaveform
        As `read_manifest`.
    """
    try:
        file = _File.model_validate(data)
    except ValidationError as error:
        first = complaint_of(error)
        raise UnreadableWaveform(f"{path}: {_place(first.place)}: {first.sentence}") from None
    _Check(path, file.device).all(file)
    return _manifest(file)


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number in JSON")


def _place(parts: tuple[str | int, ...]) -> str:
    words = (f"[{part}]" if isinstance(part, int) else f".{words_of((part,))}" for part in parts)
    return "".join(words).removeprefix(".") or "file"


class _Check:
    """What a type cannot say: sizes, order and agreement with the device."""

    def __init__(self, path: Path, device: Device) -> None:
        self._path = path
        self._device = device

    def all(self, file: _File) -> None:
        if Path(file.samples_file).name != file.samples_file or "\0" in file.samples_file:
            self._refuse("samples_file", f"expected a name without folders, got {shown(file.samples_file)}")
        if Path(file.samples_file).suffix.lower() not in (*SUFFIXES, PACK_SUFFIX):
            wanted = f"a name that ends in {', '.join(SUFFIXES)}"
            self._refuse("samples_file", f"expected {wanted}, got {shown(file.samples_file)}")
        self._channels(file.channels)
        last = [0.0] * self._device.rows
        for index, event in enumerate(file.coupling):
            self._event(f"coupling[{index}]", event, last)
        end_s = 0.0
        for index, frame in enumerate(file.frames):
            # Frames join on a sample; their times in seconds may overlap by a rounding.
            if round(frame.start_s * file.rate_hz) < round(end_s * file.rate_hz):
                self._refuse(
                    f"frames[{index}].start_s", f"{frame.start_s} s is before the frame ahead ends, at {end_s} s"
                )
            self._frame(f"frames[{index}]", frame)
            end_s = frame.end_s
        for index, heading in enumerate(file.headings):
            if heading.frame >= len(file.frames):
                self._refuse(f"headings[{index}].frame", f"there is no frame {heading.frame}")
        if end_s * file.rate_hz > file.samples + 1:
            self._refuse(f"frames[{len(file.frames) - 1}].end_s", f"{end_s} s is after the last of the samples")

    def _channels(self, channels: list[_Channel]) -> None:
        driven: set[tuple[Role, int, int]] = set()
        begins = set(self._device.driven)
        for index, channel in enumerate(channels):
            place = f"channels[{index}]"
            if channel.index != index:
                self._refuse(f"{place}.index", f"expected {index}, got {channel.index}")
            self._row(place, channel.row)
            if (channel.col or 0) >= self._device.cols:
                self._refuse(f"{place}.col", f"expected 0 to {self._device.cols - 1}, got {channel.col}")
            if channel.role is Role.BIAS and channel.col is None:
                self._refuse(f"{place}.col", "a bias channel needs a col")
            if channel.role is Role.DRIVE and (channel.row, channel.col or 0) not in begins:
                self._refuse(f"{place}.col", f"no chain begins at col {channel.col}")
            target = (channel.role, channel.row, channel.col or 0)
            if target in driven:
                self._refuse(place, "a second channel for the same actuator and role")
            driven.add(target)

    def _event(self, place: str, event: _Event, last: list[float]) -> None:
        self._row(place, event.row)
        if len(event.lam) != self._device.cols - 1:
            self._refuse(f"{place}.lam", f"expected {self._device.cols - 1} numbers, got {len(event.lam)}")
        downwards = self._device.cols if self._device.grid else 0
        if len(event.lam_y) != downwards:
            self._refuse(f"{place}.lam_y", f"expected {downwards} numbers, got {len(event.lam_y)}")
        if event.t_s < last[event.row]:
            self._refuse(f"{place}.t_s", f"{event.t_s} s is before the event ahead of it, at {last[event.row]} s")
        last[event.row] = event.t_s

    def _frame(self, place: str, frame: _Frame) -> None:
        rows, cols = self._device.rows, self._device.cols
        if len(frame.omega) != rows:
            self._refuse(f"{place}.omega", f"expected {rows} numbers, one for each row, got {len(frame.omega)}")
        if len(frame.target) != rows or any(len(row) != cols for row in frame.target):
            self._refuse(f"{place}.target", f"expected {rows} rows of {cols} numbers")
        lists = {"tones": frame.tones, "moving": frame.moving, "modulated": frame.modulated, "beats": frame.beats}
        for name, value in lists.items():
            if value is not None and len(value) != rows:
                self._refuse(f"{place}.{name}", f"expected {rows} entries, one for each row, got {len(value)}")
        if any(frame.modulated or ()) and self._device.modulation is None:
            self._refuse(f"{place}.modulated", "the device has no modulation")
        for name, grid in (("wish", frame.wish), ("phase", frame.phase)):
            if grid is not None and (len(grid) != rows or any(len(row) != cols for row in grid)):
                self._refuse(f"{place}.{name}", f"expected {rows} rows of {cols} numbers or null")
        for row, (omega, moves) in enumerate(zip(frame.omega, _moving(frame, self._device), strict=True)):
            if moves and not omega:
                self._refuse(f"{place}.omega[{row}]", "expected a number above 0 where a row moves, got 0")
        if not frame.start_s <= frame.settled_s <= frame.end_s:
            times = f"start_s {frame.start_s}, settled_s {frame.settled_s}, end_s {frame.end_s}"
            self._refuse(place, f"{times} are not in order")

    def _row(self, place: str, row: int) -> None:
        if row >= self._device.rows:
            self._refuse(f"{place}.row", f"expected 0 to {self._device.rows - 1}, got {row}")

    def _refuse(self, place: str, why: str) -> NoReturn:
        raise UnreadableWaveform(f"{self._path}: {place}: {why}")


def _manifest(file: _File) -> Manifest:
    return Manifest(
        samples_file=file.samples_file,
        rate_hz=file.rate_hz,
        samples=file.samples,
        digest=file.digest,
        device=file.device,
        channels=tuple(Channel(c.index, c.role, c.row, c.col, c.volts_per_unit) for c in file.channels),
        coupling=tuple(CouplingEvent(e.t_s, e.row, tuple(e.lam), e.ramp_s, tuple(e.lam_y)) for e in file.coupling),
        frames=tuple(_mark(frame, file.device) for frame in file.frames),
        encoding=file.encoding,
        headings=tuple(HeadingMark(h.level, h.text, h.frame, h.page, h.start_s) for h in file.headings),
    )


def _mark(frame: _Frame, device: Device) -> FrameMark:
    any_phase = [[None] * device.cols] * device.rows
    # What was written before wishes were kept is judged by what it aims at.
    wish = _frozen(_with_nan(frame.wish or frame.target))
    return FrameMark(
        start_s=frame.start_s,
        settled_s=frame.settled_s,
        end_s=frame.end_s,
        omega=_frozen(frame.omega),
        target=_frozen(frame.target),
        cells=frame.cells,
        text=frame.text,
        outcome=frame.outcome,
        page=frame.page,
        span=(frame.span[0], frame.span[1]),
        tones=tuple(tuple(row) for row in frame.tones or [[]] * device.rows),
        phase=_frozen(_with_nan(frame.phase or any_phase)),
        moving=_moving(frame, device),
        modulated=tuple(frame.modulated or [False] * device.rows),
        wish=FrameWish(wish, frame.contrast_db, bool(frame.cells.strip())),
        goes_on=tuple(GoesOn(one.run, one.mark, one.restated, one.ending, one.left_out) for one in frame.goes_on),
        number=None if frame.number is None else PageNumber(frame.number.at, frame.number.cells),
        smoothness=frame.smoothness,
        beats=tuple(None if one is None else (one[0], one[1]) for one in frame.beats or ()),
    )


def _with_nan(rows: Sequence[Sequence[float | None]]) -> list[list[float]]:
    return [[math.nan if one is None else one for one in row] for row in rows]


def _moving(frame: _Frame, device: Device) -> tuple[bool, ...]:
    """Whether rows move: where a file from before that was written does not say it, all do, or all stand on a bias."""
    return tuple([device.bias == "none"] * device.rows if frame.moving is None else frame.moving)


def _frozen(values: ArrayLike) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array
