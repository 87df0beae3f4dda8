"""Batches of devices on the workers of a dask.distributed scheduler."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from drivers import read_waveform

from ..cluster import RETRIES, connected, one_line_of
from ..errors import AppError
from .batch import Batch, verdict_on
from .verdict import Verdict

__all__ = ["verdicts_on_cluster"]

Files = dict[str, bytes]


def verdicts_on_cluster(
    path: Path, batches: Sequence[Batch], address: str, told: Callable[[int], None]
) -> list[Verdict]:
    """The same as `verdict_on` for each batch, on the workers of the scheduler at `address`; the files go with it.

    Raises
    ------
    AppError
        When the scheduler cannot be used, or a batch fails on several workers.
    """
    manifest, reader = read_waveform(path)
    files = {one.name: one.read_bytes() for one in (reader.path, reader.path.with_suffix(".json"))}
    name, verdicts = reader.path.name, [None] * len(batches)
    with connected(address) as (distributed, client):
        sent = client.scatter(files, broadcast=True)
        futures = [client.submit(_verdict_of_files, sent, name, one, pure=False, retries=RETRIES) for one in batches]
        place = {future.key: number for number, future in enumerate(futures)}
        for future in distributed.as_completed(futures, loop=client.loop):
            number = place[future.key]
            if future.status != "finished":
                raise AppError(f"{address}: a worker failed: {one_line_of(future.exception())}")
            verdicts[number] = future.result()
            told(manifest.samples * batches[number].count)
    return verdicts  # type: ignore[return-value]


def _verdict_of_files(files: Files, name: str, batch: Batch) -> Verdict:
    with tempfile.TemporaryDirectory() as folder:
        for one, content in files.items():
            (Path(folder) / one).write_bytes(content)
        return verdict_on(Path(folder) / name, batch, _nobody)


def _nobody(samples: int) -> None:
    """Told where nobody listens."""
