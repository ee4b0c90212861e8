"""CITATION.cff and CHANGELOG.md name the version of the project."""

import tomllib

import pytest

from tests.docs.site import ROOT

yaml = pytest.importorskip("yaml", reason="uv run --group docs")


def test_tutorial_and_site_state_the_address_of_the_repository_if_there_is_one() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    address = project.get("urls", {}).get("Repository")
    site = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))["project"]
    tutorial = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    assert site.get("repo_url") == address
    assert (f"git clone {address}" if address else "no public address") in tutorial


def test_citation_and_changelog_name_project_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == project["version"]
    assert citation["license"] == project["license"]
    assert {"cff-version", "message", "title", "authors", "date-released"} <= set(citation)
    heading = f"## {project['version']} - {citation['date-released']}"
    bibtex = (ROOT / "docs" / "reference" / "cite.md").read_text(encoding="utf-8").partition("@article")[0]
    assert f"{{{citation['title']}}}" in bibtex
    assert f"version = {{{project['version']}}}" in bibtex
    assert f"year    = {{{citation['date-released']:%Y}}}" in bibtex
    assert heading in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()
