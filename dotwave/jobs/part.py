"""What all parts of a job file have in common."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler, model_validator
from pydantic_core import CoreSchema

__all__ = ["AtLeastOne", "Finite", "Level", "NotNegative", "Part", "Place", "Positive", "Seconds"]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Seconds = Annotated[float, Field(gt=0, le=3600)]
Level = Annotated[float, Field(gt=0, le=1)]
AtLeastOne = Annotated[int, Field(ge=1)]
Place = Annotated[int, Field(ge=0)]


class Part(BaseModel):
    """A section of a job file: unknown keys are refused, nothing changes after reading.

    Where `short` names a key, the section may be written as that key's text alone.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    short: ClassVar[str] = ""

    @model_validator(mode="before")
    @classmethod
    def _from_text(cls, value: Any) -> Any:
        return {cls.short: value} if cls.short and isinstance(value, str) else value

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """The section's schema; text alone fits too where there is a short form."""
        schema = handler(core)
        return {"anyOf": [{"type": "string"}, schema]} if cls.short else schema
