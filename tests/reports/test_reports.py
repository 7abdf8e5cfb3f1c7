"""The pages in reports/: links lead somewhere, every file is shown on a page, tables are those of their files."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[2]
REPORTS = ROOT / "reports"
PAGES = sorted(REPORTS.rglob("*.md"))
MOST_PICTURES = 40
MOST_BYTES = 5_000_000
LARGEST_TABLE = 300_000


def links(page: Path) -> set[str]:
    """Targets of the links and pictures of a page, without addresses of the web."""
    found = re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8"))
    return {target for target in found if not target.startswith(("http://", "https://"))}


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(REPORTS)))
def test_every_link_of_a_page_leads_somewhere(page: Path) -> None:
    for target in links(page):
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        assert there.exists(), target
        assert not anchor or anchor in anchors(there), target


def test_every_file_is_linked_from_a_page_of_its_folder_or_above() -> None:
    linked = {(page.parent / target.partition("#")[0]).resolve() for page in PAGES for target in links(page)}
    files = {path for path in REPORTS.rglob("*") if path.is_file()} - {REPORTS / "README.md"}
    assert {str(path.relative_to(REPORTS)) for path in files - linked} == set()


def test_the_folder_stays_small() -> None:
    files = [path for path in REPORTS.rglob("*") if path.is_file()]
    assert sum(path.suffix == ".png" for path in files) <= MOST_PICTURES
    assert sum(path.stat().st_size for path in files) <= MOST_BYTES, "reports/README.md says how to shrink pictures"
    assert max(path.stat().st_size for path in files if path.suffix == ".csv") <= LARGEST_TABLE


def rows(page: str, first: str) -> list[list[str]]:
    """Cells of the rows of a page's tables that begin with a word, without the word and bold type."""
    text = (REPORTS / page / "README.md").read_text(encoding="utf-8").replace("**", "")
    return [
        [cell.strip() for cell in line.strip("|").split("|")[1:]]
        for line in text.splitlines()
        if line.startswith(f"| {first} |")
    ]


@pytest.mark.parametrize("bearing", ["A148", "A150", "A153", "A154", "A155", "A156", "mean"])
def test_table_5_of_paper_1_is_that_of_its_file(bearing: str) -> None:
    table = pd.read_csv(REPORTS / "paper1" / "table5.csv", dtype=str)
    for _, own in table[table["bearing"] == bearing].iterrows():
        assert own.iloc[3:].to_list() in rows("paper1", bearing)


@pytest.mark.parametrize("method", ["VMD+SVM", "Non-DA", "MMD", "DANN", "DACD", "Proposed", "Orders (ours)"])
def test_table_5_of_paper_3_is_that_of_its_file(method: str) -> None:
    table = pd.read_csv(REPORTS / "paper3" / "comparison-mean.csv")
    clean = table[(table["available"] == "balanced") & (table["noise"] == "no noise added")]
    shown = [row for row in rows("paper3", method) if any("±" in cell for cell in row)]
    assert len(shown) == 1
    for cell, data in ((shown[0][0], "CWRU"), (shown[0][3], "HIT-SM")):
        own = clean[(clean["data"] == data) & (clean["method"] == method)].iloc[0]
        assert cell.startswith(f"{100 * own['accuracy']:.1f} ± {100 * own['accuracy_std']:.1f}")


def values(text: str, heading: str) -> list[str]:
    """Third column of the table below a heading."""
    table = text.partition(f"{heading}\n")[2].partition("\n#")[0]
    lines = [line for line in table.splitlines() if line.startswith("| ")]
    return [line.split("|")[3].strip() for line in lines[1:]]


def test_scores_of_the_gap_diagnosis_are_those_of_the_one_study_here() -> None:
    (study,) = (REPORTS / "gap").glob("study*/study.md")
    known = [float(value) for value in values(study.read_text(encoding="utf-8"), "## Scores against targets")]
    shown = values((REPORTS / "gap" / "README.md").read_text(encoding="utf-8"), "### Scores against targets")
    assert shown
    for cell in shown:
        assert cell in {f"{value:.{len(cell.partition('.')[2])}f}" for value in known}
