"""`twingap data list`: cards as they are typed."""

from __future__ import annotations

import json
from functools import partial

import pytest

from tests.twingap.cli.typed import Run, refused


def test_one_card_in_full(typed: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    twingap = partial(typed, "data", "list")
    said = twingap("cwru")
    assert said.status == 0
    for part in ("BPFO 3.585, BPFI 5.415", "12000, 48000 Hz", "12 ball", "a split by recording leaks", "twingap gap"):
        assert part in said.out
    assert "ims" not in said.out
    (row,) = json.loads(twingap("cwru", "--json").out)
    assert row["card"]["orders"]["bpfo"] == pytest.approx(3.5848, abs=1e-4) and len(row["card"]["traps"]) >= 3
    refused(twingap("nothing"), "no data set 'nothing'", "cwru")


def test_all_cards_in_short(typed: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    said = typed("data", "list")
    assert said.out.count("\n  suits") == 8 and "beware" not in said.out
