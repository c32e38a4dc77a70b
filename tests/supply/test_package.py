"""What is published says what it is: licence, authors, versions, places; the container is built as the checks are."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

import aqualog

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
# keys that CFF 1.2.0 requires, and the kinds of references that it knows and that may stand here
OF_A_REFERENCE = {"authors", "title", "type"}


def test_licence_is_mit():
    text = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert text.startswith("MIT License\n")
    assert "Copyright (c) 2026 the aqualog authors" in text
    assert PROJECT["license"] == CITATION["license"] == "MIT"
    assert not [c for c in PROJECT["classifiers"] if c.startswith("License ::")]


def test_licence_of_the_package_is_that_of_the_list():
    """LICENCES.md quotes it."""

    def words(text):
        return " ".join(re.sub(r"^> ?", "", text, flags=re.MULTILINE).split())

    permission = words((ROOT / "LICENSE").read_text(encoding="utf-8")).partition("Permission")[2]
    assert permission in words((ROOT / "aqualog" / "LICENCES.md").read_text(encoding="utf-8"))


def test_version_stands_in_one_place():
    assert "version" not in PROJECT
    assert "version" not in CITATION
    assert re.fullmatch(r"\d+\.\d+\.\d+", aqualog.__version__)


def test_citation_has_what_the_format_requires():
    assert CITATION["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= set(CITATION)
    assert CITATION["type"] == "software"
    for author in CITATION["authors"]:
        assert set(author) <= {"name", "family-names", "given-names", "website"}
    assert CITATION["repository-code"] == PROJECT["urls"]["Homepage"]


@pytest.mark.parametrize("reference", CITATION["references"], ids=lambda r: r["title"][:20])
def test_reference_has_what_the_format_requires(reference):
    assert set(reference) >= OF_A_REFERENCE
    assert re.fullmatch(r"\d{4}(-\d\d-\d\d)?", str(reference.get("date-published", reference["year"])))


def test_dissertation_is_cited_as_in_the_sources():
    sources = tomllib.loads((ROOT / "aqualog" / "docs" / "sources.toml").read_text(encoding="utf-8"))["sources"]
    thesis = sources["fichtinger2024"]
    (cited,) = (r for r in CITATION["references"] if r["type"] == "thesis")
    assert (cited["title"], cited["year"]) == (thesis["title"], thesis["year"])


def test_pythons_are_those_of_the_classifiers():
    least, most = map(int, re.fullmatch(r">=3\.(\d+),<3\.(\d+)", PROJECT["requires-python"]).groups())
    told = {c.split(" :: ")[-1] for c in PROJECT["classifiers"] if "Python :: 3." in c}
    assert told == {f"3.{minor}" for minor in range(least, most)}
    assert f"for minor in {' '.join(map(str, reversed(range(least, most))))};" in (ROOT / ".ci" / "package").read_text()


@pytest.mark.parametrize("name", ["asammdf", "mcap", "numba", "rosbags", "typer"])
def test_libraries_whose_private_parts_are_used_have_a_ceiling(name):
    (wanted,) = (d for d in PROJECT["dependencies"] if re.match(rf"{name}\b(?!-)", d))
    assert "<" in wanted


def steps(path):
    """Scripts of `.ci` that a file runs, with what they are given."""
    return re.findall(r"^(?:RUN |beside \w+ )?(\.ci/\w+) ", (ROOT / path).read_text(encoding="utf-8"), re.MULTILINE)


def test_container_is_built_by_the_steps_of_the_checks():
    ours = steps("Containerfile")
    assert ours == [".ci/install", ".ci/sample"]
    assert [s for s in steps(".ci/run") if s in ours] == ours
    for script in ours:
        assert (ROOT / script).stat().st_mode & 0o111
    other = [line for line in (ROOT / "Containerfile").read_text().splitlines() if line.startswith("RUN")]
    assert len(other) == len(ours) + 1, "what the checks do not do: only the user"


def test_container_has_a_python_that_the_package_runs_on():
    minor = int(re.search(r"^FROM \S+python:3\.(\d+)-slim$", (ROOT / "Containerfile").read_text(), re.MULTILINE)[1])
    assert f"Programming Language :: Python :: 3.{minor}" in PROJECT["classifiers"]
