"""`twingap effects`: the list, and every effect in full."""

from __future__ import annotations

import json

import pytest

from tests.twingap.cli.typed import Run, refused
from twingap.effects import catalogue


def test_the_list_has_every_effect(typed: Run) -> None:
    said = typed("effects", "--json")
    assert said.status == 0
    assert [about["effect"] for about in json.loads(said.out)] == list(catalogue())
    assert "transfer_path" in typed("effects").out


@pytest.mark.parametrize("name", ["clipping", "transfer_path", "line_spectrum"])
def test_an_effect_is_described_with_its_parameters_and_lists(typed: Run, name: str) -> None:
    kind = catalogue()[name]
    said = typed("effects", name)
    assert said.status == 0
    assert ("part of the closest twin" in said.out) is (not kind.trained)
    about = {one["name"]: one for one in json.loads(typed("effects", name, "--json").out)["parameters"]}
    assert about.keys() == {field.name for field in (*kind.parameters(), *kind.profiles())}
    for field in kind.profiles():
        assert about[field.name]["default"] == list(field.default) and about[field.name]["plausible"] == []


def test_an_unknown_effect_is_refused(typed: Run) -> None:
    refused(typed("effects", "frob"), "unknown effect 'frob'", "clipping")
