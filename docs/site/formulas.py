"""Formulas of pages and docstrings as MathML, which a browser draws without a script.

A formula begins with `.. math::`, as in the docstrings, and goes on over the lines that are indented deeper.
"""

import re

from latex2mathml.converter import convert
from markdown import Markdown
from markdown.extensions import Extension
from markdown.preprocessors import Preprocessor

FORMULA = re.compile(r"^(?P<indent> *)\.\. math::(?P<latex>.*(?:\n(?:[ \t]*\n)?(?P=indent) +\S.*)*)", re.MULTILINE)
BEFORE_CODE = 26
"""Python-Markdown's priority for what comes before fenced code."""


class Formulas(Preprocessor):
    """Draws what stands after `.. math::`."""

    def run(self, lines: list[str]) -> list[str]:
        """The lines of a page, its formulas drawn."""
        return FORMULA.sub(self._drawn, "\n".join(lines)).split("\n")

    def _drawn(self, found: re.Match[str]) -> str:
        latex = " ".join(found["latex"].split()).replace(r"\arg", r"\operatorname{arg}\,")
        formula = convert(latex, display="block")
        return f"{found['indent']}{self.md.htmlStash.store(formula)}\n"


class FormulaExtension(Extension):
    """Formulas in Markdown."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Register what draws formulas."""
        md.preprocessors.register(Formulas(md), "formulas", BEFORE_CODE)


def makeExtension() -> FormulaExtension:
    """The extension, for Python-Markdown."""
    return FormulaExtension()
