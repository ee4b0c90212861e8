"""Convert formulas in pages and docstrings to MathML, which browsers render without a script.

A displayed formula begins with `.. math::` and continues over the lines that are indented deeper; an inline formula
stands between backticks after `:math:`.
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
"""Priority in Python-Markdown; higher than that of fenced code."""


class Formulas(Preprocessor):
    """Preprocessor that converts the formulas of a page."""

    def run(self, lines: list[str]) -> list[str]:
        """Return the lines of a page with its formulas converted."""
        drawn = FORMULA.sub(
            lambda found: f"{found['indent']}{self._drawn(found['latex'], 'block')}\n", "\n".join(lines)
        )
        return IN_LINE.sub(lambda found: self._drawn(found[1], "inline"), drawn).split("\n")

    def _drawn(self, latex: str, display: Literal["block", "inline"]) -> str:
        known = " ".join(latex.split()).replace(r"\arg", r"\operatorname{arg}\,").replace(r"\_", "_")
        return self.md.htmlStash.store(convert(known, display=display))


class FormulaExtension(Extension):
    """Markdown extension for formulas."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Register the preprocessor."""
        md.preprocessors.register(Formulas(md), "formulas", BEFORE_CODE)


def makeExtension() -> FormulaExtension:
    """Return the extension; Python-Markdown calls this."""
    return FormulaExtension()
