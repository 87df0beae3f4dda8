"""The command line (grows below)."""


def main() -> None:
    """Entry point."""
