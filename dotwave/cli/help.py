"""The list of commands in `dotwave --help`, in groups."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup

__all__ = ["LOOK", "PLAY", "RENDER", "SET_UP", "STUDY", "Commands"]

RENDER, LOOK, PLAY = "Render", "Look and prove", "Play"
STUDY, SET_UP = "Simulate and study", "Set up"
GROUPS = (RENDER, LOOK, PLAY, STUDY, SET_UP)
# What the longest name of a command and the margins leave of a line.
NAME_WIDTH = 16


class Commands(TyperGroup):
    """Lists its commands under the headings they were given as their `rich_help_panel`, in plain text."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a section for each group."""
        commands = [self.commands[name] for name in self.list_commands(ctx)]
        for group in GROUPS:
            members = [one for one in commands if getattr(one, "rich_help_panel", None) == group]
            with formatter.section(group):
                formatter.write_dl(
                    [(one.name, one.get_short_help_str(formatter.width - NAME_WIDTH)) for one in members]
                )
