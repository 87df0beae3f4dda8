"""Formulas in MathML as Braille: Nemeth code, written by speech-rule-engine in one node process that stays."""

from __future__ import annotations

import atexit
import json
import re
import select
import shutil
import subprocess
from collections.abc import Callable
from functools import cache

from ..choices import Mathematics
from ..errors import DocumentsMissing, InvalidText
from .model import TextRun

__all__ = ["formula_writer"]

PATIENCE_S = 30.0
MOST_MATHML = 100_000
BEGIN, END = "\u2838\u2829\u2800", "\u2800\u2838\u2831"
"""The signs of UEB before and after Nemeth code, blanks included."""
CURE = (
    "a formula (MathML) needs node and its package speech-rule-engine (npm install -g speech-rule-engine); "
    "or give --math words"
)
_CELLS = re.compile("[\u2800-\u28ff]+")
# The packages of the person and of the machine; never those of the folder one happens to be in.
SCRIPT = """
const path = require('path'), os = require('os'), readline = require('readline');
const places = [path.join(os.homedir(), 'node_modules'), path.join(path.dirname(process.execPath), '..', 'lib',
  'node_modules'), '/usr/local/lib/node_modules', '/usr/lib/node_modules', '/usr/share/nodejs',
  ...(process.env.NODE_PATH || '').split(path.delimiter).filter(Boolean)];
const sre = require(require.resolve('speech-rule-engine', {paths: places}));
const say = answer => process.stdout.write(JSON.stringify(answer) + '\\n');
sre.setupEngine({locale: 'nemeth', modality: 'braille'}).then(() => sre.engineReady()).then(() => {
  readline.createInterface({input: process.stdin}).on('line', line => {
    try { say({cells: sre.toSpeech(JSON.parse(line))}); } catch (error) { say({error: String(error)}); }
  }).on('close', () => process.exit(0));
  say({ready: true});
});
"""


def formula_writer(math: Mathematics) -> Callable[[TextRun], str]:
    """What gives the characters that are written for a formula."""
    if math is Mathematics.WORDS:
        return lambda run: run.text
    return _nemeth


def _nemeth(run: TextRun) -> str:
    """Cells of a formula.

    Raises
    ------
    DocumentsMissing
        When there is no converter.
    InvalidText
        When the formula is not one it can write.
    """
    if len(run.mathml) > MOST_MATHML:
        raise InvalidText(f"{run.place}: a formula of more than {MOST_MATHML} characters; give --math words")
    try:
        cells = _converter().cells(run.mathml)
    except DocumentsMissing as error:
        raise DocumentsMissing(f"{run.place}: {error}") from None
    if not _CELLS.fullmatch(cells):
        raise InvalidText(f"{run.place}: the formula {run.text[:40]!r} cannot be written; give --math words")
    return BEGIN + cells + END


class _Converter:
    """The node process; it ends with this one, or when it has nothing to say for long."""

    def __init__(self, node: str) -> None:
        self._process = subprocess.Popen(
            [node, "-e", SCRIPT], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        atexit.register(self.close)
        if "ready" not in self._answer():
            self.close()
            raise DocumentsMissing(CURE)

    def cells(self, mathml: str) -> str:
        """Cells of a formula, empty when it cannot be written."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(mathml).encode() + b"\n")
            self._process.stdin.flush()
        except OSError:
            return ""
        return str(self._answer().get("cells", "")).strip().replace(" ", "\u2800")

    def _answer(self) -> dict[str, object]:
        assert self._process.stdout is not None
        if not select.select([self._process.stdout], [], [], PATIENCE_S)[0]:
            self._process.kill()
            return {}
        try:
            answer = json.loads(self._process.stdout.readline() or b"{}")
        except ValueError:
            return {}
        return answer if isinstance(answer, dict) else {}

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        for stream in (self._process.stdin, self._process.stdout):
            stream.close()
        self._process.kill()
        self._process.wait()


@cache
def _converter() -> _Converter:
    node = shutil.which("node")
    if node is None:
        raise DocumentsMissing(CURE)
    return _Converter(node)
