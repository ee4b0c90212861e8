"""HTML pages that are one file each: the frame of all, filled by jinja2, with matplotlib's pictures inline as SVG."""

from __future__ import annotations

import re
from datetime import datetime
from functools import cache
from io import StringIO
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NO_METADATA = {"Creator": None, "Date": None, "Format": None, "Type": None}
"""Of an SVG: without these, matplotlib writes the same bytes each time, and names no address."""

SVG_STYLE: Any = {
    "svg.fonttype": "none",  # text stays text: it can be searched, and takes the fonts of the page
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#5f6b76",
    "axes.labelcolor": "#1c2833",
    "xtick.color": "#45525e",
    "ytick.color": "#45525e",
}
"""Settings of matplotlib under which pictures of a page are made and written."""


def render(template: str, **content: object) -> str:
    """A page from a template that extends `base.html`; what it says when was issued is now, local time.

    Args:
        template: Name of a file in `missions/report/templates`.
        content: What the template names; text is escaped, `Markup` such as of `inline_svg` is not.
    """
    issued = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z")
    return _environment().get_template(template).render(issued=issued, **content)


def inline_svg(figure: Figure, name: str, description: str) -> Markup:
    """A figure as an SVG element to stand in a page, as wide as the page allows and no wider than it was made.

    Args:
        figure: Of matplotlib.
        name: Once in the page, of letters, digits and dashes: ids within the picture begin with it.
        description: What it shows, for those who cannot see it.
    """
    from matplotlib import rc_context

    buffer = StringIO()
    with rc_context({**SVG_STYLE, "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata=NO_METADATA)
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    svg = re.sub(r"url\(#", f"url(#{name}-", svg)
    svg = re.sub(r'\bxlink:href="#', f'href="#{name}-', svg)
    svg = re.sub(r"<!--.*?-->\s*", "", svg, flags=re.DOTALL)
    svg = re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), svg)  # 0.01 pt is enough
    label = Markup.escape(description)
    return Markup(svg.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1))


def css_string(text: str) -> Markup:
    """A text between quotes in CSS, with all but plain letters, digits and spaces as escapes."""
    return Markup("".join(c if c.isascii() and (c.isalnum() or c in " .,_-") else f"\\{ord(c):x} " for c in text))


def breakable(text: str) -> Markup:
    """Names that may go on in the next line after a slash or an underscore, and percentages that may not."""
    text = re.sub(r"(> |< )?(\d+) %", lambda found: found[0].replace(" ", "\N{NO-BREAK SPACE}"), text)
    return Markup(re.sub(r"([/_])", r"\1<wbr>", str(Markup.escape(text))))


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("pdpatrol.missions.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"css_string": css_string, "breakable": breakable}
    return environment
