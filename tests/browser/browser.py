"""Headless browser: pictures and errors of a page, and a server for it."""

from __future__ import annotations

import io
import os
import re
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

if TYPE_CHECKING:
    from playwright.sync_api import Page

sync_api = pytest.importorskip("playwright.sync_api", reason="uv sync --group checks")

Theme = Literal["light", "dark"]

KEPT = Path(__file__).parents[2] / ".ci" / "screenshots"
"""Folder where pictures are kept; git ignores it."""

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)
NEEDS_CHROMIUM = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed (Debian: chromium)")

SOFTWARE_GL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")


ELSEWHERE = re.compile(r"^https?://(?!127\.0\.0\.1[:/])")
"""Requests of Rerun's page to the internet (fonts, latest version, statistics), which get an empty answer here."""


class Opened(NamedTuple):
    """Page and its errors so far: of console, scripts and requests."""

    page: Page
    errors: list[str]


@contextmanager
def opened(url: str, theme: Theme) -> Iterator[Opened]:
    """Open an address in a new browser with a theme."""
    errors: list[str] = []
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, args=[*SOFTWARE_GL, *(["--no-sandbox"] if os.geteuid() == 0 else [])]
        )
        try:
            page = browser.new_page(color_scheme=theme, viewport={"width": 1280, "height": 800})
            page.route(ELSEWHERE, lambda route: route.fulfill(status=200, content_type="application/json", body="{}"))
            page.on("console", lambda told: errors.append(told.text) if told.type == "error" else None)
            page.on("pageerror", lambda error: errors.append(str(error)))
            page.on("requestfailed", lambda request: errors.append(f"cannot load {request.url}"))
            page.goto(url, wait_until="load", timeout=180_000)
            yield Opened(page, errors)
        finally:
            browser.close()


class QuietHandler(SimpleHTTPRequestHandler):
    """Handler that prints nothing."""

    def log_message(self, format: str, *args: object) -> None:
        """Do nothing."""


class ThrottledHandler(QuietHandler):
    """Handler that sends the first fifth of a recording at once, and the rest at 200 bytes per second."""

    sent_share = 0.0
    """Share of the latest recording that was sent."""

    def copyfile(self, source: Any, outputfile: Any) -> None:  # noqa: ANN401 - as in the base class
        """Send a file."""
        data = source.read()
        first = len(data) // 5 if self.path.partition("?")[0].endswith(".rrd") else len(data)
        outputfile.write(data[:first])
        with suppress(OSError):  # the browser is closed
            for at in range(first, len(data), 100):
                ThrottledHandler.sent_share = at / len(data)
                time.sleep(0.5)
                outputfile.write(data[at : at + 100])


@contextmanager
def served(folder: Path, handler: type[QuietHandler] = QuietHandler) -> Iterator[str]:
    """Serve a folder on this machine, and yield the address."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(handler, directory=str(folder))) as server:
        threading.Thread(target=server.serve_forever).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()


def picture(page: Page, name: str) -> NDArray[np.uint8]:
    """Return a screenshot, shape (height, width, 3), and keep it as `name`.png."""
    KEPT.mkdir(parents=True, exist_ok=True)
    data = page.screenshot(path=KEPT / f"{name}.png", timeout=180_000)
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def keep(page: Page, name: str) -> None:
    """Keep a screenshot as `name`.jpg, four times as fast as a PNG."""
    KEPT.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=KEPT / f"{name}.jpg", type="jpeg", quality=85, timeout=180_000)


def picture_when(
    page: Page, name: str, is_ready: Callable[[NDArray[np.uint8]], bool], limit_s: float = 300.0
) -> NDArray[np.uint8]:
    """Return the first screenshot for which `is_ready` holds, or the last one within the time limit."""
    deadline = time.monotonic() + limit_s
    while not is_ready(seen := picture(page, name)) and time.monotonic() < deadline:
        page.wait_for_timeout(1000)
    return seen


def still_picture(page: Page, name: str, limit_s: float = 120.0) -> None:
    """Keep a picture when robot and plan have stopped moving; in software, a frame takes a second."""
    before = [picture(page, name)]

    def is_still(seen: NDArray[np.uint8]) -> bool:
        page.wait_for_timeout(6000)
        before.append(seen)
        return bool((before[-1][50:530, :1190] == before[-2][50:530, :1190]).mean() > 0.9999)

    picture_when(page, name, is_still, limit_s)


def keep_middle_and_end(page: Page, name: str) -> None:
    """Pause a replay, and keep pictures of its middle and its end, in a window of 1600 x 1000."""
    page.set_viewport_size({"width": 1600, "height": 1000})
    page.mouse.click(26, 986)  # pause
    for place, x_px in (("middle", 840), ("end", 1394)):
        page.mouse.click(x_px, 986)  # on the time line
        page.mouse.move(1500, 940)
        still_picture(page, f"{name}-{place}")


def n_colours(seen: NDArray[np.uint8]) -> int:
    """Return the number of different colours of a picture."""
    return np.unique(seen.reshape(-1, 3), axis=0).shape[0]
