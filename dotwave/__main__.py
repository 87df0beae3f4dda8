"""``python -m dotwave``: the command line."""

from .cli.app import main

__all__: list[str] = []

if __name__ == "__main__":
    main()
