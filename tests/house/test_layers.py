"""The house rules that can be read off the source: layers, imports, sizes."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
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
LAST_NET = ROOT / "dotwave" / "cli" / "ending.py"

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
    lines = (node.end_lineno or 0) - node.lineno + 1
    if ast.get_docstring(node) is not None:
        lines -= (node.body[0].end_lineno or 0) - node.body[0].lineno + 1
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


def name_of(path: Path) -> str:
    """Dotted name of a module; of a package that of its folder."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def known_by() -> dict[str, set[str]]:
    """Module -> modules of the same package it imports, at any place in its text. Packages themselves are left out:
    their tables of public names know every module."""
    modules = {name_of(path): path for path in MODULES if path.name != "__init__.py"}
    graph: dict[str, set[str]] = {name: set() for name in modules}
    for importing, path in modules.items():
        for module, name, level in imports(TREES[path]):
            if level:
                base = ".".join(filter(None, [*path.relative_to(ROOT).parts[:-level], module]))
                graph[importing] |= {f"{base}.{name}", base} & modules.keys()
    return graph


def folder_of(module: str) -> str:
    """The folder a module stands in; what stands at a package's root is a room of its own."""
    return module.rpartition(".")[0] if module.count(".") > 1 else module


def test_no_circles_of_files() -> None:
    graph = known_by()
    assert sum(map(len, graph.values())) > 500
    TopologicalSorter(graph).prepare()


def test_no_circles_of_folders() -> None:
    folders: dict[str, set[str]] = {}
    for module, known in known_by().items():
        folders.setdefault(folder_of(module), set()).update(folder_of(other) for other in known)
    TopologicalSorter({folder: known - {folder} for folder, known in folders.items()}).prepare()


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
    assigned = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
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


def test_every_class_has_a_name_of_its_own() -> None:
    places: dict[str, list[str]] = {}
    for path, tree in TREES.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    assert not {name: found for name, found in places.items() if len(found) > 1}


@each_module
def test_docstrings_say_one_parameter_a_line(path: Path) -> None:
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for node in ast.walk(TREES[path]):
        text = (ast.get_docstring(node) or "") if isinstance(node, documented) else ""
        for section in re.findall(r"(?:Parameters|Attributes)\n-+\n(.*?)(?:\n\n|\Z)", text, flags=re.DOTALL):
            crowded = re.search(r"^\S.*?[.;] [\w*]+(?:, [\w*]+)* : ", section, flags=re.MULTILINE)
            assert crowded is None, f"{path}: {crowded and crowded[0]}"
