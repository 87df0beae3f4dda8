"""Every public name of `dotwave` has a docstring with an example, and every example runs as it stands."""

from __future__ import annotations

import doctest
import inspect
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import dotwave

ROOT = Path(__file__).resolve().parents[3]
SAID = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def own(name: str) -> Iterator[tuple[str, Callable[..., object]]]:
    """A public object, and where it is a class of `dotwave` its public methods."""
    found = getattr(dotwave, name)
    yield name, found
    if inspect.isclass(found) and found.__module__.startswith(("dotwave.api", "dotwave.live")):
        for method, value in vars(found).items():
            if inspect.isfunction(value) and not method.startswith("_"):
                yield f"{name}.{method}", value


EXAMPLES = dict(one for name in dir(dotwave) for one in own(name))


@pytest.fixture
def samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder that has what the examples name."""
    shutil.copytree(ROOT / "samples", tmp_path / "samples")
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.usefixtures("samples")
def test_the_example_runs(name: str) -> None:
    found = EXAMPLES[name]
    (test,) = [one for one in doctest.DocTestFinder(recurse=False).find(found, name) if one.examples]
    runner = doctest.DocTestRunner(optionflags=SAID)
    said: list[str] = []
    runner.run(test, out=said.append)
    assert runner.summarize(verbose=False).failed == 0, "".join(said)


@pytest.mark.parametrize("name", [name for name, found in EXAMPLES.items() if inspect.isfunction(found)])
def test_parameters_stand_one_a_line_with_results_and_errors(name: str) -> None:
    found = EXAMPLES[name]
    words = inspect.getdoc(found) or ""
    lines = words.splitlines()
    for parameter in inspect.signature(found).parameters.values():
        if parameter.name != "self":
            stars = {"VAR_KEYWORD": "**", "VAR_POSITIONAL": "*"}.get(parameter.kind.name, "")
            assert any(line.split(" : ")[0] == stars + parameter.name for line in lines), parameter.name
    if "." not in name:
        assert {"Parameters", "Returns", "Raises", "Examples"} <= set(lines)
