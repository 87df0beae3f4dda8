"""Job files: a sequence of texts, pictures, textures and pauses on a device, read strictly."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationError,
    create_model,
    field_validator,
    model_validator,
)

from chainsim import (
    Actuator,
    Amplifier,
    Coupling,
    Device,
    Located,
    Modulation,
    Span,
    complaint_of,
    load_device,
    read_located,
    shown,
    words_of,
)
from encoders import (
    EmphasisChoice,
    ImageChoice,
    LineEnds,
    Mathematics,
    PageNumbering,
    PictureOptions,
    Presentation,
    Style,
    Undefined,
    picture_rules,
)

from ..request import TOLERANCES
from .part import Part, Positive, Seconds
from .paths import FilePath
from .texture import TexturePart

__all__ = [
    "SCHEMA",
    "Budget",
    "DevicePart",
    "Item",
    "Job",
    "PicturePart",
    "TextPart",
    "job_schema",
    "locate_job",
    "read_job",
]

SCHEMA = "dotwave/job/1"

MOST_ACTUATORS_A_SIDE = 1024


def _whole(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MOST_ACTUATORS_A_SIDE:
        raise ValueError(f"expected a whole number from 1 to {MOST_ACTUATORS_A_SIDE}, got {shown(value)}")
    return value


Count = Annotated[int, BeforeValidator(_whole), Field(json_schema_extra={"minimum": 1, "maximum": 1024})]


COLOUR = "auto|#[0-9a-fA-F]{6}"


def _colour(value: str) -> str:
    if not re.fullmatch(COLOUR, value):
        raise ValueError(f"expected auto or a colour such as '#ffffff', got {shown(value)}")
    return value


Colour = Annotated[str, AfterValidator(_colour), Field(json_schema_extra={"pattern": f"^({COLOUR})$"})]


class GridPart(Part):
    """Size of the grid in actuators, and the distance of neighbours in metres."""

    rows: Count | None = None
    cols: Count | None = None
    pitch_m: Positive | None = None


class DevicePart(Part):
    """A device: a profile's name or file as `base`, and what is different from it.

    A grid with another number of columns keeps one chain a row where the base has that, and one chain of all where the
    base is coupled in two dimensions. `actuators` stand in the place
    of those the base has.
    """

    base: FilePath = "paper-6x6"
    name: str | None = None
    grid: GridPart | None = None
    chain_length: Count | None = None
    f0_hz: Positive | None = None
    delta: Positive | None = None
    beta: float | None = None
    length_m: Positive | None = None
    full_scale: Positive | None = None
    epsilon_per_volt: Positive | None = None
    bias_per_volt: Positive | None = None
    omega: Span | None = None
    coupling: Coupling | None = None
    bias: Literal["none", "actuator"] | None = None
    amplifier: Amplifier | None = None
    actuators: tuple[Actuator, ...] | None = None
    spread: dict[str, float] | None = None
    modulation: Modulation | None = None

    short: ClassVar[str] = "base"

    @model_validator(mode="after")
    def _builds(self) -> DevicePart:
        if not self.in_file:
            self.device(Path())
        return self

    @property
    def in_file(self) -> bool:
        """Whether the base is a profile's file, and not the name of one that is built in."""
        return Path(self.base).suffix.lower() in {".yaml", ".yml"}

    def device(self, folder: Path) -> Device:
        """The device; a profile's file is looked for from `folder`.

        Raises
        ------
        ValueError
            When there is no such base, or the result contradicts itself.
        """
        return self.on(load_device(str(folder / self.base) if self.in_file else self.base))

    def on(self, base: Device) -> Device:
        """`base` with what is different from it.

        Raises
        ------
        ValueError
            When the result contradicts itself.
        """
        given = self.model_dump(exclude_none=True, exclude={"base"}, by_alias=True)
        grid = given.pop("grid", {})
        if base.grid and grid:
            sides = {"rows": base.rows, "cols": base.cols} | grid
            grid = {"chain_length": sides["rows"] * sides["cols"]} | grid
        elif base.chain_length == base.cols and "cols" in grid:
            grid = {"chain_length": grid["cols"]} | grid
        if not given and not grid:
            return base
        profile = base.as_dict() | {"name": f"{base.name}, changed"} | grid | given
        try:
            return Device.model_validate(profile)
        except ValidationError as error:
            first = complaint_of(error)
            place = f"{words_of(first.place)}: " if first.place else ""
            raise ValueError(f"{place}{first.sentence}") from None


class TextPart(Part):
    """Words, or a file of them, as Braille; the rest as `dotwave text` has it."""

    say: str | None = None
    file: FilePath | None = None
    table: str = "en-ueb-g2.ctb"
    undefined: Undefined = Undefined.NAME
    cell_gap: Annotated[int, Field(ge=0)] = 0
    line_gap: Annotated[int, Field(ge=0)] = 0
    rate: Positive | None = None
    dwell_s: Seconds | None = None
    presentation: Presentation | None = None
    dots: Literal[6, 8] | None = None
    blank_between: bool = False
    emphasis: EmphasisChoice | None = None
    images: ImageChoice = ImageChoice.WORDS
    math: Mathematics = Mathematics.NEMETH
    encoding: str | None = None
    start_at: Annotated[str | int | None, Field(alias="from")] = None
    pages: str | int | None = None
    lines: LineEnds | None = None
    page_numbers: PageNumbering = PageNumbering.NONE

    short: ClassVar[str] = "say"

    @model_validator(mode="after")
    def _one_source(self) -> TextPart:
        if (self.say is None) == (self.file is None):
            raise ValueError("give either say (the words) or file")
        return self


class _PictureFile(Part):
    """A picture; the options are those of `encoders.PictureOptions`."""

    file: FilePath
    style: Style = Style.AUTO
    background: Colour = "auto"

    short: ClassVar[str] = "file"

    @model_validator(mode="after")
    def _fits(self) -> Self:
        self.options(8e-3)
        return self

    def options(self, pitch_m: float) -> PictureOptions:
        """The encoder's options for a grid with that pitch."""
        return PictureOptions(**self.model_dump(exclude={"file"}), pitch_m=(pitch_m, pitch_m))


def _picture_keys() -> dict[str, Any]:
    """The options of the encoder as keys; the pitch is the device's, and candidates are for sets of icons."""
    keys = {}
    for name, rule in picture_rules().items():
        if name not in {*_PictureFile.model_fields, "pitch_m", "candidates"}:
            span = Field() if rule.span is None else Field(ge=rule.span.low, le=rule.span.high)
            keys[name] = Annotated[rule.type, span], rule.default
    return keys


if TYPE_CHECKING:
    PicturePart: TypeAlias = _PictureFile
else:
    PicturePart = create_model("PicturePart", __base__=_PictureFile, __doc__=_PictureFile.__doc__, **_picture_keys())


class Item(Part):
    """One thing of the sequence: exactly one of the keys; `icon` is an `image` with the defaults of icons."""

    text: TextPart | None = None
    image: PicturePart | None = None
    icon: PicturePart | None = None
    texture: TexturePart | None = None
    pause_s: Seconds | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Item:
        if sum(value is not None for _, value in self) != 1:
            raise ValueError(f"give exactly one of {', '.join(type(self).model_fields)}")
        return self

    @property
    def kind(self) -> str:
        """The key that is given."""
        return next(name for name, value in self if value is not None)


def _tolerance(value: Any) -> Any:
    if isinstance(value, str) and value in TOLERANCES:
        return value
    try:
        # YAML takes 1e-3 for words.
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not 0 < number < math.inf:
        raise ValueError(f"expected 'draft', 'normal', 'fine' or a number > 0 such as 1e-3, got {shown(value)}")
    return number


Tolerance = Annotated[Literal["draft", "normal", "fine"] | Annotated[float, Field(gt=0)], BeforeValidator(_tolerance)]


class Budget(Part):
    """Most seconds that planning may take (`--budget`); frames that are not reached then are out_of_budget."""

    planning_s: Positive


class Job(Part):
    """A job: what is shown, on what, how exactly, and where it is written.

    Paths are relative to the job file. `tolerance` says how exact a frame must be to be ok, as `--tol` does (draft,
    normal and fine: 10, 2 and 0.5 % of full scale, or a number in units of it). `presentation` is for the texts that
    do not say their own. `yield` is the share of devices, drawn with the device's spread, that are to keep what is
    wished, as `--yield`. Without `output` the job is planned only.
    """

    schema_: Literal["dotwave/job/1"] = Field("dotwave/job/1", alias="schema")
    device: DevicePart = DevicePart()
    tolerance: Tolerance = "normal"
    budget: Budget | None = None
    contrast_db: Annotated[float, Field(ge=6, le=60)] | None = None
    yield_: Annotated[float, Field(gt=0, le=1)] | None = Field(None, alias="yield")
    presentation: Presentation = Presentation.TOGETHER
    output: FilePath | None = None
    sample_format: Literal["float32", "pcm24"] = "float32"
    sequence: Annotated[tuple[Item, ...], Field(json_schema_extra={"minItems": 1})]

    @property
    def tol(self) -> float:
        """The tolerance as a number, in units of full scale."""
        return TOLERANCES[self.tolerance] if isinstance(self.tolerance, str) else self.tolerance

    @field_validator("sequence")
    @classmethod
    def _not_empty(cls, sequence: tuple[Item, ...]) -> tuple[Item, ...]:
        if not sequence:
            raise ValueError("expected at least one item such as '- text: Hello', got none")
        return sequence


def read_job(path: Path) -> Job:
    """Read a job file.

    Raises
    ------
    chainsim.ProfileError
        When it cannot be read or does not fit: ``job.yaml:14: device.grid.rows: expected ...``.
    """
    return locate_job(path).model


def locate_job(path: Path) -> Located[Job]:
    """Read a job file, with the lines that everything in it stands in; raises as `read_job` does."""
    return read_located(path, Job)


def job_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of job files, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | Job.model_json_schema(by_alias=True)
