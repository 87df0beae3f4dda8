"""The same batch on a dask.distributed cluster: the same bytes, and a lost worker loses nothing."""

from __future__ import annotations

import json
import os
import shutil
import signal
import threading
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from dotwave.errors import AppError
from dotwave.icon_sets.build import IconOptions, render_icons

SAMPLES = Path(__file__).resolve().parents[3] / "samples" / "icons"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("default:::distributed"),
    pytest.mark.filterwarnings("default::ResourceWarning"),
    pytest.mark.filterwarnings("default::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.fixture
def cluster() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed")
    with (
        warnings.catch_warnings(),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as running,
    ):
        yield running


def test_a_cluster_gives_the_same_bytes(cluster: Any, tmp_path: Path) -> None:
    address = cluster.scheduler_address
    for name, options in {
        "here": IconOptions(workers=1, distinct=True, waveforms=True),
        "there": IconOptions(scheduler=address, distinct=True, waveforms=True),
    }.items():
        assert render_icons([str(SAMPLES)], tmp_path / name, options).ok
    here = {path.relative_to(tmp_path / "here"): path for path in (tmp_path / "here").rglob("*") if path.is_file()}
    assert len(here) == 5 + 2 * 20
    for relative, path in here.items():
        there = (tmp_path / "there" / relative).read_bytes()
        if relative.name == "journal.jsonl":
            assert sorted(there.splitlines()) == sorted(path.read_bytes().splitlines())
        else:
            assert there == path.read_bytes(), relative


def test_a_lost_worker_loses_nothing_and_nothing_is_kept_twice(cluster: Any, tmp_path: Path) -> None:
    folder, out = tmp_path / "set", tmp_path / "out"
    folder.mkdir()
    text = (SAMPLES / "sun.svg").read_text(encoding="utf-8")
    for number in range(600):
        (folder / f"{number:04d}.svg").write_text(text.replace("<svg ", f'<svg id="n{number}" ', 1), encoding="utf-8")

    def end_one() -> None:
        journal = out / "journal.jsonl"
        until = time.monotonic() + 30
        while time.monotonic() < until and not (journal.exists() and journal.stat().st_size):
            time.sleep(0.01)
        os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)

    killer = threading.Thread(target=end_one, daemon=True)
    killer.start()
    report = render_icons([str(folder)], out, IconOptions(scheduler=cluster.scheduler_address))
    killer.join()
    assert report.ok
    assert len(report.icons) == 600
    keys = [json.loads(line)["key"] for line in (out / "journal.jsonl").read_bytes().splitlines() if line]
    assert len(keys) == len(set(keys)) == 600


def test_nobody_at_the_address_is_said_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dotwave.cluster.CONNECT_S", 0.5)
    shutil.copy(SAMPLES / "heart.svg", tmp_path)
    with pytest.raises(AppError, match="no dask scheduler answers"):
        render_icons([str(tmp_path)], tmp_path / "out", IconOptions(scheduler="tcp://127.0.0.1:9"))
