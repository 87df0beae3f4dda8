"""The files beside a set of icons: the manifest as JSON and CSV, the contact sheets, the page."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from drivers import atomic_files, naming

from ..plain import csv_cell, printable
from .report import IconsReport, icon_row

__all__ = ["write_report"]

COLUMNS = (
    "name", "label", "code_point", "category", "digest", "same_as", "pattern", "similarity", "doubt", "outcome",
    "error", "nearest", "distance", "lost", "waveform", "note",
)  # fmt: skip


def write_report(report: IconsReport, out: Path, *, pictures: bool) -> IconsReport:
    """Write manifest.json and manifest.csv and, with `pictures`, the contact sheets, into folder `out`.

    Returns
    -------
    The report with the files that were written.
    """
    paths = _written(out, {"manifest.csv": _csv(report), "manifest.json": _json(report.manifest())})
    if pictures and report.icons:
        # After the manifest: drawing takes a second, in which a person may press Ctrl-C.
        from .contact_sheet import contact_sheets
        from .page import icon_page

        paths += _written(out, contact_sheets(report.icons) | {"index.html": icon_page(report).encode()})
    return replace(report, files=paths)


def _written(out: Path, files: Mapping[str, bytes]) -> tuple[str, ...]:
    paths = [out / name for name in files]
    with atomic_files(*paths) as opened:
        for path, file, data in zip(paths, opened, files.values(), strict=True):
            with naming(path):
                file.write(data)
    return tuple(map(str, paths))


def _json(value: Any) -> bytes:
    # Escapes are the same words to whoever reads JSON.
    return (printable(json.dumps(value, ensure_ascii=False, allow_nan=False, indent=1)) + "\n").encode()


def _csv(report: IconsReport) -> bytes:
    text = io.StringIO()
    table = csv.DictWriter(text, COLUMNS, extrasaction="ignore", lineterminator="\n")
    table.writeheader()
    for icon in report.icons:
        row = icon_row(icon)
        table.writerow(_cells(row | {"pattern": "/".join(row["pattern"])}))
    for name, error in report.failed.items():
        table.writerow(_cells({"name": name, "outcome": "bad_file", "note": error}))
    return text.getvalue().encode()


def _cells(row: Mapping[str, Any]) -> dict[str, Any]:
    return {name: csv_cell(value) if isinstance(value, str) else value for name, value in row.items()}
