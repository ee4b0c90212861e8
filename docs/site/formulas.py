"""Formulas of pages and docstrings as MathML, which a browser draws without a script.

As in docstrings, a formula begins with `.. math::` and goes on over the lines that are indented deeper; one
within a line stands between backticks after `:math:`.
"""

import re
from typing import Literal

from latex2mathml.converter import convert
from markdown import Markdown
from markdown.extensions import Extension
from markdown.preprocessors import Preprocessor

FORMULA = re.compile(r"^(?P<indent> *)\.\. math::(?P<latex>.*(?:\n(?:[ \t]*\n)?(?P=indent) +\S.*)*)", re.MULTILINE)
IN_LINE = re.compile(r":math:`([^`]+)`")
BEFORE_CODE = 26
"""Python-Markdown's priority for what comes before fenced code."""


class Formulas(Preprocessor):
    """Draws formulas."""

    def run(self, lines: list[str]) -> list[str]:
        """The lines of a page, its formulas drawn."""
        drawn = FORMULA.sub(
            lambda found: f"{found['indent']}{self._drawn(found['latex'], 'block')}\n", "\n".join(lines)
        )
        return IN_LINE.sub(lambda found: self._drawn(found[1], "inline"), drawn).split("\n")

    def _drawn(self, latex: str, display: Literal["block", "inline"]) -> str:
        known = " ".join(latex.split()).replace(r"\arg", r"\operatorname{arg}\,").replace(r"\_", "_")
        return self.md.htmlStash.store(convert(known, display=display))


class FormulaExtension(Extension):
    """Formulas in Markdown."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Register what draws formulas."""
        md.preprocessors.register(Formulas(md), "formulas", BEFORE_CODE)


def makeExtension() -> FormulaExtension:
    """The extension, for Python-Markdown."""
    return FormulaExtension()
