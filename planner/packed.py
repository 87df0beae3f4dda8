"""Planned chains and ramps as bytes, and back."""

from __future__ import annotations

import io
import json
from dataclasses import fields
from functools import lru_cache
from typing import Any

import numpy as np

from chainsim import Outcome

from .operating_point import Margins, OperatingPoint, PointTone
from .plan import Ramp, ToneRamp

__all__ = ["packed", "unpacked"]


def packed(value: OperatingPoint | Ramp) -> bytes:
    """Plain values as a line of JSON, then the arrays as NPY; no pickle."""
    arrays: list[np.ndarray[Any, Any]] = []
    plain = _plain(value, arrays)
    parts = [json.dumps(plain).encode(), b"\n"]
    for array in arrays:
        parts += [_header(array.dtype.str, array.shape), array.tobytes()]
    return b"".join(parts)


@lru_cache(maxsize=256)
def _header(descr: str, shape: tuple[int, ...]) -> bytes:
    """What an NPY file begins with; worked out once, since writing it takes longer than most arrays."""
    out = io.BytesIO()
    np.lib.format.write_array_header_1_0(out, {"descr": descr, "fortran_order": False, "shape": shape})
    return out.getvalue()


@lru_cache(maxsize=256)
def _empty(header: bytes) -> np.ndarray[Any, Any]:
    """An array of the kind that an NPY file's beginning speaks of."""
    source = io.BytesIO(header)
    if np.lib.format.read_magic(source) != (1, 0):
        raise ValueError("an array of another format")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(source)
    if fortran or dtype.kind not in "fcib":
        raise ValueError(f"an array of {dtype}")
    return np.empty(shape, dtype)


_PARTS = {kind.__name__: kind for kind in (OperatingPoint, Margins, Ramp, PointTone, ToneRamp)}


def _plain(item: Any, arrays: list[np.ndarray[Any, Any]]) -> Any:
    if isinstance(item, np.ndarray):
        arrays.append(item)
        return {"array": len(arrays) - 1}
    if type(item) in _PARTS.values():
        return {"type": type(item).__name__} | {
            field.name: _plain(getattr(item, field.name), arrays) for field in fields(item)
        }
    if isinstance(item, complex):
        return {"complex": [item.real, item.imag]}
    return [_plain(one, arrays) for one in item] if isinstance(item, tuple) else item


def unpacked(raw: bytes) -> OperatingPoint | Ramp:
    """What `packed` made bytes of.

    Raises
    ------
    ValueError, LookupError, TypeError, AttributeError, EOFError
        When it did not make these.
    """
    at = raw.index(b"\n") + 1
    plain = json.loads(raw[:at])
    # Arrays lie in the order of their numbers; bytes 8 and 9 of each say how long its header is.
    arrays: list[np.ndarray[Any, Any]] = []
    while at < len(raw):
        begin = at + 10 + int.from_bytes(raw[at + 8 : at + 10], "little")
        kind = _empty(raw[at:begin])
        at = begin + kind.nbytes
        array = np.frombuffer(raw[begin:at], kind.dtype).reshape(kind.shape)
        arrays.append(array)
    value = _whole(plain, arrays)
    if not isinstance(value, OperatingPoint | Ramp):
        raise ValueError("neither a state nor a ramp")
    return value


def _whole(item: Any, arrays: list[np.ndarray[Any, Any]]) -> Any:
    if isinstance(item, list):
        return tuple(_whole(one, arrays) for one in item)
    if not isinstance(item, dict):
        return item
    if "array" in item:
        return arrays[item["array"]]
    if "complex" in item:
        return complex(*item["complex"])
    found = {name: _whole(one, arrays) for name, one in item.items()}
    kind = found.pop("type")
    if "outcome" in found:
        found["outcome"] = Outcome(found["outcome"])
    return _PARTS[kind](**found)
