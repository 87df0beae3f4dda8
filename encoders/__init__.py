"""What should be felt: text and images to scenes."""

from .scene import Frame, GridShape, PatternKind, Scene, TargetPattern

__all__ = ["Frame", "GridShape", "PatternKind", "Scene", "TargetPattern"]
