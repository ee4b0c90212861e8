"""Make the pictures of docs/gallery.md that start the replays, from the screenshots of its test.

uv run --group docs --group checks pytest tests/browser/test_gallery.py -m whole -n 0
uv run python docs/pictures/make_replays.py
"""

from pathlib import Path

from PIL import Image

FOLDER = Path(__file__).parent / "replay"
SCREENSHOTS = Path(__file__).parents[2] / ".ci" / "screenshots"

VIEWS_PX = (0, 28, 1280, 775)
"""Part of a screenshot without menu and time line: left, top, right, bottom."""

SIZE_PX = (1200, 700)


def make_replays(screenshots: Path = SCREENSHOTS) -> None:
    """Draw the pictures again, each from the end of its mission in its theme."""
    for file in sorted(FOLDER.glob("*.jpg")):
        name, _, theme = file.stem.rpartition("-")
        with Image.open(screenshots / f"replay-{name}-end-1280-{theme}.png") as picture:
            views = picture.convert("RGB").crop(VIEWS_PX).resize(SIZE_PX, Image.Resampling.LANCZOS)
        views.save(file, quality=85, optimize=True)


if __name__ == "__main__":
    make_replays()
