"""Server of the editor's page: it reads, checks and writes one scenario file, for its own page only."""

import secrets
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from pydantic import BaseModel
from pydantic_core import to_json

from dirmusic import InputFileError
from dirmusic.input_file import read_whole
from pdpatrol.envs.scenario import check_content
from pdpatrol.envs.scenario.base import MAX_FILE_BYTES, parse_toml
from pdpatrol.envs.user_code import UserCodeError
from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.editor.document import NEW_YARD, Edit, edited
from pdpatrol.missions.editor.view import forms, kinds_with_kv, view_of

LOOPBACK = "127.0.0.1"

PAGE = Path(__file__).with_name("editor.html")

HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
"""Headers of all answers: the page loads nothing from elsewhere, and no other page can show it."""


class PageRequest(BaseModel):
    """Text on the page, with edits to make in it, or to write over the text that was opened: None if it was new."""

    text: str
    edits: tuple[Edit, ...] = ()
    opened: str | None = None


class ScenarioFile:
    """Scenario file that is edited.

    Attributes:
        path: The file itself, also if the user gave a link to it.
        name: Its name for the user.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.name = path.resolve(), path.name

    def read(self) -> str | None:
        """Return the text of the file, or None if it does not exist.

        Raises:
            InputFileError: If it cannot be read or is not valid TOML in UTF-8.
        """
        if not self.path.exists():
            return None
        content = read_whole(self.path, MAX_FILE_BYTES)
        parse_toml(content, Path(self.name))
        return content.decode()

    def save(self, text: str, opened: str | None) -> None:
        """Write a valid scenario, completely or not at all.

        Args:
            text: Text to write.
            opened: Text that was opened; None if the file was new.

        Raises:
            InputFileError: If the text has errors, or the file is not as it was opened.
            OSError: If the file cannot be written.
        """
        on_disk = self.path.read_bytes() if self.path.exists() else None
        if on_disk != (None if opened is None else opened.encode()):
            raise InputFileError([f"{self.name}: has changed on disk since it was opened here; nothing was saved"])
        check_content(text.encode(), self.path)
        with atomic_file(self.path) as temporary:
            temporary.write_bytes(text.encode())
            if on_disk is not None:
                shutil.copymode(self.path, temporary)


class EditorServer(ThreadingHTTPServer):
    """Server on this machine only; `url` has the token without which requests are refused.

    Actions hold `lock`, one at a time.

    Args:
        file: File that is edited.
        port: Port, or 0 for any that is free.

    Raises:
        OSError: If the port cannot be opened.
    """

    daemon_threads = True

    def __init__(self, file: ScenarioFile, port: int) -> None:
        try:
            super().__init__((LOOPBACK, port), _Handler)
        except OSError as error:
            raise OSError(f"port {port} cannot be opened: {error.strerror}") from None
        self.file, self.token, self.lock = file, secrets.token_urlsafe(24), threading.Lock()
        self.host = f"{LOOPBACK}:{self.server_address[1]}"
        self.url = f"http://{self.host}/?token={self.token}"


@contextmanager
def editor_server(path: Path, port: int) -> Iterator[EditorServer]:
    """Open the server of a file; at the end, wait until a file that is being written is complete.

    Raises:
        InputFileError: If the file cannot be edited.
        OSError: If the port cannot be opened.
    """
    file = ScenarioFile(path)
    text = file.read()
    if text is None:
        check_content(NEW_YARD.encode(), file.path)  # its name may not do
    view_of(text or NEW_YARD, file.path)  # the first check compiles, for which the page should not wait
    with EditorServer(file, port) as server:
        try:
            yield server
        finally:
            server.lock.acquire()


class _Handler(BaseHTTPRequestHandler):
    """Answers to the page."""

    server: EditorServer

    def do_GET(self) -> None:
        """Send the page to those who know the token."""
        address = urlsplit(self.path)
        token = parse_qs(address.query).get("token", [""])[0]
        if self.headers["Host"] != self.server.host or address.path != "/" or not self._is_token(token):
            self._send(HTTPStatus.FORBIDDEN, "text/plain", b"Open the address that pdpatrol edit has printed.\n")
        else:
            self._send(HTTPStatus.OK, "text/html; charset=utf-8", PAGE.read_bytes())

    def do_POST(self) -> None:
        """Open, edit, or save the file; errors are an answer with a list of lines."""
        actions: dict[str, Callable[[bytes], Any]] = {"/open": self._open, "/edit": self._edit, "/save": self._save}
        is_ours = self.headers["Host"] == self.server.host and self.headers["Origin"] == f"http://{self.server.host}"
        n_bytes = self.headers["Content-Length"] or ""
        if not is_ours or not self._is_token(self.headers["X-Token"] or "") or self.path not in actions:
            self._send(HTTPStatus.FORBIDDEN, "text/plain", b"")
        elif not n_bytes.isdecimal() or int(n_bytes) > 4 * MAX_FILE_BYTES:
            self._send(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "text/plain", b"")
        else:
            try:
                body = self.rfile.read(int(n_bytes))
                with self.server.lock:
                    answer = actions[self.path](body)
            except InputFileError as error:
                answer = {"errors": error.faults}
            except (ValueError, UserCodeError, OSError) as error:
                answer = {"errors": [str(error)]}
            self._send(HTTPStatus.OK, "application/json", to_json(answer))

    def _is_token(self, token: str) -> bool:
        return secrets.compare_digest(token.encode(), self.server.token.encode())

    def _open(self, _body: bytes) -> dict[str, Any]:
        file, opened = self.server.file, self.server.file.read()
        text = NEW_YARD if opened is None else opened
        about = {"name": file.name, "opened": opened, "forms": forms(), "with_kv": kinds_with_kv()}
        return about | {"text": text, "view": view_of(text, file.path)}

    def _edit(self, body: bytes) -> dict[str, Any]:
        request = PageRequest.model_validate_json(body)
        text = edited(request.text, request.edits)
        return {"text": text, "view": view_of(text, self.server.file.path)}

    def _save(self, body: bytes) -> dict[str, Any]:
        request = PageRequest.model_validate_json(body)
        self.server.file.save(request.text, request.opened)
        return {"opened": request.text}

    def _send(self, status: HTTPStatus, content_type: str, body: bytes) -> None:
        self.send_response(status)
        for name, value in {**HEADERS, "Content-Type": content_type, "Content-Length": str(len(body))}.items():
            self.send_header(name, value)
        with suppress(ConnectionError):  # the page may have been closed
            self.end_headers()
            self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Print nothing for a request."""
