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

SOFTWARE_GL = ("--use-gl=angle", "--use-angle=gl-egl", "--ignore-gpu-blocklist")
"""Arguments for rendering by Mesa's llvmpipe: 16 frames per second of a replay on two cores, SwiftShader draws 0.6."""

ELSEWHERE = re.compile(r"^https?://(?!127\.0\.0\.1[:/])")
"""Requests of Rerun's page to the internet (fonts, latest version, statistics), which get an empty answer here."""


TALLEST_PX = 16_000
"""Largest height of a picture of a page; of taller ones, the browser repeats the beginning."""


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


def keep(page: Page, name: str, *, is_whole: bool = False) -> None:
    """Keep a screenshot of the window or the full page as `name`.jpg, four times as fast as a PNG.

    Of a page taller than `TALLEST_PX`, the parts below are kept as `name`-2.jpg and so on.
    """
    KEPT.mkdir(parents=True, exist_ok=True)
    width, height = page.evaluate("[document.documentElement.clientWidth, document.documentElement.scrollHeight]")
    tops = range(0, height, TALLEST_PX) if is_whole else [0]
    for number, top in enumerate(tops, start=1):
        clip: Any = {"x": 0, "y": top, "width": width, "height": min(height - top, TALLEST_PX)}
        page.screenshot(
            path=KEPT / f"{name}{f'-{number}' * (number > 1)}.jpg",
            full_page=is_whole,
            clip=clip if is_whole else None,
            type="jpeg",
            quality=85,
            animations="disabled",
            timeout=180_000,
        )


def picture_when(
    page: Page, name: str, is_ready: Callable[[NDArray[np.uint8]], bool], limit_s: float = 300.0
) -> NDArray[np.uint8]:
    """Return the first screenshot for which `is_ready` holds, or the last one within the time limit."""
    deadline = time.monotonic() + limit_s
    while not is_ready(seen := picture(page, name)) and time.monotonic() < deadline:
        page.wait_for_timeout(1000)
    return seen


def still_picture(page: Page, name: str) -> NDArray[np.uint8]:
    """Return and keep a picture when the views, which move smoothly to a new time or size, have stopped."""
    before = picture(page, name)

    def is_still(seen: NDArray[np.uint8]) -> bool:
        nonlocal before
        page.wait_for_timeout(500)
        share = (seen == before).mean()
        before = seen
        return bool(share > 0.9999)

    page.wait_for_timeout(500)
    return picture_when(page, name, is_still, limit_s=60.0)


REPLAY_WIDTHS_PX, REPLAY_HEIGHT_PX = (1280, 1920, 390), 800

REPLAY_PLACES_PX = {"start": 310, "middle": 686, "end": 1074}
"""Places on the time line of a replay in a window of 1280 pixels, from the left."""


def keep_replay(page: Page, name: str) -> None:
    """Pause a replay that follows the theme of the browser; keep pictures of three times in all widths and themes."""
    button_px, line_px = 26, REPLAY_HEIGHT_PX - 14
    page.set_viewport_size({"width": REPLAY_WIDTHS_PX[0], "height": REPLAY_HEIGHT_PX})

    def is_paused(seen: NDArray[np.uint8]) -> bool:
        if np.ptp(seen[line_px, button_px].astype(int)) < 100:  # the button is blue while the replay runs
            return True
        page.mouse.click(button_px, line_px)
        return False

    assert is_paused(picture_when(page, f"{name}-loaded", is_paused))
    for place, place_px in REPLAY_PLACES_PX.items():
        page.set_viewport_size({"width": REPLAY_WIDTHS_PX[0], "height": REPLAY_HEIGHT_PX})
        page.wait_for_timeout(1000)
        page.mouse.click(place_px, line_px)
        page.mouse.move(REPLAY_WIDTHS_PX[0] - 100, line_px - 46)
        for width in REPLAY_WIDTHS_PX:
            page.set_viewport_size({"width": width, "height": REPLAY_HEIGHT_PX})
            for theme in ("light", "dark"):
                page.emulate_media(color_scheme=theme)
                assert_theme(still_picture(page, f"{name}-{place}-{width}-{theme}"), theme)


def assert_theme(seen: NDArray[np.uint8], theme: Theme) -> None:
    """Assert that the bar at the top of the viewer has the theme."""
    bar = float(seen[:20].mean())
    assert bar > 200 if theme == "light" else bar < 60


def n_colours(seen: NDArray[np.uint8]) -> int:
    """Return the number of different colours of a picture."""
    return np.unique(seen.reshape(-1, 3), axis=0).shape[0]
