"""Ten questions of newcomers are answered within two clicks of the first page."""

import re
import tomllib
from typing import NamedTuple

import pytest

from dirmusic import ESTIMATORS
from pdpatrol.missions.policies.make_policy import BUILT_IN
from tests.docs.site import ROOT

DOCS = ROOT / "docs"
MENU = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))["project"]["nav"]


class Answer(NamedTuple):
    """Place that answers a question: its page, its anchor (empty for the top) and its heading."""

    page: str
    anchor: str
    heading: str


QUESTIONS = {
    "which equipment kinds": Answer("how-to/equipment.md", "all-kinds", "All kinds"),
    "all keys of [receiver]": Answer("reference/scenario_keys.md", "receiver", "`[receiver]`"),
    "how accurate": Answer("answers.md", "how-accurate-is-it", "How accurate is it?"),
    "my antenna": Answer("how-to/antenna.md", "", "Use your own array"),
    "my yard": Answer("how-to/yard.md", "", "Build your own yard"),
    "my data": Answer("how-to/locate.md", "", "Use your own data"),
    "a policy trained, run and watched": Answer(
        "how-to/training.md", "run-and-watch-the-trained-policy", "Run and watch the trained policy"
    ),
    "severity rule": Answer("schemas/report.md", "severity", "Severity"),
    "cite": Answer("reference/cite.md", "", "How to cite"),
    "what is not modelled": Answer("explanation/physics.md", "what-is-not-modelled", "What is not modelled"),
}


def text_of(page: str) -> str:
    """Return the text of a page with the files that it includes."""
    included = r'^--8<-- "([^":]+\.md)"$'
    text = (DOCS / page).read_text(encoding="utf-8")
    return re.sub(included, lambda found: (ROOT / found[1]).read_text(encoding="utf-8"), text, flags=re.MULTILINE)


def links_of(page: str) -> set[tuple[str, str]]:
    """Return the pages and anchors to which a page links."""
    found = re.findall(r"\]\(([^)#:]*\.md)?(?:#([\w-]+))?\)", text_of(page))
    places = [
        ((DOCS / page).parent / path if path else DOCS / page, anchor) for path, anchor in found if path or anchor
    ]
    return {(path.resolve().relative_to(DOCS).as_posix(), anchor) for path, anchor in places if path.exists()}


def headings_of(page: str) -> dict[str, str]:
    """Return the headings of a page by their anchors; the first is also that of the top."""
    found = re.findall(r"^#+ (.*?)(?: \{ #([\w-]+) \})?$", text_of(page), flags=re.MULTILINE)
    named = {anchor or re.sub(r"[^\w]+", "-", title.lower()).strip("-"): title for title, anchor in found}
    return {"": found[0][0]} | named


@pytest.mark.parametrize("question", QUESTIONS)
def test_question_is_answered_within_two_clicks(question: str) -> None:
    page, anchor, heading = QUESTIONS[question]
    first = links_of("index.md")
    within_two = first.union(*(links_of(other) for other, _ in first))
    assert (page, anchor) in within_two
    assert headings_of(page)[anchor].startswith(heading)


def test_menu_names_each_page_by_its_heading() -> None:
    """The heading may continue after a colon; the first page has the name of the project."""
    entries = [
        item for each in MENU for value in each.values() for item in (value if isinstance(value, list) else [each])
    ]
    pages = {page: name for entry in entries for name, page in entry.items() if page != "index.md"}
    assert len(pages) > 30
    assert {page: headings_of(page)[""].split(":")[0] for page in pages} == pages


def test_every_link_of_the_first_page_has_its_heading() -> None:
    assert [link for link in links_of("index.md") if link[1] not in headings_of(link[0])] == []
    assert (DOCS / "index.md").read_text(encoding="utf-8").count("](") > 15


@pytest.mark.parametrize(
    ("file", "estimator", "policy"),
    [
        ("README.md", r"`\[estimator\] method`", "`--policy`"),
        ("docs/index.md", "bearing estimator", "policy"),
    ],
)
def test_tables_of_parts_list_all_that_are_built_in(file: str, estimator: str, policy: str) -> None:
    text = (ROOT / file).read_text(encoding="utf-8")
    for part, built_in in ((estimator, ESTIMATORS), (policy, BUILT_IN)):
        (cell,) = re.findall(rf"^\| {part} \| (.*?) \|", text, flags=re.MULTILINE)
        assert set(built_in) <= set(re.findall(r"`([\w.]+)`", cell))
