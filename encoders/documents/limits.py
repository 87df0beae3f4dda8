"""How much of a document is read, whatever it says of itself."""

from __future__ import annotations

__all__ = ["MOST_BYTES", "MOST_MEMBERS", "MOST_PART_BYTES", "MOST_RATIO", "MOST_TEXT"]

MOST_PART_BYTES = 32_000_000
"""Of one file in an archive, and of one page of markup."""
MOST_BYTES = 256_000_000
"""Of all files that are taken out of one archive together."""
MOST_MEMBERS = 20_000
"""Files in an archive."""
MOST_RATIO = 400
"""How many bytes one byte of an archive may become, beyond the first megabyte; text is packed to a fifth or tenth."""
MOST_TEXT = 32_000_000
"""Characters of a document: a thick book has a few million."""
