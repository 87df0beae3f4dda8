"""Same input, same bytes: whether a kernel was compiled just now or read from disk must not show in an answer."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from chainsim.compiled import sources_stamp

SCRIPT = """
import hashlib
import numpy as np
from chainsim import Chain, Setting, GridIntegrator, solve, sweep

rng, digest = np.random.default_rng(1), hashlib.sha256()
chain, grid = Chain(6, 6.1e-3, -1.0), Chain(12, 0.05, -1.0, rows=3)

def add(*arrays):
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())

few = Setting.of(chain, epsilon=rng.uniform(3e-5, 6e-3, 40), lam=6e-3, omega=rng.uniform(0.98, 1.02, 40))
found = sweep(chain, few, tol=1e-11, from_rest=False)
add(found.phasor, found.multipliers, found.error_estimate)
found = sweep(grid, Setting.of(grid, epsilon=0.01, lam=0.1, lam_y=0.2, omega=1.2), tol=1e-6, from_rest=False)
add(found.phasor, found.multipliers)
three = Chain(3, 0.02, -1.0)
full = solve(three, Setting.of(three, epsilon=1e-2, lam=0.2, omega=1.3), tol=1e-8, rung="ode")
add(full.phasor, full.multipliers)
force, lam = rng.normal(size=(200, 2, 6)) * 0.01, rng.uniform(0.1, 0.3, (200, 2, 6))
for more in ({}, {"stiffness": rng.uniform(0.9, 1.1, (2, 6))}, {"ring": True}, {"both_ways": True}, {"down": True}):
    how = {"shape": (2, 6), "chain_length": 3, "delta": 0.02, "beta": -1.0, "ring": False, "dtau": 0.2} | more
    downs = (lam,) if "down" in more else ()
    add(GridIntegrator(**how).advance(force, lam, *downs))
print(digest.hexdigest())
"""


def answers(folder):
    place = {**os.environ, "NUMBA_CACHE_DIR": str(folder)}
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, env=place, check=True)
    return done.stdout.strip()


@pytest.mark.slow
def test_compiled_now_or_read_from_disk(tmp_path):
    fresh = answers(tmp_path / "one")
    assert len(fresh) == 64
    assert list((tmp_path / "one").rglob("*.nbc"))
    assert answers(tmp_path / "one") == fresh
    assert answers(tmp_path / "two") == fresh


def test_a_changed_helper_is_a_changed_kernel():
    from chainsim.batch.chains import march_blocks
    from chainsim.time_domain.linked_kernels import advance_linked

    march: Any = march_blocks
    advance: Any = advance_linked
    assert {name for name, _, _ in sources_stamp(march.py_func)} == {
        "balance.py", "chains.py", "multipliers.py",
    }  # fmt: skip
    for name, changed, size in sources_stamp(advance.py_func):
        stat = (Path(__file__).parents[2] / "chainsim" / "time_domain" / name).stat()
        assert (changed, size) == (stat.st_mtime_ns, stat.st_size)
    assert march._cache._cache_file._source_stamp == sources_stamp(march.py_func)
