"""The whole pipeline in local web pages, for hands, eyes and screen readers alike; needs the extra `studio`."""

__all__: list[str] = []
