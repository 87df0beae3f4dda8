"""Lines of text or cells, one window each, for scripts: the last line that came is shown, its pages by keys."""

from __future__ import annotations

from functools import cached_property

from encoders import EmptyText, EncodeError, GridShape, TextOptions, encode_text

from .window import BrailleWindow, Key, KeyName, cells_of_braille

__all__ = ["LineSource"]

_LONGEST = 4096


class LineSource:
    """Text as `dotwave text` writes it: contracted as the table says, words kept whole where they fit.

    Parameters
    ----------
    shape : of the grid in actuators.
    options : table, dots and layout.
    """

    settle_s = 0.0

    def __init__(self, shape: GridShape, options: TextOptions | None = None) -> None:
        self._shape, self._options = shape, options or TextOptions()
        self._rest = bytearray()
        self._text: _Line | None = None

    def receive(self, data: bytes) -> bytes:
        """Take bytes, in pieces of any size; there is nothing to answer. Of a line only the first 4096 bytes count."""
        *lines, rest = data.split(b"\n")
        if lines:
            whole = lines[-1] if len(lines) > 1 else bytes(self._rest) + lines[0]
            self._text = _Line(whole[:_LONGEST].decode("utf-8", "replace").strip("\r\0"), self._shape, self._options)
            self._rest.clear()
        self._rest += rest[: _LONGEST - len(self._rest)]
        return b""

    def end(self) -> None:
        """No more comes: what has no newline is a line too."""
        if self._rest:
            self.receive(b"\n")

    @property
    def window(self) -> BrailleWindow | None:
        """The page that is shown; None before the first line."""
        return None if self._text is None else self._text.page

    def press(self, key: Key) -> bytes:
        """Previous and next, or up and down, turn the pages of the line; home, top and bottom go to its ends."""
        if self._text is not None:
            self._text.turn(key.name)
        return b""

    def release(self, key: Key) -> bytes:
        """Nothing hangs on it."""
        return b""


class _Line:
    """One line, laid out when it is first asked for: of many that come at once only the last is."""

    def __init__(self, text: str, shape: GridShape, options: TextOptions) -> None:
        self._text, self._shape, self._options = text, shape, options
        self._at = 0

    @property
    def page(self) -> BrailleWindow:
        return self._pages[self._at]

    def turn(self, name: KeyName) -> None:
        last = len(self._pages) - 1
        to = {
            KeyName.PREVIOUS: self._at - 1, KeyName.UP: self._at - 1, KeyName.NEXT: self._at + 1,
            KeyName.DOWN: self._at + 1, KeyName.HOME: 0, KeyName.TOP: 0, KeyName.BOTTOM: last,
        }.get(name, self._at)  # fmt: skip
        self._at = min(max(to, 0), last)

    @cached_property
    def _pages(self) -> tuple[BrailleWindow, ...]:
        try:
            scene = encode_text(self._text.replace("\0", " "), self._shape, self._options)
            frames = list(scene.frames)
        except EmptyText:
            return (BrailleWindow(b"", note="lines"),)
        except EncodeError as error:
            # A line of a script is no reason to end: it says what is wrong, and the next may be better.
            return (BrailleWindow(b"", note=f"lines: {error}"),)
        pages = (cells_of_braille(frame.cells.replace("\n", "")) for frame in frames)
        windows = [BrailleWindow(cells, frame.text, note="lines") for cells, frame in zip(pages, frames, strict=True)]
        return tuple(windows) or (BrailleWindow(b"", note="lines"),)
