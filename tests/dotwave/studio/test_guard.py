"""Who is let in to the studio, and what is refused: other pages, other names, other users, wrong paths, too much."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="needs the extra studio")
pytest.importorskip("httpx2", reason="needs httpx2: the client of the tests")

from starlette.testclient import TestClient

from dotwave.errors import AppError
from dotwave.studio.guard import MAX_BODY_BYTES
from dotwave.studio.keys import Keys
from dotwave.studio.results import Results
from dotwave.studio.serve import _listening
from tests.support.studio import PORT, inside, stranger

ADDRESSES = ["/", "/write", "/static/studio.js", "/results/x/y", "/progress/x"]


@pytest.fixture
def client(tmp_path: Path) -> TestClient:
    return inside(tmp_path)


@pytest.mark.parametrize("address", ADDRESSES)
def test_nobody_without_the_cookie_sees_anything(tmp_path: Path, address: str) -> None:
    answer = stranger(tmp_path).get(address)
    assert answer.status_code == 403
    assert "dotwave studio printed" in answer.text
    assert "set-cookie" not in answer.headers


def test_the_first_address_lets_one_browser_in(tmp_path: Path) -> None:
    keys = Keys(PORT)
    first = stranger(tmp_path, keys)
    address = keys.first_address
    let_in = first.get(address)
    assert let_in.status_code == 303
    assert let_in.headers["location"] == "/"
    cookie = let_in.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert keys.first_address not in (address, keys.origin)
    assert first.get("/").status_code == 200
    # Whoever reads the address off the screen or a list of processes comes too late.
    assert stranger(tmp_path, keys).get(address).status_code == 403


@pytest.mark.parametrize("token", ["", "x", "%00", "a" * 5000])
def test_a_wrong_token_is_refused(tmp_path: Path, token: str) -> None:
    keys = Keys(PORT)
    before = keys.token
    assert stranger(tmp_path, keys).get(f"/?token={token}").status_code == 403
    assert keys.token == before


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "127.0.0.1:80", f"evil.example:{PORT}", ""])
def test_another_name_of_this_machine_is_refused(client: TestClient, host: str) -> None:
    assert client.get("/", headers={"host": host}).status_code == 421


@pytest.mark.parametrize("origin", ["https://evil.example", "null", "http://127.0.0.1:1", ""])
def test_what_another_page_sends_is_refused(client: TestClient, origin: str) -> None:
    assert client.post("/stop", headers={"origin": origin}).status_code == 403
    assert client.post("/stop").status_code == 303


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_what_another_page_asks_for_is_refused(client: TestClient, site: str) -> None:
    for address in ADDRESSES:
        assert client.get(address, headers={"sec-fetch-site": site}).status_code == 403


def test_every_answer_says_what_a_browser_may_do(client: TestClient, tmp_path: Path) -> None:
    answers = [client.get(address) for address in ("/", "/nothing", "/static/studio.css")]
    for answer in (*answers, stranger(tmp_path).get("/")):
        assert "default-src 'none'" in answer.headers["content-security-policy"]
        assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["cache-control"] == "no-store"


def test_too_much_is_refused_before_it_is_read(client: TestClient) -> None:
    answer = client.post("/write", headers={"content-length": str(MAX_BODY_BYTES + 1)}, content=b"x")
    assert answer.status_code == 413


def test_too_much_is_refused_also_when_its_length_is_not_said(client: TestClient, tmp_path: Path) -> None:
    def pieces() -> Iterator[bytes]:
        yield b'--x\r\nContent-Disposition: form-data; name="document"; filename="a.txt"\r\n\r\n'
        for _ in range(MAX_BODY_BYTES // 1_000_000 + 2):
            yield b"a" * 1_000_000

    answer = client.post("/write", headers={"content-type": "multipart/form-data; boundary=x"}, content=pieces())
    assert answer.status_code == 413
    assert not list(tmp_path.iterdir())


TRAVERSALS = [
    "/results/../asked.json", "/results/%2e%2e/secret", "/results/{name}/../secret", "/results/{name}/..%2f..%2fsecret",
    "/results/{name}/%2fetc%2fpasswd", "/results/{name}/asked.json", "/results/{name}/.hidden", "/results/{name}/link",
    "/static/../app.py", "/static/%2e%2e/app.py", "/write/..%2f..", "/results/linked-20261122-101010-abcdef/secret",
]  # fmt: skip


@pytest.mark.parametrize("address", TRAVERSALS)
def test_no_path_leads_out_of_a_result(tmp_path: Path, address: str) -> None:
    folder = tmp_path / "chosen"
    (tmp_path / "secret").write_text("secret")
    result = Results(folder).begin("write", "words", {})
    (result.folder / ".hidden").write_text("secret")
    (result.folder / "link").symlink_to(tmp_path / "secret")
    (folder / "linked-20261122-101010-abcdef").symlink_to(tmp_path)
    answer = inside(folder).get(address.format(name=result.name))
    assert answer.status_code in (400, 404)
    assert "secret" not in answer.text.replace(address, "")
    assert "studio_app" not in answer.text


def test_a_file_of_a_result_is_downloaded_and_not_shown(tmp_path: Path) -> None:
    result = Results(tmp_path).begin("write", "<b>words</b>", {})
    (result.folder / "page.html").write_text("<script>1</script>")
    client = inside(tmp_path)
    answer = client.get(f"/results/{result.name}/page.html?show")
    assert answer.status_code == 200
    assert answer.headers["content-disposition"].startswith("attachment")
    # What it is called comes from a person and is shown as it is.
    assert "&lt;b&gt;words&lt;/b&gt;" in client.get("/").text


def test_a_result_without_its_name_is_none(tmp_path: Path) -> None:
    results = Results(tmp_path)
    made = results.begin("write", "one", {"text": "one"})
    assert results.find(made.name).asked == {"text": "one"}
    assert [one.title for one in results.latest(5)] == ["one"]
    (made.folder / "asked.json").write_text("[]")
    with pytest.raises(AppError, match="no such result"):
        results.find(made.name)


def test_it_listens_on_loopback_alone() -> None:
    listening = _listening(0)
    assert listening.getsockname()[0] == "127.0.0.1"
    port = listening.getsockname()[1]
    with listening, pytest.raises(AppError, match=f"--port {port}: .*leave it out"):
        _listening(port)


def test_a_start_page_names_every_page(client: TestClient) -> None:
    page = client.get("/").text
    assert page.startswith("<!DOCTYPE html>")
    assert '<html lang="en">' in page
    for one in client.app.state.pages:  # type: ignore[attr-defined]
        assert f'href="/{one.name}"' in page
        assert one.about in page


def test_what_was_asked_is_kept_as_it_was(tmp_path: Path) -> None:
    made = Results(tmp_path).begin("write", "one", {"text": "é"})
    assert json.loads((made.folder / "asked.json").read_text(encoding="utf-8"))["asked"] == {"text": "é"}
