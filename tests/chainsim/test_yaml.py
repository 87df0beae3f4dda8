"""Files of YAML: bounded work, each value once, and complaints that quote neither the file nor the libraries."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import yaml
from pydantic import BaseModel, ConfigDict

from chainsim import ProfileError, load_device, parse_model, parse_simulation, read_model
from chainsim.complaints import shown


class Section(BaseModel):
    model_config = ConfigDict(extra="forbid")
    a: int = 0
    b: str = ""
    c: float = 0.0
    d: list[int] = []


class Whole(BaseModel):
    model_config = ConfigDict(extra="forbid")
    one: Section = Section()
    two: Section = Section()
    words: list[str] = []


class Everything(BaseModel):
    model_config = ConfigDict(extra="allow")


def read(text: str) -> Whole:
    return parse_model(text, "f.yaml", Whole)


def complaint(text: str, model: type[BaseModel] = Whole) -> str:
    with pytest.raises(ProfileError) as caught:
        parse_model(text, "f.yaml", model)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 500
    return message


class Calls:
    """Counts calls of Python functions: work that is the same on every machine."""

    def __enter__(self) -> Calls:
        self.made = 0
        sys.setprofile(self._count)
        return self

    def _count(self, frame: object, event: str, argument: object) -> None:
        self.made += event in ("call", "c_call")

    def __exit__(self, *error: object) -> None:
        sys.setprofile(None)


def laughs(first: str, other: str, levels: int) -> str:
    """Every line stands for the one above it several times."""
    lines = [f"a0: &a0 {first}"]
    lines += [f"a{level}: &a{level} {other.replace('*', f'*a{level - 1}')}" for level in range(1, levels)]
    return "\n".join(lines)


BOMBS = {
    "lists": laughs("[x, x]", "[*, *, *, *, *, *, *, *, *]", 9),
    "mappings": laughs("{k: 1}", "{l: *, m: *}", 40),
    "merges": laughs("{k: 1}", "{<<: [*, *]}", 60),
}


@pytest.mark.parametrize("text", BOMBS.values(), ids=BOMBS)
def test_aliases_that_multiply_are_refused_before_they_do(text: str) -> None:
    with Calls() as calls:
        message = complaint(text, Everything)
    assert "aliases repeat more than 100000 values" in message
    assert calls.made < 100_000


@pytest.mark.parametrize("text", ["one: &a [*a]", "&a\none: 1\n<<: *a\n", "words: &a [[*a]]"])
def test_an_alias_of_itself_is_refused(text: str) -> None:
    assert "an alias inside of what it stands for" in complaint(text)


def test_anchors_and_merges_as_people_use_them() -> None:
    found = read("one: &base {a: 1, b: x, d: &list [1, 2]}\ntwo:\n  <<: *base\n  b: y\nwords: [&w hello, *w]\n")
    assert found.two == Section(a=1, b="y", d=[1, 2])
    assert found.one == Section(a=1, b="x", d=[1, 2])
    assert found.words == ["hello", "hello"]
    assert complaint("one: &base {a: 1}\ntwo:\n  <<: *base\n  c: high\n").startswith(
        "f.yaml:4: two.c: expected a number"
    )
    assert complaint("one: {a: 1, a: 2}") == "f.yaml:1: a key is given twice in the same section; keep one"
    assert complaint("one: {<<: {a: 1}, <<: {a: 2}}") == "f.yaml:1: a key is given twice in the same section; keep one"


def test_work_grows_as_the_file_does() -> None:
    made = []
    for keys in (1000, 4000):
        with Calls() as calls:
            complaint("\n".join(f"k{index}: {index}" for index in range(keys)))
        made.append(calls.made)
    assert made[1] < 5 * made[0]


def test_a_document_is_parsed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    from chainsim.yaml_tree import _Loader

    made: list[str] = []
    plain = _Loader.__init__

    def noted(self: _Loader, text: str) -> None:
        made.append(text)
        plain(self, text)

    monkeypatch.setattr(_Loader, "__init__", noted)
    read("words: [a]")
    assert made == ["words: [a]", ""]


@pytest.mark.parametrize("text", ["one: " + "[" * 5000, "one: " + "{a: " * 5000, "- " * 3000, "? " * 3000])
def test_deep_nesting_is_one_line(text: str) -> None:
    assert "sections in sections, more than 60 deep" in complaint(text)


VALUES = {
    "one: {a: !!int ''}": "f.yaml:1: not a value of the kind int",
    "one: {a: !!int abc}": "f.yaml:1: not a value of the kind int",
    "one:\n  c: !!float ''": "f.yaml:2: not a value of the kind float",
    "one: {a: !!bool maybe}": "f.yaml:1: not a value of the kind bool",
    "one: {a: 0x" + "f" * 5000 + "}": "f.yaml:1: a number of 5002 characters; write fewer",
    "one: {c: " + ":".join(["59"] * 5000) + ".0}": "f.yaml:1: a number of 15001 characters; write fewer",
    "one: {a: 1" + "0" * 390 + "}": "f.yaml:1: not a value of the kind int",
    "one: {a: -0x" + "f" * 300 + "}": "f.yaml:1: not a value of the kind int",
    "[a]: 1": "f.yaml:1: a key that is not plain text",
    "{a: b}: 1": "f.yaml:1: a key that is not plain text",
    "one: {1: 2}": "f.yaml:1: one.1: a key that is not text; put it in quotes",
    "one: &x 1\ntwo: &x 2": "f.yaml:2: not YAML: an anchor (&name) is given twice",
    '"a\\nb": 1': r"f.yaml:1: 'a\nb': unknown key",
    "k" * 900 + ": 1": "f.yaml:1: 'kkk",
    "one: {d: [1, x]}": "f.yaml:1: one.d.1: expected a whole number, got 'x'",
    "words: 3": "f.yaml:1: words: expected a list, got 3",
    "one: 3": "f.yaml:1: one: expected keys and values, got 3",
    "one: {b: " + "[" * 50 + "]" * 50 + "}": "f.yaml:1: one.b: expected text, got [[[[...]]]]",
}


@pytest.mark.parametrize(("text", "says"), VALUES.items(), ids=range(len(VALUES)))
def test_values_that_do_not_fit(text: str, says: str) -> None:
    assert complaint(text).startswith(says)


def test_dates_and_signs_are_text() -> None:
    assert read("words: [2001-12-14, =, 2001-12-14t21:59:43.10-05:00]").words[:2] == ["2001-12-14", "="]


FOREIGN = {
    "root:x:0:0:root:/root:/bin/bash\nsecret:x:1:1\n": "got text",
    "- secret\n- more": "got a list",
    "127.0": "got a number",
    "": "got nothing",
    "a: *secret": "found undefined alias",
    "a: !secret b": "could not determine a constructor for the tag",
    "%secret x\n---\n!secret!x a": "not YAML",
    "secret: 'unfinished": "not YAML",
    "secret [a, b: ]": "not YAML",
    "a: b: secret": "mapping values are not allowed",
    "a: [secret, secret": "not YAML",
    "&secret a: 1\nb: &secret 2": "given twice",
}


@pytest.mark.parametrize(("text", "says"), FOREIGN.items(), ids=range(len(FOREIGN)))
def test_a_file_of_another_kind_is_not_quoted(text: str, says: str) -> None:
    message = complaint(text)
    assert says in message
    assert "secret" not in message
    assert "root" not in message


def test_the_message_is_the_same_without_libyaml(monkeypatch: pytest.MonkeyPatch) -> None:
    """The line and that it is not YAML; the reason may be in other words."""
    from chainsim import yaml_tree

    texts = ["one: [1", "a: b: c", "one: {a: 1\ntwo: 2", "a: 'x\n\n", "\ta: 1", "- a\nb: 1", "a: *secret"]
    quick = [complaint(text).split(":")[:3] for text in texts]
    source = Path(yaml_tree.__file__).read_text(encoding="utf-8")
    without = {"__name__": "chainsim.without_libyaml", "__package__": "chainsim"}
    with monkeypatch.context() as patch:
        patch.delattr(yaml, "CSafeLoader", raising=False)
        exec(compile(source, yaml_tree.__file__, "exec"), without)
    for name in ("compose", "first_line", "values_of"):
        monkeypatch.setattr(f"chainsim.yamlfile.{name}", without[name])
    assert [complaint(text).split(":")[:3] for text in texts] == quick
    assert all("secret" not in complaint(text) for text in FOREIGN)
    assert "sections in sections" in complaint("one: " + "[" * 5000)
    assert read("one: &a {a: 1}\ntwo: {<<: *a, b: x}").two == Section(a=1, b="x")


def test_shown_is_short_whatever_it_shows() -> None:
    for value in (
        "x" * 10**6,
        [[["y" * 100] * 100] * 100] * 100,
        {f"k{i}": i for i in range(10**5)},
        10**300,
        b"z" * 999,
    ):
        assert len(shown(value)) <= 60
    assert shown("x\ny") == r"'x\ny'"
    assert shown("a" * 100) == "'" + "a" * 56 + "..."


def test_names_that_no_file_has() -> None:
    for name in ("a\0b.yaml", "x" * 300 + ".yaml", "\ud800.yaml"):
        with pytest.raises(ProfileError, match=r"\.yaml: "):
            read_model(Path(name), Whole)


def test_a_file_that_is_too_long_is_not_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "long.yaml"
    with path.open("wb") as file:
        file.truncate(10**12)
    with pytest.raises(ProfileError, match="more than 4000000 bytes"):
        load_device(str(path))


def test_a_frequency_that_no_actuator_of_the_device_has() -> None:
    profile = load_device("linked-6x6").as_dict()
    for f0_hz in (1e-320, 1e300):
        profile["actuators"] = [{"row": 0, "col": 0, "f0_hz": f0_hz}]
        with pytest.raises(ProfileError, match=r"actuators\.0\.f0_hz: expected within 1000 times"):
            parse_model(yaml.safe_dump(profile), "f.yaml", type(load_device("linked-6x6")))


def test_a_chain_file_from_a_pipe_is_read_as_strictly() -> None:
    with pytest.raises(ProfileError, match=r"pipe:1: expected keys and values \('key: value'\), got text"):
        parse_simulation("secret", "pipe")
