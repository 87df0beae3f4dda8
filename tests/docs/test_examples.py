"""Examples on the pages: YAML is read by the program's own readers, Python runs, and device keys are all told."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import types
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin

import pytest
import yaml
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

import dotwave
from chainsim import Device, load_device, read_simulation, read_sweep
from dotwave.jobs.job import read_job
from drivers import PlantFile, read_plant
from tests.support.docs_pages import DOCS, ROOT, Block, blocks, read

HAS_API = "device" in getattr(dotwave, "__all__", ())
YAML = blocks("yaml")
PYTHON = blocks("python")


@pytest.mark.parametrize("block", YAML, ids=[block.name for block in YAML])
def test_yaml_is_read_by_its_reader(block: Block, tmp_path: Path) -> None:
    file = tmp_path / "example.yaml"
    file.write_text(block.text, encoding="utf-8")
    given = yaml.safe_load(block.text)
    schema = str(given.get("schema", ""))
    if schema.startswith("dotwave/job"):
        assert read_job(file).sequence
    elif schema.startswith("dotwave/device"):
        assert load_device(str(file)).name == given["name"]
    elif schema.startswith("dotwave/plant"):
        assert read_plant(file, load_device("linked-6x6")).seed == given["seed"]
    elif any(isinstance(value, dict) for value in given["setting"].values()):
        assert len(read_sweep(file)) > 1
    else:
        assert read_simulation(file).tol == given["tol"]


@pytest.mark.parametrize("block", PYTHON, ids=[block.name for block in PYTHON])
def test_python_runs(block: Block, tmp_path: Path) -> None:
    if "import dotwave" in block.text and not HAS_API:
        pytest.skip("`import dotwave as dw` offers no names yet")
    (tmp_path / "samples").symlink_to(ROOT / "samples")
    environment = os.environ | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg"}
    call = [sys.executable, "-c", block.text]
    ended = subprocess.run(call, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr


def test_every_key_of_a_device_is_told_with_its_default() -> None:
    told = keys_told("devices.md", "## Every key", "\nWithout `coupling.lam`")
    assert told == dict(keys_of(Device))


def test_every_key_of_a_plant_is_told_with_its_default() -> None:
    told = keys_told("files.md", "## Plant files", "\nPlayed seconds")
    # Two of its parts are those of chain files.
    own = {key: value for key, value in keys_of(PlantFile) if not key.startswith(("hysteresis.", "creep."))}
    assert told == own | {"hysteresis": "none", "creep": "none"}


def keys_told(page: str, begin: str, end: str) -> dict[str, str]:
    """Key -> default, of the table on a page between two texts."""
    table = read(DOCS / page).partition(begin)[2].partition(end)[0]
    rows = re.findall(r"^\| `([^`]+)` \|(.*)\|$", table, flags=re.MULTILINE)
    cells = {key: [cell.strip() for cell in rest.split("|")] for key, rest in rows}
    assert len({len(row) for row in cells.values()}) == 1
    assert all(all(row) for row in cells.values())
    return {key: row[-1].strip("`") for key, row in cells.items()}


def keys_of(model: type[BaseModel], before: str = "") -> list[tuple[str, str]]:
    """Every key of a profile with its default, parts in parts."""
    found = []
    for name, field in model.model_fields.items():
        key = before + (field.alias or name)
        inner, mark = part_of(field.annotation)
        if inner is None:
            found.append((key, default_of(field)))
        else:
            found += keys_of(inner, f"{key}{mark}.")
    return found


def part_of(annotation: Any) -> tuple[type[BaseModel] | None, str]:
    """The part that a field is made of, and how a list or a mapping of parts is written on the page."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation, ""
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        return None, ""
    parts = [part_of(one)[0] for one in inner]
    part = next((one for one in parts if one is not None), None)
    mark = "[]" if origin is tuple else ".<key>" if origin is dict else ""
    assert origin in (None, tuple, dict, Union, types.UnionType) or part is None
    return part, mark


def default_of(field: Any) -> str:
    if field.is_required():
        return "required"
    assert field.default is not PydanticUndefined
    if field.default is None:
        return "none"
    return str(field.default) or '""'
