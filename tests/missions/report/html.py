"""Pages read back with the standard library."""

from html.parser import HTMLParser

VOID = {"meta", "br", "wbr", "img", "link", "input", "hr"}

APART = {"td", "th", "dt", "dd", "p", "h1", "h2", "h3"}
"""Elements whose text does not run on into the next one's."""


class Page(HTMLParser):
    """A page: its elements with their attributes, its text, and whether every element is closed in order.

    Args:
        source: Text of the page.
    """

    def __init__(self, source: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []
        self._open: list[str] = []
        self.faults: list[str] = []
        self.feed(source)
        self.close()
        self.faults += [f"{tag} is not closed" for tag in self._open]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        if not self._open or self._open.pop() != tag:
            self.faults.append(f"{tag} is closed out of order")
        if tag in APART:
            self.texts.append((tag, " "))

    def handle_data(self, data: str) -> None:
        self.texts.append((self._open[-1] if self._open else "", data))

    @property
    def text(self) -> str:
        """All that is read on the page, without its style and with single spaces."""
        return " ".join("".join(data for tag, data in self.texts if tag != "style").split())

    @property
    def tags(self) -> list[str]:
        """Of all elements."""
        return [tag for tag, _ in self.elements]

    @property
    def ids(self) -> list[str]:
        """Of all elements that have one."""
        return [attributes["id"] or "" for _, attributes in self.elements if "id" in attributes]

    @property
    def loads(self) -> list[str]:
        """What a browser would fetch to show it."""
        fetched = [
            value or ""
            for tag, attributes in self.elements
            for key, value in attributes.items()
            if key in ("src", "srcset", "data", "xlink:href") or (key == "href" and tag != "a")
        ]
        styles = [data for tag, data in self.texts if tag == "style" and ("url(" in data or "@import" in data)]
        return [link for link in fetched if not link.startswith(("#", "data:image/"))] + styles
