"""Parser of HTML pages for tests."""

from html.parser import HTMLParser

VOID = {"meta", "br", "wbr", "img", "link", "input", "hr"}
BLOCKS = {"td", "th", "dt", "dd", "p", "h1", "h2", "h3"}
"""Elements whose text is separate from that of the next element."""


class PageReader(HTMLParser):
    """Elements, text and nesting errors of a page.

    Args:
        source: Text of the page.
    """

    def __init__(self, source: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.errors: list[str] = []
        self._open: list[str] = []
        self._texts: list[tuple[str, str]] = []
        self.feed(source)
        self.close()
        self.errors += [f"{tag} is not closed" for tag in self._open]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self._open or self._open.pop() != tag:
            self.errors.append(f"{tag} is closed out of order")
        if tag in BLOCKS:
            self._texts.append((tag, " "))

    def handle_data(self, data: str) -> None:
        self._texts.append((self._open[-1] if self._open else "", data))

    @property
    def text(self) -> str:
        """Text of the page without styles, with single spaces."""
        return " ".join("".join(data for tag, data in self._texts if tag != "style").split())

    @property
    def styles(self) -> str:
        """Text of all style sheets."""
        return "".join(data for tag, data in self._texts if tag == "style")

    @property
    def ids(self) -> list[str]:
        """Values of all id attributes."""
        return [attributes["id"] or "" for _, attributes in self.elements if "id" in attributes]
