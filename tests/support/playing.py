"""Playing to a controller that is not there: an emulator on a thread, or a session over a line in memory."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from drivers import Emulator, HostSession, VirtualController


@contextmanager
def serving(emulator: Emulator) -> Iterator[Emulator]:
    """The emulator answers on a thread of its own until the block ends; then its port is gone."""
    over = threading.Event()

    def serve() -> None:
        while not over.is_set():
            emulator.step(0.002)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield emulator
    finally:
        over.set()
        thread.join()
        emulator.close()


def exchange(
    session: HostSession,
    controller: VirtualController,
    *,
    step_s: float = 0.005,
    patience_s: float = 60.0,
    watch: Callable[[bytes], object] = len,
) -> None:
    """Play a session over a line that loses nothing, as fast as it goes.

    Parameters
    ----------
    watch : called after each step with what the controller said in it.
    """
    session.connected()
    now = 0.0
    while not session.finished:
        now += step_s
        assert now < patience_s
        controller.receive(session.poll(now), now)
        said = controller.outgoing()
        session.receive(said, now)
        watch(said)
