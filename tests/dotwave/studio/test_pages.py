"""What the pages answer, without a browser: results that stay, bad input, hostile uploads, cancelled work."""

from __future__ import annotations

import io
import re
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from html import unescape
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="needs the extra studio")
pytest.importorskip("httpx2", reason="needs httpx2: the client of the tests")

from starlette.testclient import TestClient

from chainsim import device_names, load_device
from dotwave.errors import AppError
from dotwave.studio.blind_test import BlindTest
from dotwave.studio.profile_form import profile_fields, profile_of
from dotwave.studio.tasks import Running, Tasks
from tests.support.studio import inside

ROOT = Path(__file__).resolve().parents[3]
PATIENCE_S = 180.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("studio")


@pytest.fixture(scope="module")
def client(folder: Path) -> Iterator[TestClient]:
    client = inside(folder)
    yield client
    tasks_of(client).close(10)


def tasks_of(client: TestClient) -> Tasks:
    tasks: Tasks = client.app.state.studio.tasks  # type: ignore[attr-defined]
    return tasks


def until(met: Callable[[], bool]) -> None:
    end, tick = time.monotonic() + PATIENCE_S, threading.Event()
    while not met():
        assert time.monotonic() < end, "waited in vain"
        tick.wait(0.02)


def begun(client: TestClient, address: str, typed: dict[str, str], **more: object) -> tuple[str, Running]:
    answer = client.post(address, data=typed, **more)  # type: ignore[arg-type]
    assert answer.status_code == 303, complaint(answer.text)
    where = answer.headers["location"]
    running = tasks_of(client).of(where.rsplit("/", 1)[1])
    assert running is not None
    return where, running


def complaint(page: str) -> str:
    found = re.search(r'class="error".*?>(?:<p>)?([^<]*)</p>', page, flags=re.DOTALL)
    return "" if found is None else unescape(found[1])


def test_a_text_stays_when_the_page_and_the_server_are_begun_anew(client: TestClient, folder: Path) -> None:
    where, running = begun(client, "/write", {"text": "Hi ☃", "device": "linked-6x6", "table": "en-ueb-g2.ctb"})
    assert "data-progress" in client.get(where).text
    until(lambda: running.over)
    assert not running.error
    events = client.get(f"/progress/{where.rsplit('/', 1)[1]}").text
    assert events.startswith("data: ")
    assert '"over": true' in events
    again = inside(folder)
    page = again.get(where).text
    assert "What is felt" in page
    assert "snowman" in page
    for name in ("text.wav", "text.json", "text.hjif", "text.png"):
        assert f"{name}" in page
        assert again.get(f"/results/{where.rsplit('/', 1)[1]}/{name}").status_code == 200
    assert again.get(f"/progress/{where.rsplit('/', 1)[1]}").status_code == 204
    assert "Hi" in again.get("/").text


def test_a_device_that_holds_patterns_still_has_no_haptic_file_and_all_else(client: TestClient) -> None:
    where, running = begun(client, "/write", {"text": "Hi", "device": "paper-6x6", "table": "en-ueb-g2.ctb"})
    until(lambda: running.over)
    page = client.get(where).text
    assert "No haptic file: " in page
    assert "text.wav" in page
    assert "text.hjif" not in page


def test_work_that_is_cancelled_ends_and_says_so(client: TestClient) -> None:
    words = "many words " * 4000
    where, running = begun(client, "/write", {"text": words, "device": "linked-6x6", "table": "en-ueb-g2.ctb"})
    until(lambda: running.label == "rendering")
    assert client.post(f"/cancel/{where.rsplit('/', 1)[1]}").status_code == 303
    until(lambda: running.over)
    assert complaint(client.get(where).text) == "Cancelled."
    # What was not finished is not offered.
    assert "text.wav" not in client.get(where).text
    begin_anew = inside(tasks_folder(client)).get(where).text
    assert "cut off" in complaint(begin_anew)


def tasks_folder(client: TestClient) -> Path:
    chosen: Path = client.app.state.studio.results.folder  # type: ignore[attr-defined]
    return chosen


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ({"text": " "}, "Text: is empty"),
        ({"text": "a", "device": "../../etc/passwd"}, "Device: there is no"),
        ({"text": "a", "device": "device-20261122-101010-abcdef"}, "no such result"),
    ],
)
def test_what_cannot_be_written_is_said_and_kept(client: TestClient, typed: dict[str, str], said: str) -> None:
    answer = client.post("/write", data={"device": "linked-6x6", **typed})
    assert answer.status_code == 400
    assert said in complaint(answer.text)
    assert f">{typed['text']}</textarea>" in answer.text


def test_an_unknown_table_is_said_by_the_worker(client: TestClient) -> None:
    where, running = begun(client, "/write", {"text": "a", "device": "linked-6x6", "table": "../../etc/passwd"})
    until(lambda: running.over)
    assert "table" in complaint(client.get(where).text)


def hostile_zip() -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("../../outside.svg", "<svg/>")
        archive.writestr("word/document.xml", b"\0" * 50_000_000)
        archive.writestr("big.svg", b" " * 50_000_000)
    return file.getvalue()


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("letter.exe", b"MZ", "another ending"),
        ("../../.bashrc", b"x", "another ending"),
        ("x" * 500, b"x", "another ending"),
    ],
)
def test_a_name_that_will_not_do_writes_nothing(tmp_path: Path, name: str, data: bytes, said: str) -> None:
    client = inside(tmp_path)
    for address, field in (("/write", "document"), ("/pictures", "file")):
        answer = client.post(address, data={"device": "linked-6x6"}, files={field: (name, data)})
        assert answer.status_code == 400
        assert said in complaint(answer.text)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["letter.docx", "letter.pdf", "../../letter.epub"])
def test_a_hostile_document_is_refused_by_the_readers(client: TestClient, folder: Path, name: str) -> None:
    typed = {"device": "linked-6x6", "table": "en-ueb-g2.ctb"}
    where, running = begun(client, "/write", typed, files={"document": (name, hostile_zip())})
    until(lambda: running.over)
    assert complaint(client.get(where).text)
    assert not (folder.parent / "outside.svg").exists()
    assert not list(folder.parent.glob("letter*"))


def test_hostile_pictures_are_refused(client: TestClient) -> None:
    for name, data in (("bomb.png", b"\x89PNG\r\n\x1a\n" + b"\0" * 100), ("a.svg", b"<svg onload='x()'>")):
        answer = client.post("/pictures", data={"device": "linked-6x6"}, files={"file": (name, data)})
        page = client.get(answer.headers["location"])
        assert page.status_code == 400
        assert complaint(page.text)


def test_a_set_of_icons_has_its_neighbours_and_a_blind_test(client: TestClient) -> None:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name in ("heart", "home", "lock"):
            archive.write(ROOT / f"samples/icons/{name}.svg", f"{name}.svg")
        archive.writestr("broken.svg", "<svg")
    typed = {"device": "linked-6x6", "distinct": "yes"}
    where, running = begun(client, "/pictures", typed, files={"file": ("set.zip", file.getvalue())})
    until(lambda: running.over)
    page = client.get(where).text
    assert "3 icons on linked-6x6" in page
    assert "Nearest: <bdi>" in page
    assert "Files that could not be used" in page
    assert client.get(f"{where}?find=hea").text.count("<h3") == 1
    assert (
        client.get(f"/results/{where.rsplit('/', 1)[1]}/contact.png?show")
        .headers["content-disposition"]
        .startswith("inline")
    )
    first = client.get(f"{where}/test").text
    assert re.findall(r'name="icon".*?value="([^"]*)"', first) == ["heart.svg", "home.svg", "lock.svg"]
    assert client.post(f"{where}/test", data={"icon": "other"}).status_code == 400
    assert client.post(f"{where}/test", data={"icon": "lock.svg"}).status_code == 303
    assert "of 1 right" in client.get(f"{where}/test").text


def test_a_blind_test_shows_all_in_turn_and_counts_what_is_taken_for_what(tmp_path: Path) -> None:
    icons = [{"name": name, "outcome": "ok", "same_as": "", "nearest": "a"} for name in "abcdefghijkl"]
    test = BlindTest.of(tmp_path / "test.json", icons)
    shown = []
    for _ in icons:
        assert test.pending in test.choices
        assert len(test.choices) <= 8
        shown.append(test.pending)
        test.answer("a" if "a" in test.choices else test.pending, icons)
    assert sorted(shown) == sorted("abcdefghijkl")
    again = BlindTest.of(tmp_path / "test.json", icons)
    assert (again.answers, again.pending) == (test.answers, test.pending)
    columns, rows = again.confusion()
    assert sum(sum(counts) for _, counts in rows) == len(icons)
    assert sum(counts[columns.index(name)] for name, counts in rows if name in columns) == again.right
    with pytest.raises(AppError, match="at least two"):
        BlindTest.of(tmp_path / "other.json", icons[:1])


@pytest.mark.parametrize("name", device_names())
def test_a_profile_comes_back_from_its_form(name: str) -> None:
    device = load_device(name)
    typed = {field.key: field.value for field in profile_fields(device.as_dict())}
    assert type(device).model_validate(profile_of(typed)) == device


def test_every_field_of_a_profile_says_its_unit_and_what_is_assumed() -> None:
    fields = {field.name: field for field in profile_fields(load_device("linked-6x6").as_dict())}
    assert fields["f0_hz"].unit == "hertz"
    assert fields["f0_hz"].span == "above 0"
    assert fields["delta"].source.startswith("assumed because: ")
    assert fields["coupling.scope"].choices == ("none", "fixed", "device", "chain", "link")
    assert fields["notes"].lines


def test_a_saved_device_is_offered_to_other_pages(client: TestClient) -> None:
    typed = {field.key: field.value for field in profile_fields(load_device("paper-6x6").as_dict())}
    where, running = begun(client, "/device", typed | {"name": "of mine"})
    until(lambda: running.over)
    assert not running.error
    page = client.get(where).text
    assert "Deflection of one actuator" in page
    assert "of mine (saved here)" in client.get("/write").text
    refused = client.post("/device", data=typed | {"rows": "0"})
    assert refused.status_code == 400
    assert "rows: expected" in complaint(refused.text)


@pytest.mark.parametrize("query", ["omega=x", "n=2.5", "epsilon=-1", "omega=nan", "n=1e9", "lam=inf"])
def test_a_setting_that_will_not_do_is_said(client: TestClient, query: str) -> None:
    answer = client.get(f"/chain?{query}")
    assert answer.status_code == 400
    assert "expected" in complaint(answer.text)
    assert complaint(answer.text) in unescape(answer.text)


def test_a_setting_has_its_answers_beside_the_map(client: TestClient) -> None:
    page = client.get("/chain?omega=0.995").text
    assert "11 answers at this setting" in page
    assert page.count("reached from rest</th>") == 1
    assert page.count("<svg") == 2
    assert page.count("<table>") == 3
