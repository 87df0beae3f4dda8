"""`sweep --as-built`: what chains drawn at random reach at every setting, beside what the chain itself does."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dotwave as dw
from chainsim import Device, load_device
from dotwave.as_built.settings import AS_BUILT_FIELDS, AsBuiltSettings
from dotwave.errors import AppError
from dotwave.figures.sweep_map import draw_map
from dotwave.studies.sweep import FIELDS, run_sweep

CHAIN = dw.Chain(n=2, delta=0.05, beta=-1.0)


def device(**around: object) -> Device:
    return Device.model_validate(
        load_device("paper-6x6").as_dict() | {"surroundings": around, "notes": {}}
    )  # fmt: skip


SPREAD = device(spread={"frequency": 0.02})


def asked(around: Device, **given: Any) -> dict[str, np.ndarray]:
    settings = {"epsilon": 0.004, "lam": 0.05, "omega": 1.0, "tol": 1e-8, "devices": 40} | given
    found = dw.sweep(CHAIN, **settings, as_built=around)
    return {name: np.asarray(found[name]).ravel() for name in (*AS_BUILT_FIELDS, "outcome")}


@pytest.mark.parametrize("from_rest", [True, False])
def test_with_nothing_around_them_all_are_the_chain_itself(from_rest: bool) -> None:
    found = asked(device(), omega=[0.97, 1.03], from_rest=from_rest)
    assert (found["yield"] == 1).all()
    assert (found["deviation"] < 1e-3).all()
    assert (found["spoiler"] == "").all()


def test_a_ring_too() -> None:
    ring = dw.Chain.of(3, delta=0.05, beta=-1.0, closure="ring")
    found = dw.sweep(ring, epsilon=0.002, lam=0.01, omega=0.97, tol=1e-8, as_built=device(), devices=1)
    assert float(np.ravel(found["yield"])[0]) == 1
    assert float(np.ravel(found["deviation"])[0]) < 1e-3


def test_near_the_escape_some_do_not_reach_what_the_chain_does() -> None:
    """Under a sudden drive; one that is far above escapes on all."""
    found = asked(SPREAD, epsilon=[0.004, 0.0145, 0.3], lam=0.0, devices=64)
    assert list(found["outcome"]) == ["ok", "ok", "escaped"]
    assert found["yield"][0] == 1
    assert 0 < found["yield"][1] < 1
    assert found["yield"][2] == 1
    assert list(found["spoiler"]) == ["spread"] * 3
    assert found["deviation"][0] > 0.05
    assert math.isnan(found["deviation"][2])
    assert found["worst"][2] == -1


def test_the_worst_actuator_is_the_one_that_is_farthest_off() -> None:
    """A stiffness of one actuator moves those behind it as well; a fingertip's press acts on the first."""
    found = asked(SPREAD, epsilon=0.0005, lam=0.02)
    assert found["worst"][0] == 0
    pressed = asked(device(preload=0.2, spread={"frequency": 0.0001}), epsilon=0.0005, lam=0.02)
    assert (pressed["worst"][0], pressed["spoiler"][0]) == (0, "preload")


def test_the_file_has_the_columns_and_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = tmp_path / "sweep.yaml"
    source.write_text(
        "chain: {n: 2, delta: 0.05, beta: -1.0}\n"
        "setting: {epsilon: {from: 0.002, to: 0.004, steps: 2}, lam: 0.02, omega: {from: 0.95, to: 1.0, steps: 3}}\n"
        "tol: 1.0e-6\n"
    )
    drawn = AsBuiltSettings(SPREAD, 20)
    report = run_sweep(source, tmp_path / "whole.npz", as_built=drawn)
    assert report.settings == 6
    with np.load(tmp_path / "whole.npz", allow_pickle=False) as stored:
        assert tuple(stored.files) == (*FIELDS, *AS_BUILT_FIELDS)
        assert (stored["spoiler"] == "spread").all()
    parts = run_sweep(source, tmp_path / "parts.npz", as_built=drawn, units=4, workers=2)
    assert parts.settings == 6
    assert (tmp_path / "parts.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()
    run_sweep(source, tmp_path / "some.csv", only=("omega", "yield", "spoiler"), as_built=drawn)
    lines = (tmp_path / "some.csv").read_text().splitlines()
    assert lines[0] == "omega,yield,spoiler"
    assert lines[1].endswith(",spread")
    draw_map(source, tmp_path / "whole.npz", tmp_path / "map.png")
    run_sweep(source, tmp_path / "plain.npz")
    draw_map(source, tmp_path / "plain.npz", tmp_path / "plain.png")
    from PIL import Image

    with Image.open(tmp_path / "map.png") as wide, Image.open(tmp_path / "plain.png") as narrow:
        assert wide.width > narrow.width


def test_what_cannot_be_drawn_is_refused(tmp_path: Path, dotwave: Any) -> None:
    with pytest.raises(AppError, match="open chain or a ring"):
        dw.sweep(dw.Chain(n=4, delta=0.05, beta=-1.0, rows=2), epsilon=0.001, as_built=SPREAD)
    with pytest.raises(AppError, match="a drive alone"):
        dw.sweep(CHAIN, epsilon=0.001, lam=0.01, preload=0.01, as_built=SPREAD)
    with pytest.raises(AppError, match="too long to settle"):
        dw.sweep(dw.Chain(n=1, delta=1e-9, beta=0.0), epsilon=1e-12, as_built=SPREAD)
    with pytest.raises(AppError, match="too fast for the 8000 samples"):
        dw.sweep(CHAIN, epsilon=0.001, lam=0.01, omega=20.0, as_built=SPREAD)
    with pytest.raises(AppError, match="yield: no such field"):
        run_sweep(tmp_path / "none.yaml", tmp_path / "out.npz", only=("yield",))
    source = tmp_path / "sweep.yaml"
    source.write_text("chain: {n: 1, delta: 0.05, beta: 0.0}\nsetting: {epsilon: 0.001, omega: 1.0}\ntol: 1.0e-6\n")
    done = dotwave("sweep", source, "-o", tmp_path / "out.npz", "--devices", "3")
    assert (done.code, "belong to --as-built" in done.err) == (2, True)
    done = dotwave("sweep", source, "-o", tmp_path / "out.csv", "--as-built", "--devices", "3", "--only", "yield")
    assert (done.code, (tmp_path / "out.csv").read_text()) == (0, "yield\n1.0\n")
