"""Texts, pictures and scenes to waveforms."""

__all__: list[str] = []
