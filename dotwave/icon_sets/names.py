"""Names of icons: of whatever a file system or an archive holds, what can be shown, kept and written."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import PurePosixPath

from ..plain import HIDDEN

__all__ = ["shown_name", "unique_names"]

# A colon and a backslash can lead out of a folder on Windows.
_UNSAFE = re.compile(f"[{HIDDEN}\t\n:\\\\]")


def shown_name(path: str) -> str:
    """The parts of `path` below its root, safe to show and to write below any folder.

    Each byte (UTF-8) of a control character, of a mark that turns the direction of writing, of a colon or a backslash,
    and each byte that is not UTF-8, becomes ``%`` and two hex digits; ``..`` is left out.
    """
    parts = [part for part in PurePosixPath(path).parts if part not in {"/", "//", ".."}]
    return _UNSAFE.sub(_percent, "/".join(parts))


def unique_names(names: Iterable[str]) -> Iterator[str]:
    """The same names, those that came before with a number."""
    seen: Counter[str] = Counter()
    for name in names:
        seen[name] += 1
        yield name if seen[name] == 1 else f"{name} ({seen[name]})"


def _percent(found: re.Match[str]) -> str:
    code = ord(found[0])
    # What stands for a byte that could not be decoded (PEP 383) is that byte.
    raw = bytes([code - 0xDC00]) if 0xDC80 <= code <= 0xDCFF else found[0].encode("utf-8", "surrogatepass")
    return "".join(f"%{byte:02X}" for byte in raw)
