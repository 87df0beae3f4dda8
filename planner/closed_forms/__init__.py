"""Formulas that give links, drives and waves directly."""

__all__: list[str] = []
