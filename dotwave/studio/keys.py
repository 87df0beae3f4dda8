"""Who may come in: a word that is good once in the first address, then a cookie of this browser."""

from __future__ import annotations

import secrets
from dataclasses import dataclass, field

__all__ = ["Keys"]

BYTES = 32


@dataclass
class Keys:
    """The secrets of one run of the studio.

    Attributes
    ----------
    port : the cookie's name carries it, since browsers share cookies between ports.
    token : of the next first address; another one once it was spent.
    """

    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(BYTES))
    _cookie: str = field(default_factory=lambda: secrets.token_urlsafe(BYTES), repr=False)

    @property
    def origin(self) -> str:
        """What begins every address."""
        return f"http://127.0.0.1:{self.port}"

    @property
    def first_address(self) -> str:
        """The address that lets a browser in, once."""
        return f"{self.origin}/?token={self.token}"

    @property
    def cookie_name(self) -> str:
        """Name of the cookie."""
        return f"dotwave-studio-{self.port}"

    def spend(self, token: str) -> str | None:
        """The cookie for a right token, which is worth nothing from then on; None for a wrong one."""
        if not _same(token, self.token):
            return None
        self.token = secrets.token_urlsafe(BYTES)
        return self._cookie

    def knows(self, cookie: str | None) -> bool:
        """Whether this is the cookie that was given out."""
        return cookie is not None and _same(cookie, self._cookie)


def _same(one: str, other: str) -> bool:
    return secrets.compare_digest(one.encode(), other.encode())
