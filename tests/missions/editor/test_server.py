"""Server of the editor: whom it answers, and when it writes."""

import json
import os
import threading
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import pytest

from pdpatrol.envs.scenario import SHIPPED
from pdpatrol.missions.editor.document import NEW_YARD
from pdpatrol.missions.editor.server import EditorServer, editor_server
from tests.missions.conftest import Refused

TEXT = (SHIPPED / "switchyard.toml").read_text(encoding="utf-8")


@pytest.fixture
def yard(tmp_path: Path) -> Path:
    """Write a scenario file that only its owner and group can read."""
    file = tmp_path / "yard.toml"
    file.write_text(TEXT, encoding="utf-8")
    file.chmod(0o640)
    return file


@pytest.fixture
def server(yard: Path) -> Iterator[EditorServer]:
    """Serve the file of `yard`."""
    with editor_server(yard, 0) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def ask(server: EditorServer, path: str, body: Any = None, method: str = "POST", **headers: str) -> tuple[int, bytes]:  # noqa: ANN401 - JSON
    """Send a request as the page does, with other headers where given."""
    ours = {"Origin": f"http://{server.host}", "X-Token": server.token}
    connection = HTTPConnection(server.host, timeout=60.0)
    connection.request(
        method, path, json.dumps(body), ours | {name.replace("_", "-"): v for name, v in headers.items()}
    )
    answer = connection.getresponse()
    status, content = answer.status, answer.read()
    connection.close()
    return status, content


def told(server: EditorServer, path: str, **body: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
    status, content = ask(server, path, body)
    assert status == 200
    return json.loads(content)


@pytest.mark.parametrize(
    "headers",
    [
        {"X_Token": "guess"},
        {"X_Token": ""},
        {"Origin": "http://example.com"},
        {"Origin": "null"},
        {"Host": "example.com"},
        {"Host": "localhost"},
    ],
)
def test_requests_of_other_pages_are_refused_and_write_nothing(
    headers: dict[str, str], server: EditorServer, yard: Path
) -> None:
    for path in ("/open", "/edit", "/save"):
        assert ask(server, path, {"text": NEW_YARD, "opened": TEXT}, **headers)[0] == 403
    assert yard.read_text(encoding="utf-8") == TEXT


def test_page_is_sent_to_those_who_know_the_address(server: EditorServer) -> None:
    address = server.url.removeprefix(f"http://{server.host}")
    assert ask(server, address, method="GET")[0] == 200
    assert ask(server, address, method="GET", Host="example.com")[0] == 403
    for path in ("/", "/?token=guess", "/yard.toml", address.replace("/?", "/x?")):
        assert ask(server, path, method="GET")[0] == 403
    assert server.server_address[0] == "127.0.0.1"


@pytest.mark.parametrize("text", [TEXT, "\ufeff" + TEXT.replace("\n", "\r\n"), TEXT.rstrip("\n")])
def test_file_opened_and_saved_again_is_the_same_bytes(text: str, server: EditorServer, yard: Path) -> None:
    yard.write_bytes(text.encode())
    opened = told(server, "/open")
    assert told(server, "/save", text=opened["text"], opened=opened["opened"]) == {"opened": text}
    assert yard.read_bytes() == text.encode()
    assert yard.stat().st_mode & 0o777 == 0o640


def test_saved_text_is_that_of_the_edits(server: EditorServer, yard: Path) -> None:
    edit = {"operation": "set", "path": ["route", "dwell_s"], "value": "2.0"}
    answer = told(server, "/edit", text=TEXT, edits=[edit])
    assert answer["view"]["route"]["dwell_s"] == "2.0"
    assert yard.read_text(encoding="utf-8") == TEXT
    told(server, "/save", text=answer["text"], opened=TEXT)
    assert yard.read_text(encoding="utf-8") == answer["text"] != TEXT
    assert os.listdir(yard.parent) == [yard.name]


def test_scenario_with_errors_is_not_saved(server: EditorServer, yard: Path) -> None:
    wrong = TEXT.replace("breaker_2", "breaker_1", 1)
    (line,) = told(server, "/save", text=wrong, opened=TEXT)["errors"]
    assert "breaker_1" in line
    assert yard.read_text(encoding="utf-8") == TEXT


@pytest.mark.parametrize("meanwhile", [TEXT + "# changed\n", None])
def test_file_that_changed_on_disk_is_not_overwritten(meanwhile: str | None, server: EditorServer, yard: Path) -> None:
    yard.unlink()
    if meanwhile is not None:
        yard.write_text(meanwhile, encoding="utf-8")
    (line,) = told(server, "/save", text=TEXT + "# mine\n", opened=TEXT)["errors"]
    assert line.startswith("yard.toml: has changed on disk")
    assert (yard.read_text(encoding="utf-8") if yard.exists() else None) == meanwhile


def test_link_stays_a_link(server: EditorServer, yard: Path, tmp_path: Path) -> None:
    link = tmp_path / "link.toml"
    link.symlink_to(yard)
    with editor_server(link, 0) as other:
        threading.Thread(target=other.serve_forever, daemon=True).start()
        told(other, "/save", text=TEXT + "# mine\n", opened=TEXT)
        other.shutdown()
    assert link.is_symlink()
    assert yard.read_text(encoding="utf-8") == TEXT + "# mine\n"


@pytest.mark.parametrize(
    "body", [[], {"text": 3}, {"text": "a = ", "edits": []}, {"text": TEXT, "edits": [{"path": []}]}]
)
def test_malformed_request_is_answered_with_errors(body: object, server: EditorServer) -> None:
    status, content = ask(server, "/edit", body)
    assert status == 200
    assert json.loads(content)["errors"]


def test_new_file_is_not_there_until_it_is_saved(tmp_path: Path) -> None:
    file = tmp_path / "new.toml"
    with editor_server(file, 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        opened = told(server, "/open")
        assert (opened["text"], opened["opened"], opened["view"]["errors"]) == (NEW_YARD, None, [])
        assert not file.exists()
        told(server, "/save", text=NEW_YARD, opened=None)
        assert file.read_text(encoding="utf-8") == NEW_YARD
        server.shutdown()


@pytest.mark.parametrize(
    ("name", "content", "start"),
    [
        ("yard.txt", None, "FILE must be a .toml file"),
        ("nowhere/yard.toml", None, "FILE must be a .toml file"),
        ("my yard.toml", None, "name: must match pattern"),
        ("broken.toml", b"[yard", "broken.toml: is not valid TOML"),
        ("latin.toml", b"# \xe4\n", "latin.toml: is not valid TOML"),
    ],
)
def test_file_that_cannot_be_edited_is_refused_in_one_line(
    name: str, content: bytes | None, start: str, tmp_path: Path, refused: Refused
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    (line,) = refused("edit", name, "--no-open", cwd=tmp_path)
    assert line.startswith(start)
