"""The frame of all pages: one file, nothing to load, foreign text escaped."""

from matplotlib.figure import Figure

from pdpatrol.missions.report.page import css_string, inline_svg, render
from tests.missions.report.html import Page


def picture(name: str, title: str = "") -> str:
    figure = Figure(figsize=(3, 2))
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1])
    axes.set_title(title)
    return inline_svg(figure, name, "a line")


def test_foreign_text_cannot_leave_the_place_where_it_is_shown() -> None:
    name = '</title><script>alert(1)</script>"; } @import url(http://a.b/c);'
    page = Page(render("base.html", title="Survey", subject=name))
    assert "script" not in page.tags
    assert page.text.count(name) == 2  # head and header; in the style it is escaped
    style = render("base.html", title="Survey", subject=name).split("<style>")[1].split("</style>")[0]
    assert "@import url" not in style


def test_a_css_string_holds_neither_quotes_nor_line_breaks_nor_the_end_of_a_style() -> None:
    assert not set(css_string("a\"b'\n</style>\\é")) & set("\"'\n<>/")


def test_two_pictures_of_a_page_share_no_id_and_each_points_to_its_own() -> None:
    first, second = Page(picture("one")), Page(picture("two"))
    ids = [{a["id"] or "" for _, a in page.elements if a.get("id")} for page in (first, second)]
    assert ids[0]
    assert not ids[0] & ids[1]
    for page, own in zip((first, second), ids, strict=True):
        used = {(a.get("href") or "")[1:] for _, a in page.elements if "href" in a}
        used |= {(a.get("clip-path") or "")[5:-1] for _, a in page.elements if "clip-path" in a}
        assert used <= own


def test_a_picture_is_the_same_each_time_names_no_address_to_load_and_escapes_its_text() -> None:
    assert picture("one", "<b>&") == picture("one", "<b>&")
    assert "b" not in {tag for tag, _ in Page(picture("one", "<b>&")).elements}
    for _, attributes in Page(picture("one")).elements:
        links = [value or "" for key, value in attributes.items() if key in ("src", "href", "xlink:href")]
        assert all(link.startswith("#") for link in links)
