"""What a shell is offered for the beginning of a word: names of devices, and files of the fitting kind.

Nothing heavy is imported: a shell waits for each answer.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

__all__ = ["completed_devices", "completed_files", "completed_texts"]

Completer = Callable[[str], list[str]]


def completed_files(*suffixes: str) -> Completer:
    """A function that gives files with one of the suffixes, and folders, that begin with a word.

    Names with white space are left to the shell, which knows how to quote them.
    """

    def complete(incomplete: str) -> list[str]:
        folder, start = os.path.split(incomplete)
        try:
            entries = sorted(os.scandir(folder or "."), key=lambda entry: entry.name)
        except OSError:
            return []
        found = [
            os.path.join(folder, entry.name) + ("/" if entry.is_dir() else "")
            for entry in entries
            if entry.name.startswith(start) and (start or not entry.name.startswith("."))
            if (entry.is_dir() or entry.name.lower().endswith(suffixes)) and not any(map(str.isspace, entry.name))
        ]
        # A folder alone is gone into, or the shell would take the word for finished.
        return found + complete(found[0]) if len(found) == 1 and found[0].endswith("/") else found

    return complete


def completed_devices(incomplete: str) -> list[str]:
    """Built-in profiles that begin with a word, else YAML files."""
    spec = find_spec("chainsim")
    folders = spec.submodule_search_locations if spec is not None else None
    names = sorted(path.stem for folder in folders or () for path in Path(folder, "model", "profiles").glob("*.yaml"))
    return [name for name in names if name.startswith(incomplete)] or completed_files(".yaml", ".yml")(incomplete)


def completed_texts(*others: str) -> Completer:
    """As `completed_files`, of the text formats there are, and of these other suffixes."""

    def complete(incomplete: str) -> list[str]:
        from encoders import text_suffixes

        return completed_files(*text_suffixes(), *others)(incomplete)

    return complete
