"""Bars: none for quick work, none when stderr is not a terminal, on stderr otherwise."""

from __future__ import annotations

import io
import sys

import pytest

from dotwave import progress as module
from dotwave.progress import progress


class Terminal(io.StringIO):
    """Text that calls itself a terminal."""

    def isatty(self) -> bool:
        return True


def test_nothing_is_shown_when_stderr_is_not_a_terminal(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.setattr(module, "PATIENCE_S", 0.0)
    with progress("work") as update:
        update(1, 2)
    assert capsys.readouterr() == ("", "")


def test_nothing_is_shown_for_quick_work(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(module, "PATIENCE_S", 1e9)
    with progress("work") as update:
        update(1, 2)
    assert terminal.getvalue() == ""


def test_slow_work_gets_a_bar_on_stderr(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(module, "PATIENCE_S", 0.0)
    with progress("verifying") as update:
        update(1, 4)
        update(2)
    assert "verifying" in terminal.getvalue()
    assert capsys.readouterr().out == ""


def test_the_bar_is_put_away_when_the_work_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(module, "PATIENCE_S", 0.0)

    def work() -> None:
        with progress("work") as update:
            update(1, 2)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work()
    shown = terminal.getvalue()
    assert shown.count("\x1b[?25h") == shown.count("\x1b[?25l") > 0
