"""Generated pages hold what they are generated from; files that pages show can be read."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from site_pages import data_cards, effect_pages, gap_file, links, markdown, python_pages, signatures, validation

from twingap.data import card_of, manifest_names, manifest_of
from twingap.effects import catalogue, load_effects, make_effect
from twingap.effects.by_state import State, of_state
from twingap.gap.report.schema import schema
from twingap.records.folder import read_description
from twingap.records.table import COLUMNS
from twingap.twins.twin_file import read_twin

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize("name", catalogue())
def test_an_effects_page_has_its_parameters_look_alikes_and_a_figure_that_shows_it(name: str) -> None:
    kind = catalogue()[name]
    shown = signatures.signature(kind)
    assert shown.change >= signatures.VISIBLE, "with and without look the same"
    page = effect_pages.page(name, kind, shown)
    for field in (*kind.parameters(), *kind.profiles()):
        about = field.metadata
        words = f"| `{field.name}` | {markdown.cell(markdown.safe(about['doc']))} | {about['unit']} |"
        assert words in page and f"`{field.name}` " in signatures.caption(shown, shown.effect.parameter_values())
    assert ("{term}`attribution`" in page) is (not kind.trained)
    for other in kind.look_alikes:
        assert f"[{other}]({other}.md)" in page
    assert all(markdown.safe(reference) in page for reference in kind.references)


def test_the_catalogue_lists_every_effect() -> None:
    page = effect_pages.overview()
    assert all(page.count(f"[{name}](effects/{name}.md)") == 1 for name in catalogue())
    stages = re.findall(r"^## (.*)$", page, re.MULTILINE)
    assert stages == list(effect_pages.STAGES.values())


def test_a_signature_is_of_one_record_twice() -> None:
    shown = signatures.signature(catalogue()["clipping"])
    rail = np.abs(shown.with_it).max()
    inside = np.abs(shown.without) < rail
    assert np.array_equal(shown.without[inside], shown.with_it[inside])
    assert not inside.all()


def test_every_key_of_the_schema_is_on_the_page_of_gap_json() -> None:
    page = gap_file.pages(DOCS)["reference/gap-json.md"]
    for name, part in schema()["properties"].items():
        assert f"| `{name}` |" in page
        for inner in part.get("properties", {}):
            assert f"| `{name}.{inner}` |" in page


def test_every_data_set_has_a_card() -> None:
    page = data_cards.pages(DOCS)["reference/data-sets.md"]
    assert re.findall(r"^## (\w+)$", page, re.MULTILINE) == list(manifest_names())
    assert all(markdown.safe(trap) in page for name in manifest_names() for trap in card_of(manifest_of(name)).traps)


def test_every_public_name_is_on_one_page() -> None:
    pages = python_pages.pages(DOCS)
    documented = re.findall(r"auto(?:class|function):: (\S+)", "".join(pages.values()))
    assert len(set(documented)) == len(documented)
    assert {"twingap.diagnose", "twingap.effects.Effect", "twingap.gap.GapReport"} <= set(documented)


def test_validation_shows_the_numbers_of_the_latest_study(tmp_path: Path) -> None:
    text = (
        "# Study\n\n12 worlds, seed 3; frozen.\n\n## Scores against targets\n\n"
        "| score | among | value | 95 % interval | n | target | met |\n|---|---|---|---|---|---|---|\n"
        "| recall | crowd | 0.75 | 0.5 to 0.9 | 12 | at least 0.7 | yes |\n"
        "| runtime, s | all | 78.6 |  | 12 | at most 60 | **no** |\n"
    )
    for number, value in ((9, "0.11"), (10, "0.75")):
        folder = tmp_path / "gap" / f"study{number}"
        folder.mkdir(parents=True)
        (folder / "study.md").write_text(text.replace("0.75", value), encoding="utf-8")
    path = validation.current_study(tmp_path)
    assert path.parent.name == "study10"
    tables = validation.read_tables(path)
    page = validation.page(tables, "study.md")
    assert "12 machines" in page and "| recall | crowd | 0.75 | 0.5 to 0.9 | 12 |" in page
    assert [validation.drawn(row) for row in tables["Scores against targets"]] == [(0.75, 0.5, 0.9), None]
    validation.draw(tables["Scores against targets"], tmp_path / "scores.png")
    assert (tmp_path / "scores.png").stat().st_size > 1000


def test_the_current_study_is_there_and_has_every_kind_of_table() -> None:
    tables = validation.read_tables(validation.current_study(DOCS.parent / "reports"))
    assert {"Scores against targets", "Statuses by kind of world", "By effect"} <= tables.keys()


def blocks(page: str, language: str) -> list[str]:
    """Blocks of code on a page."""
    return re.findall(rf"```{language}\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL)


def test_twin_files_on_pages_can_be_read(tmp_path: Path) -> None:
    whole, of_units = blocks("reference/twin-file.md", "toml")
    (tmp_path / "twin.toml").write_text(whole, encoding="utf-8")
    assert read_twin(tmp_path / "twin.toml").parameters["load_zone"]["depth"] == 0.8
    twin = '[twin]\nmodel = "phenomenological"\neffects = ["impact_scatter"]\n'
    (tmp_path / "units.toml").write_text(twin + of_units, encoding="utf-8")
    scatter = make_effect("impact_scatter", read_twin(tmp_path / "units.toml").parameters["impact_scatter"])
    assert of_state(scatter, State("outer", "OR021")) == make_effect("impact_scatter", {"sigma": 0.3})


@pytest.mark.parametrize("page", ["reference/record-set.md", "how-to/bring-your-records.md"])
def test_descriptions_of_record_sets_on_pages_can_be_read(page: str, tmp_path: Path) -> None:
    (tmp_path / "recordset.toml").write_text(blocks(page, "toml")[0], encoding="utf-8")
    about = read_description(tmp_path)
    assert about.bearing is not None and about.recordset.fs_hz == 12000


def test_the_page_of_record_sets_has_every_column() -> None:
    text = (DOCS / "reference/record-set.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE) == list(COLUMNS)


def test_the_effect_of_the_how_to_is_one() -> None:
    from twingap.effects import registry

    before = registry.own_effects()
    try:
        assert load_effects(DOCS / "how-to/my_effects.py") == ("soft_knee",)
    finally:
        registry.replace_own(before)


def test_settings_of_the_gallery_name_every_tutorial() -> None:
    from site_pages.tutorials import ORDER

    assert sorted(ORDER) == sorted(path.name for path in (DOCS / "gallery").glob("*.py"))


def test_markup_in_text_is_shown_as_typed() -> None:
    assert markdown.safe("a * b `c * d` <e>") == "a \\* b `c * d` \\<e>"
    assert json.loads(json.dumps(markdown.cell("a|b\nc"))) == "a\\|b c"


def test_files_that_the_guide_for_contributors_names_exist() -> None:
    root = DOCS.parent
    text = (root / "CONTRIBUTING.md").read_text(encoding="utf-8")
    found = re.findall(r"`((?:shared|papers|tests|docs|data_manifests)/[^`]*)`", text)
    named = [path for path in found if "NAME" not in path]
    missing = [path for path in named if not (root / path).exists() and "my_effect" not in path]
    assert named and not missing


PAGES = sorted(path.relative_to(DOCS).as_posix() for path in DOCS.glob("**/*.md"))
BUILT = [line.strip("/") for line in (DOCS / ".gitignore").read_text(encoding="utf-8").splitlines()[1:]]
TYPED = [name for name in PAGES if not name.startswith(tuple(BUILT))]


@pytest.mark.parametrize("name", TYPED)
def test_links_lead_to_something_in_the_repository_itself(name: str) -> None:
    page = DOCS / name
    for target in links.LINK.findall(page.read_text(encoding="utf-8")):
        if "://" in target:
            continue
        place = (page.parent / target).resolve()
        assert place.exists(), f"{name} links to {target}"
        inside = place.relative_to(DOCS).as_posix() if place.is_relative_to(DOCS) else ""
        assert not inside or not inside.startswith(tuple(BUILT)), f"{name} links to {target}, which a build makes"


def test_links_to_sources_become_links_to_generated_pages() -> None:
    text = "[a](../gallery/close_a_gap.py), [b](../../reports/gap/README.md#scores), [c](../glossary.md), [d](#e)"
    assert links.to_pages(text, "how-to/page") == (
        "[a](../tutorials/close_a_gap), [b](../explanation/validation.md#scores), [c](../glossary.md), [d](#e)"
    )
    assert links.to_pages("[a](gallery/close_a_gap.py)", "index") == "[a](tutorials/close_a_gap)"
    for source, page in links.PAGE_OF.items():
        assert (DOCS / source).exists() and (page in TYPED or page.startswith(tuple(BUILT)))
