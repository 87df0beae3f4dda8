"""The pages built as a site, once for all tests that look at it."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import pytest

from tests.support.docs_pages import ROOT

CURE = "pip install 'dotwave[docs]'"
needs_mkdocs = pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in ("mkdocs", "material")), reason=f"needs mkdocs: {CURE}"
)


@cache
def built() -> Path:
    """The folder of the site; whatever mkdocs has to say against a page is an error."""
    site = Path(mkdtemp(prefix="dotwave-site-"))
    call = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(site)]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    ended = subprocess.run(call, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    return site


def pages(site: Path) -> list[str]:
    return sorted(str(page.relative_to(site)) for page in site.rglob("*.html"))
