"""Data cards: every set has one, and what it says follows from its manifest."""

from __future__ import annotations

import pytest

from twingap.cli import app
from twingap.data import card_of, manifest_names, manifest_of

COMMANDS = {command.name for command in app.registered_commands}


@pytest.mark.parametrize("name", manifest_names())
def test_every_data_set_has_a_card(name: str) -> None:
    card = card_of(manifest_of(name))
    for text in (card.channels, card.loads, card.labels):
        assert len(text) > 10
    assert len(card.traps) >= 2
    assert set(card.suits) <= COMMANDS and card.suits
    assert card.recordings == len(manifest_of(name).recordings)
    assert ("rul" in card.suits) == any("end_fault" in r or "n_snapshots" in r for r in manifest_of(name).recordings)
    assert dict(card.rows())["orders"].startswith(f"BPFO {card.bearing.bpfo:.4g}")
