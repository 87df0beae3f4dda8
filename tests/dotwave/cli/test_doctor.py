"""`dotwave doctor` finds what is wrong and names the cure."""

from __future__ import annotations

import json
from importlib import metadata
from pathlib import Path

import pytest

import encoders
from dotwave.cli import doctor
from dotwave.cli.doctor import Check, Health, examine


def found(name: str) -> Check:
    return next(check for check in examine().checks if check.name == name)


def test_everything_is_examined() -> None:
    names = {check.name for check in examine().checks}
    assert {"Python", "liblouis", "numba cache", "disk", "numpy", "typer"} <= names
    assert {f"package {name}" for name in doctor.PACKAGES} <= names


def test_tools_of_the_tests_are_not_required() -> None:
    assert "pytest" not in {check.name for check in examine().checks}


def test_liblouis_is_named_with_its_version_and_tables() -> None:
    check = found("liblouis")
    assert check.ok
    assert check.found.startswith("3.")
    assert f"{len(encoders.list_tables())} tables" in check.found


def test_a_missing_liblouis_is_a_problem_with_a_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> None:
        raise encoders.EncodeError("install it with: apt-get install python3-louis")

    monkeypatch.setattr(encoders, "list_tables", missing)
    check = found("liblouis")
    assert not check.ok
    assert "apt-get install python3-louis" in check.cure


def test_a_shadowing_distribution_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    owners = {"drivers": ["other-drivers", "dotwave"], "planner": ["dotwave"]}
    monkeypatch.setattr(metadata, "packages_distributions", lambda: owners)
    assert "other-drivers" in found("package drivers").cure
    assert found("package planner").ok


def test_an_old_or_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(metadata, "requires", lambda _: ["numpy>=999.1", "no-such-package>=1", "x>=1; extra == 'dev'"])
    assert found("numpy").cure == "pip install 'numpy>=999.1'"
    assert found("no-such-package").found == "missing"
    assert "x" not in {check.name for check in examine().checks}


@pytest.mark.parametrize(
    ("found", "oldest", "enough"),
    [
        ("2.0", "2", True),
        ("2.0.0", "2.0", True),
        ("1.26.4", "2.0", False),
        ("10.1", "9.9", True),
        ("2.0rc1", "2.0", True),
    ],
)
def test_releases_compare_as_numbers(found: str, oldest: str, enough: bool) -> None:
    assert (doctor._release(found) >= doctor._release(oldest)) is enough


def test_a_cache_that_cannot_be_written(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "missing"))
    assert "NUMBA_CACHE_DIR" in found("numba cache").cure
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert found("numba cache").ok


def test_a_full_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "LEAST_FREE_BYTES", 10**18)
    assert not found("disk").ok


def test_exit_code_text_and_json(dotwave, monkeypatch: pytest.MonkeyPatch) -> None:
    well = Health((Check("a", "b"),))
    ill = Health((Check("a", "b"), Check("c", "d", "do e")))
    for health, code in ((well, 0), (ill, 1)):
        monkeypatch.setattr(doctor, "examine", lambda health=health: health)
        assert dotwave("doctor").code == code
        assert json.loads(dotwave("doctor", "--json").out) == health.as_dict()
    assert ill.as_text().splitlines() == ["ok: a: b", "PROBLEM: c: d; do e", "Problems: 1."]
