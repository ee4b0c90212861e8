"""Convert formulas in pages and docstrings to MathML, which browsers render without a script.

A displayed formula begins with `.. math::` and continues over the lines that are indented deeper; an inline formula
stands between backticks after `:math:`. Pages may also have `$$` around displayed formulas and `$` around inline ones.
"""

import re
from typing import Literal

from latex2mathml.converter import convert
from markdown import Markdown
from markdown.extensions import Extension
from markdown.inlinepatterns import InlineProcessor
from markdown.preprocessors import Preprocessor

FORMULA = re.compile(r"^(?P<indent> *)\.\. math::(?P<latex>.*(?:\n(?:[ \t]*\n)?(?P=indent) +\S.*)*)", re.MULTILINE)
IN_LINE = re.compile(r":math:`([^`]+)`")
BETWEEN_DOLLARS = re.compile(r"^\$\$(?P<latex>.+?)\$\$$", re.MULTILINE | re.DOTALL)
BEFORE_CODE = 26
"""Priority in Python-Markdown; higher than that of fenced code."""

AFTER_CODE = 185
"""Priority of patterns within a line; lower than that of code, higher than that of escaped characters."""


class Formulas(Preprocessor):
    """Preprocessor that converts the formulas of a page."""

    def run(self, lines: list[str]) -> list[str]:
        """Return the lines of a page with its formulas converted."""
        drawn = FORMULA.sub(
            lambda found: f"{found['indent']}{drawn_formula(self.md, found['latex'], 'block')}\n", "\n".join(lines)
        )
        drawn = BETWEEN_DOLLARS.sub(lambda found: drawn_formula(self.md, found["latex"], "block"), drawn)
        return IN_LINE.sub(lambda found: drawn_formula(self.md, found[1], "inline"), drawn).split("\n")


class InlineFormula(InlineProcessor):
    """Pattern of a formula between dollar signs in a line."""

    def handleMatch(self, m: re.Match[str], data: str) -> tuple[str, int, int]:
        """Return the formula and its place."""
        return drawn_formula(self.md, m[1], "inline"), m.start(), m.end()


def drawn_formula(md: Markdown, latex: str, display: Literal["block", "inline"]) -> str:
    """Return the placeholder of a formula that was converted."""
    known = " ".join(latex.split()).replace(r"\arg", r"\operatorname{arg}\,").replace(r"\_", "_")
    return md.htmlStash.store(convert(known, display=display))


class FormulaExtension(Extension):
    """Markdown extension for formulas."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Register the preprocessor."""
        md.preprocessors.register(Formulas(md), "formulas", BEFORE_CODE)
        md.inlinePatterns.register(InlineFormula(r"\$([^$]+)\$", md), "inline formulas", AFTER_CODE)


def makeExtension() -> FormulaExtension:
    """Return the extension; Python-Markdown calls this."""
    return FormulaExtension()
