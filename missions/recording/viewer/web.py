"""Recordings in a browser on this machine: Rerun serves the page of its viewer, and this process the files."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import quote, urlsplit

from pdpatrol.missions.recording.viewer.rerun_process import LOOPBACK, RerunProcess, free_port


def serve(recordings: Sequence[Path], announce: Callable[[str], None]) -> None:
    """Serve recordings to browsers on this machine until something ends the wait.

    Args:
        recordings: Of them, and nothing else.
        announce: Called with the address once it answers.

    Raises:
        ViewerError: If the page of the viewer cannot be served.
    """
    page_port = free_port()
    page = f"http://{LOOPBACK}:{page_port}"
    files = {f"/{number}/{path.name}": path for number, path in enumerate(recordings)}
    with ThreadingHTTPServer((LOOPBACK, 0), partial(_RecordingFile, files, page)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        sources = [f"http://{LOOPBACK}:{server.server_port}{quote(name)}" for name in files]
        # Given addresses instead of files, Rerun starts no server of data, which would keep a core busy.
        with RerunProcess("--serve-web", "--web-viewer-port", str(page_port), *sources) as viewer:
            viewer.wait_for(page_port)
            announce(f"{page}/?{'&'.join(f'url={quote(source, safe=str())}' for source in sources)}")
            viewer.wait()
        server.shutdown()


class _RecordingFile(SimpleHTTPRequestHandler):
    """Answers with one of some files, to the page of the viewer alone."""

    def __init__(self, files: dict[str, Path], page: str, *args: object, **kwargs: object) -> None:
        self._files, self._page = files, page
        super().__init__(*args, **kwargs)  # type: ignore[arg-type]

    def translate_path(self, path: str) -> str:
        """The file that an address stands for."""
        return str(self._files.get(urlsplit(path).path, ""))

    def end_headers(self) -> None:
        """Let the page of the viewer, which has another port, read the answer."""
        self.send_header("Access-Control-Allow-Origin", self._page)
        super().end_headers()

    def log_message(self, format: str, *args: object) -> None:
        """Nothing: the terminal is not for requests."""
