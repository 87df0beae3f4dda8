"""What is said of a result, as values, as JSON and as text for any reader."""

__all__: list[str] = []
