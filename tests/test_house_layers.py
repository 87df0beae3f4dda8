"""The house rules that can be read off the source: layers, imports, sizes."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
BELOW = {
    "chainsim": set(),
    "encoders": set(),
    "planner": {"chainsim", "encoders"},
    "drivers": {"chainsim", "encoders", "planner"},
    "dotwave": {"chainsim", "drivers", "encoders", "planner"},
}
HEAVY = {"PIL", "dask", "louis", "matplotlib", "numba", "rich", "scipy", "typer"}
ONE_MODULE_ONLY = {"louis", "serial"}
LONGEST_FILE = 350
LONGEST_FUNCTION = 60
# The one place that catches everything: where a run of the command line ends.
LAST_NET = ROOT / "dotwave" / "ending.py"

MODULES = sorted(path for package in BELOW for path in (ROOT / package).rglob("*.py"))
TREES = {path: ast.parse(path.read_text(encoding="utf-8")) for path in MODULES}

each_module = pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))


def imports(tree: ast.AST) -> Iterator[tuple[str, str, int]]:
    """Module, name in it ('' for a plain import) and level of every import, also inside functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "", 0) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from ((node.module or "", alias.name, node.level) for alias in node.names)


def named_strings(tree: ast.AST) -> set[str]:
    return {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}


def without_docstring(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    lines = node.end_lineno - node.lineno + 1
    if ast.get_docstring(node) is not None:
        lines -= node.body[0].end_lineno - node.body[0].lineno + 1
    return lines


def test_every_package_is_read() -> None:
    assert {path.relative_to(ROOT).parts[0] for path in MODULES} == set(BELOW)


@each_module
def test_layers(path: Path) -> None:
    package = path.relative_to(ROOT).parts[0]
    for module, name, level in imports(TREES[path]):
        top = module.split(".")[0]
        if level == 0 and top in BELOW:
            assert top in BELOW[package], f"{path}: {package} may not know {top}"
            assert module == top, f"{path}: import from {top} itself, not from its module {module}"
            assert name, f"{path}: write `from {top} import name`"
            assert name in importlib.import_module(top).__all__, f"{path}: {top}.{name} is not public"
        assert level <= len(path.relative_to(ROOT).parts) - 1, f"{path}: the relative import leaves {package}"


def test_rare_libraries_are_known_to_one_module() -> None:
    for library in ONE_MODULE_ONLY:
        users = {
            path
            for path in MODULES
            if any(level == 0 and module.split(".")[0] == library for module, _, level in imports(TREES[path]))
            or any(
                isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "import_module"
                and library in named_strings(node)
                for node in ast.walk(TREES[path])
            )
        }  # fmt: skip
        assert len(users) <= 1, f"{library} is imported in {sorted(map(str, users))}"


def test_importing_the_packages_imports_nothing_heavy() -> None:
    lower = ", ".join(sorted(BELOW["dotwave"]))
    code = f"import sys, {lower}; print(*sorted({{name.split('.')[0] for name in sys.modules}}))"
    ran = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not HEAVY & set(ran.stdout.split())


@each_module
def test_module(path: Path) -> None:
    tree = TREES[path]
    assert ast.get_docstring(tree), f"{path}: no docstring"
    assert len(path.read_text(encoding="utf-8").splitlines()) <= LONGEST_FILE
    assigned = {
        getattr(target, "id", "")
        for node in tree.body
        for target in getattr(node, "targets", [getattr(node, "target", None)])
    }
    assert "__all__" in assigned or path == ROOT / "dotwave" / "__init__.py", f"{path}: no __all__"


@each_module
def test_functions(path: Path) -> None:
    package = path.relative_to(ROOT).parts[0]
    for node in ast.walk(TREES[path]):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            assert without_docstring(node) <= LONGEST_FUNCTION, f"{path}:{node.lineno}: {node.name} is too long"
        if isinstance(node, ast.ExceptHandler):
            caught = getattr(node.type, "id", "") if node.type is not None else "Exception"
            assert caught != "Exception" or path == LAST_NET, f"{path}:{node.lineno}: name what is caught"
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "print":
            assert package == "dotwave", f"{path}:{node.lineno}: print belongs to the command line"


def test_there_is_one_last_net() -> None:
    caught = [getattr(node.type, "id", "") for node in ast.walk(TREES[LAST_NET]) if isinstance(node, ast.ExceptHandler)]
    assert caught.count("Exception") == 1


def test_public_names_exist() -> None:
    for package in BELOW:
        module = importlib.import_module(package)
        for name in getattr(module, "__all__", []):
            assert hasattr(module, name), f"{package}.{name}"
