"""A studio, and a browser in it, for all tests of a module."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.support import studio_browser


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    from tests.support.studio import served

    with served(tmp_path_factory.mktemp("studio")) as running:
        yield running


@pytest.fixture(scope="module")
def page(studio: Any) -> Iterator[Any]:
    with studio_browser.opened(studio) as one:
        yield one


@pytest.fixture(scope="module")
def written(page: Any, studio: Any) -> str:
    return studio_browser.written(page, studio)
