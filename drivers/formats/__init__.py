"""Samples on disk: WAV, NPZ, CSV and raw, each written in blocks and read in blocks."""

__all__: list[str] = []
