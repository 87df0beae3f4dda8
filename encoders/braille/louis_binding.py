"""The one place that knows the Braille library liblouis, through its own binding `louis`.

liblouis is not safe in threads, so every call holds one lock. Compiled tables stay in memory (they take
up to 90 ms each); nothing is freed between calls. What the library logs is collected, never printed.
"""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
import threading
from collections import deque
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from ..errors import LouisMissing

__all__ = [
    "back_translate",
    "compiles",
    "complaint",
    "hyphenate",
    "liblouis_place",
    "liblouis_version",
    "listed_tables",
    "table_info",
    "translate",
    "translate_string",
]

# Where distributions put the binding; a virtual environment does not look there.
_PATTERNS = (
    "/usr/lib/python3/dist-packages",
    "/usr/lib/python3*/site-packages",
    "/usr/lib64/python3*/site-packages",
    "/usr/local/lib/python3*/dist-packages",
    "/usr/local/lib/python3*/site-packages",
    "/opt/homebrew/lib/python3*/site-packages",
)
_DOTS_AS_UNICODE = 4 | 64  # dotsIO | ucBrl
_NO_UNDEFINED = 128
# Characters of a text for which buffers are kept; paragraphs come in pieces of fewer.
_USUAL = 2048
_LOG_WARN, _LOG_ERROR = 30000, 40000
# With this display table in front every table reads and writes U+28xx, also those that bring another one.
_UNICODE_DISPLAY = "unicode.dis"

_lock = threading.RLock()
_messages: deque[str] = deque(maxlen=20)
_kept: list[Any] = []  # the C library holds a pointer to the callback: it must not be collected


@cache
def _louis() -> ModuleType:
    module = _imported() or _from_distribution()
    if module is None:
        raise LouisMissing(f"the Braille library liblouis (python3-louis) was not found; {_cure()}")

    def note(level: int, message: bytes) -> None:
        if level >= _LOG_ERROR:
            _messages.append(message.decode("utf-8", "replace"))

    _kept.append(module.LogCallback(note))
    module.registerLogCallback(_kept[-1])
    module.setLogLevel(_LOG_WARN)
    _declare(module.liblouis)
    return module


def _cure() -> str:
    # Imported here: only a machine without the library needs it.
    from .louis_cure import install_words

    return install_words()


def _imported() -> ModuleType | None:
    """`import louis`, if it is liblouis: the package of that name on PyPI is an empty shell."""
    try:
        module = importlib.import_module("louis")
    except (ImportError, OSError):
        return None
    return module if hasattr(module, "translate") and hasattr(module, "liblouis") else None


def _from_distribution() -> ModuleType | None:
    for pattern in _PATTERNS:
        for folder in sorted(Path("/").glob(pattern.lstrip("/"))):
            path = folder / "louis" / "__init__.py"
            spec = importlib.util.spec_from_file_location("louis", path) if path.is_file() else None
            if spec is None or spec.loader is None:
                continue
            module = importlib.util.module_from_spec(spec)
            try:
                spec.loader.exec_module(module)
            except (ImportError, OSError) as error:
                raise LouisMissing(f"{path} cannot be loaded ({error}); {_cure()}") from None
            return module
    return None


def _declare(library: Any) -> None:
    """Types of the calls the binding of 3.24 lacks."""
    library.lou_listTables.restype = ctypes.POINTER(ctypes.c_char_p)
    library.lou_getTableInfo.restype = ctypes.c_char_p
    library.lou_getTableInfo.argtypes = (ctypes.c_char_p, ctypes.c_char_p)


def liblouis_place() -> str:
    """The file the binding was loaded from."""
    with _lock:
        return str(_louis().__file__)


def liblouis_version() -> str:
    """Version of the library, for example ``3.24.0``."""
    with _lock:
        return str(_louis().version())


def complaint() -> str:
    """What the library logged first as an error since tables were last checked; empty when nothing."""
    return _messages[0] if _messages else ""


def compiles(tables: tuple[str, ...]) -> bool:
    """Whether the list of tables is found and compiles."""
    with _lock:
        louis = _louis()
        _messages.clear()
        try:
            louis.checkTable(list(tables))
        except RuntimeError:
            return False
        return True


def translate(
    tables: tuple[str, ...], text: str, emphases: list[int] | None = None
) -> tuple[str, list[int], list[int]]:
    """Cells of `text`, the text position of each cell, the cell position of each character.

    `emphases` has the typeform of each character; None where nothing stands out, as zeros are not the same to old
    tables. The last list is shorter than `text` when the library stopped early. A position may be -1.
    """
    with _lock:
        louis = _louis()
        if emphases is None and len(text) <= _USUAL:
            return _plainly(louis, tables, text)
        cells, text_of_cell, cell_of_text, _ = louis.translate(
            list(tables), text, typeform=emphases, mode=_DOTS_AS_UNICODE
        )
    return cells, text_of_cell, cell_of_text


def _plainly(louis: ModuleType, tables: tuple[str, ...], text: str) -> tuple[str, list[int], list[int]]:
    """As the binding's `translate` does it without emphases, in buffers that are made once: a third quicker."""
    raw = text.encode(louis.conversionEncoding, "surrogatepass")
    read = ctypes.c_int(len(raw) // louis.wideCharBytes)
    written = ctypes.c_int(read.value * louis.outlenMultiplier)
    cells, text_of_cell, cell_of_text = _buffers(_USUAL * louis.outlenMultiplier, louis.wideCharBytes)
    done = louis.liblouis.lou_translate(
        ",".join(tables).encode(louis.fileSystemEncoding), raw, ctypes.byref(read), cells, ctypes.byref(written),
        None, None, cell_of_text, text_of_cell, None, _DOTS_AS_UNICODE,
    )  # fmt: skip
    if not done:
        raise RuntimeError(f"liblouis cannot translate {text!r}")
    found = ctypes.string_at(cells, written.value * louis.wideCharBytes)
    return (
        found.decode(louis.conversionEncoding, "surrogatepass"),
        text_of_cell[: written.value],
        cell_of_text[: read.value],
    )


@cache
def _buffers(size: int, char_bytes: int) -> tuple[Any, Any, Any]:
    """Room for so many cells, and for two lists of places."""
    return ctypes.create_string_buffer(size * char_bytes), (ctypes.c_int * size)(), (ctypes.c_int * size)()


def translate_string(tables: tuple[str, ...], text: str, *, undefined: bool) -> str:
    """Cells of `text`; with `undefined` false, characters without a definition write nothing."""
    mode = _DOTS_AS_UNICODE | (0 if undefined else _NO_UNDEFINED)
    with _lock:
        return str(_louis().translateString(list(tables), text, mode=mode))


def back_translate(tables: tuple[str, ...], cells: str) -> str:
    """Text of Unicode Braille `cells`. The mode is 0: with dotsIO the library prints numbers instead."""
    with _lock:
        return str(_louis().backTranslateString([_UNICODE_DISPLAY, *tables], cells, mode=0))


def hyphenate(tables: tuple[str, ...], word: str) -> list[int]:
    """Positions in `word` before which it may be broken; empty when the library has no answer."""
    with _lock:
        try:
            marks = _louis().hyphenate(list(tables), word)
        except RuntimeError:
            return []
    return [index for index, mark in enumerate(marks) if index and mark == "1"]


def listed_tables() -> list[str]:
    """Paths of all tables that carry metadata."""
    with _lock:
        found = _louis().liblouis.lou_listTables()
        paths: list[str] = []
        while found and found[len(paths)]:
            paths.append(found[len(paths)].decode())
        return paths


def table_info(path: str, key: str) -> str:
    """Metadata `key` of a table, empty when it has none."""
    with _lock:
        value = _louis().liblouis.lou_getTableInfo(path.encode(), key.encode())
        return value.decode("utf-8", "replace") if value else ""
