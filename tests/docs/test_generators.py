"""What the pages are made with: docstrings and notebook scripts as Markdown."""

from __future__ import annotations

from chainsim import Start
from tests.support.docs_pages import generator

API = generator("api")
SCRIPT = generator("script")

DOCSTRING = """First sentence, with a < b and lam * x.

Parameters
----------
rows, cols : int, how many.
    They are counted from 0.
tol_v : float, relative.

Returns
-------
A sentence that goes on
over two lines.

Raises
------
ValueError
    When it is negative.

Examples
--------
>>> 1 + 1
2
"""


def test_a_docstring_becomes_lists_under_bold_titles() -> None:
    made = API.markdown_of(DOCSTRING)
    assert made.startswith("First sentence, with a &lt; b and lam \\* x.")
    assert "**Parameters**" in made
    assert "- `rows, cols`: int, how many.\n    They are counted from 0.\n- `tol_v`: float, relative." in made
    assert "**Returns**\n\nA sentence that goes on\nover two lines." in made
    assert "**Raises**\n\n- ValueError\n    When it is negative." in made
    assert "```pycon\n>>> 1 + 1\n2\n```" in made
    assert "---" not in made


def test_signatures_are_plain_and_long_ones_stand_in_lines() -> None:
    def short(place: int, kind: Start = Start.REST) -> str:
        return kind

    def long(first_of_all: dict[str, int], second_of_all: int | None = None, *, third_of_all_names: float) -> None: ...

    assert API._signature("short", short) == "short(place: int, kind: Start = Start.REST) -> str"
    assert API._signature("long", long).splitlines() == [
        "long(",
        "    first_of_all: dict[str, int],",
        "    second_of_all: int | None = None,",
        "    *,",
        "    third_of_all_names: float,",
        ")",
    ]


def test_code_in_a_docstring_stays_as_it_is() -> None:
    assert API.markdown_of("Of ``a_b * c`` and `lam_m`, not x_y.") == "Of ``a_b * c`` and `lam_m`, not x\\_y."


def test_every_public_name_has_a_row() -> None:
    made = API.packages()
    for package in API.PACKAGES:
        module = __import__(package)
        assert all(f"| `{name}` |" in made for name in module.__all__)


def test_a_script_of_cells_becomes_words_and_code() -> None:
    script = '''"""Head."""
# %% [markdown]
# # Title
#
# Words.

# %%
x = 3
x  # noqa: B018 - shown

# %%
print(x)
'''
    assert SCRIPT.page_of(script) == (
        "## Title\n\nWords.\n\n```python\nx = 3\nx\n```\n\n```python\nprint(x)\n```\n\n```text\n3\n```\n"
    )
