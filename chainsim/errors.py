"""Errors of the simulator, each with the situations in which it is met."""

from __future__ import annotations

__all__ = ["ChainError", "ProfileError"]


class ChainError(Exception):
    """Root of everything `chainsim` raises on purpose.

    Examples
    --------
    >>> from chainsim import ChainError, load_device
    >>> try:
    ...     load_device("paper")
    ... except ChainError as error:
    ...     print(str(error).split(";")[0][:37])
    device 'paper': not a built-in profil
    """


class ProfileError(ChainError, ValueError):
    """A file a person wrote (device profile, chain file) cannot be used.

    Examples: the file is not YAML; a key is unknown; a number is out of range; no built-in profile has
    that name. The message starts with the place (``file:line: field:``).
    """
