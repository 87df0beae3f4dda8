"""`dotwave.solve` and `dotwave.sweep`: the same answers one by one, by name, and as the command line writes them."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import dotwave as dw
from dotwave.api import chains
from dotwave.studies.sweep import FIELDS

CHAIN = dw.Chain(n=3, delta=5.3006e-3, beta=-1.0)
EPSILON, LAM, OMEGA = np.array([1e-5, 1e-4]), np.array([0.004, 0.006, 0.007]), np.array([0.99, 1.0])


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chains, "find_spec", lambda _: None)


@pytest.mark.usefixtures("plain")
def test_a_sweep_is_the_solutions_one_by_one() -> None:
    found = dw.sweep(CHAIN, epsilon=EPSILON, lam=LAM, omega=OMEGA, tol=1e-8)
    assert set(found) == set(FIELDS)
    assert found["phasor"].shape == (2, 3, 2, 3)
    assert found["multipliers"].shape == (2, 3, 2, 6)
    setting = dw.Setting.of(CHAIN, epsilon=EPSILON[1], lam=LAM[2], omega=OMEGA[0])
    one = dw.solve(CHAIN, setting, tol=1e-8)
    np.testing.assert_allclose(found["phasor"][1, 2, 0], one.phasor[0], rtol=1e-6)
    assert found["outcome"][1, 2, 0] == str(one.outcome[0])
    assert np.array_equal(found["lam"], LAM)


@pytest.mark.usefixtures("plain")
def test_a_sweep_is_what_the_command_line_writes(dotwave, tmp_path: Path) -> None:
    (tmp_path / "sweep.yaml").write_text(
        "chain: {n: 3, delta: 5.3006e-3, beta: -1.0, closure: open}\n"
        "setting: {epsilon: 1.0e-4, lam: 0.006, omega: {from: 0.99, to: 1.01, steps: 9}}\ntol: 1.0e-6\n"
    )
    assert dotwave("sweep", tmp_path / "sweep.yaml", "-o", tmp_path / "x.npz").code == 0
    found = dw.sweep(CHAIN, epsilon=1e-4, lam=0.006, omega=np.linspace(0.99, 1.01, 9), tol=1e-6)
    with np.load(tmp_path / "x.npz") as written:
        for name in ("phasor", "third", "stable", "error_estimate", "outcome", "multipliers"):
            assert np.array_equal(found[name].reshape(written[name].shape), written[name]), name


@pytest.mark.usefixtures("plain")
def test_links_one_by_one() -> None:
    links = np.array([[0.004, 0.006], [0.006, 0.004]])
    found = dw.sweep(CHAIN, epsilon=1e-5, lam=links, tol=1e-6)
    assert found["phasor"].shape == (1, 2, 1, 3)
    assert not np.allclose(found["phasor"][0, 0], found["phasor"][0, 1])
    assert np.array_equal(found["lam"], links)


@pytest.mark.parametrize(
    ("lam", "names"), [(LAM, ("epsilon", "lam", "omega")), (LAM[:, None] * [1, 1.1], ("epsilon", "omega"))]
)
def test_where_xarray_is_installed_dimensions_have_names(monkeypatch: pytest.MonkeyPatch, lam: Any, names: Any) -> None:
    stand_in = ModuleType("xarray")
    stand_in.Dataset = lambda data, coords: SimpleNamespace(data=data, coords=coords)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "xarray", stand_in)
    monkeypatch.setattr(chains, "find_spec", lambda _: object())
    found = dw.sweep(CHAIN, epsilon=EPSILON, lam=lam, omega=OMEGA, tol=1e-6)
    sizes = {"epsilon": 2, "lam": 3, "omega": 2, "oscillator": 3, "link": 2, "multiplier": 6, "link_set": 2}
    assert tuple(sorted(found.coords)) == names
    for name, (dimensions, values) in (found.data | found.coords).items():
        listed = (dimensions,) if isinstance(dimensions, str) else dimensions
        assert values.shape == tuple(sizes[one] for one in listed), name


@pytest.mark.parametrize(
    "given", [{"epsilon": []}, {"epsilon": [[1.0]]}, {"omega": [[1.0]]}, {"lam": [0.1, np.nan]}, {"omega": 0.0}]
)
def test_values_that_do_not_fit_are_refused(given: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="expected"):
        dw.sweep(CHAIN, **{"epsilon": 1e-4, "tol": 1e-6} | given)
