"""Fleets made by hand: their page, table and order."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest

from twingap.fleet import Fleet, Machine, write_fleet
from twingap.fleet.page import page
from twingap.fleet.summary import NOT_DIAGNOSED, fleet_of

ABOUT = {
    "folder": "<b>Werk</b>", "twin": "twin.toml", "twin_model": "phenomenological", "twin_effects": [], "seed": 0,
    "quick": False, "version": "0.1.0", "learnt_sha256": "ab",
}  # fmt: skip


def machine(path: str, gap: float = 3.0, **probability: float) -> Machine:
    """A machine whose named effects are those that are more probable than 0.7."""
    named = tuple(name for name, p in probability.items() if p > 0.7)
    status = "explained" if named else "no_gap"
    every = {"clipping": 0.01, "looseness": 0.02, "slip_jitter": 0.05} | probability
    return Machine(
        path, status, "", named, "", 0.01, "p = 0.01", gap, 1.2 if named else gap, 1.0, 0.9 if named else None,
        (0.5, 1.1) if named else None, 0.95, (0.6, 1.0), {"shaft": 0.3} if named else {}, every, n_records=8,
        records_sha256="cd",
    )  # fmt: skip


@pytest.fixture(scope="module")
def fleet() -> Fleet:
    rows = [machine(f"Halle {i}/Pumpe #{i}", slip_jitter=0.95) for i in range(5)]
    weak = machine("weak", slip_jitter=0.4)
    other = machine('odd "one" <i>', 12.0, looseness=0.99)
    bad = Machine("bad", NOT_DIAGNOSED, "bad/records.csv: row 3 <x>: speed is missing")
    return fleet_of([bad, *rows, weak, other], ABOUT)


def test_outliers_come_first_and_what_is_not_diagnosed_last(fleet: Fleet) -> None:
    paths = [m.path for m in fleet.machines]
    assert paths[:2] == ['odd "one" <i>', "weak"] and paths[-1] == "bad"
    first = fleet.machines[0]
    # |0.99 - 0.02| looseness, |0.05 - 0.95| slip jitter, and two doublings of the gap.
    assert first.difference == pytest.approx(0.97 + 0.9 + 2)
    assert fleet.machines[2].difference == 0
    assert fleet.statuses == {"unexplained": 0, "partly_explained": 0, "explained": 6, "no_gap": 1, NOT_DIAGNOSED: 1}


def test_the_fleet_sharpens_a_weak_machine(fleet: Fleet) -> None:
    weak = next(m for m in fleet.machines if m.path == "weak")
    assert weak.with_fleet["slip_jitter"] > 0.8 > weak.probability["slip_jitter"]
    assert weak.with_fleet["clipping"] < weak.probability["clipping"]
    odd = fleet.machines[0]
    assert odd.with_fleet["looseness"] < odd.probability["looseness"]
    assert fleet.groups == (("shaft", 6, 7, pytest.approx(0.3 * 6 / 7)),)
    assert fleet.effects[0].effect == "slip_jitter" and (fleet.effects[0].named, fleet.effects[0].of) == (5, 7)


class _Read(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.rows: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag == "a" and given.get("href"):
            self.links.append(str(given["href"]))
        if tag == "tr" and given.get("data-name"):
            self.rows.append(str(given["data-name"]))


def test_the_page_has_a_linked_row_for_each_machine_and_asks_the_network_for_nothing(fleet: Fleet) -> None:
    text = page(fleet)
    read = _Read()
    read.feed(text)
    assert read.rows == [m.path for m in fleet.machines]
    reports = {unquote(link) for link in read.links if "report.html" in link}
    assert reports == {f"{m.path}/report.html" for m in fleet.diagnosed}
    assert not [link for link in read.links if "#" in link and not link.startswith("#")]
    assert "<b>Werk" not in text and "row 3 &lt;x&gt;: speed is missing" in text
    assert "http" not in text.replace("http-equiv", "") and not re.search(r"\bsrc=", text)
    assert "The twin differs from 6 of 7 machines." in text
    assert "slip jitter, for 5 of 7" in text
    assert "<td>shaft</td>" in text and "closest twin 95" in text


def test_one_machine_without_a_gap_has_a_page(tmp_path: Path) -> None:
    alone = fleet_of([machine("only")], ABOUT)
    for path in write_fleet(alone, tmp_path):
        assert path.stat().st_size > 100
    assert "1 machine cannot be distinguished from the twin." in page(alone)
    two = fleet_of([machine("a", clipping=0.9), machine("b", looseness=0.9)], ABOUT)
    assert "No effect is named for more than one of them." in page(two)
    assert alone.machines[0].with_fleet == pytest.approx(alone.machines[0].probability, rel=1e-3)
