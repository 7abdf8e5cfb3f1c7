"""Which twin `close` hands back: the closest one of the last gap, unless the last twin is as close."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twingap.gap import closing
from twingap.records import Condition, Record, RecordSet
from twingap.twins.twin_file import Provenance, TwinSpec

SPEC = TwinSpec("phenomenological")
RECORDS = RecordSet.from_records("machine", "g", None, [Record(Condition("r", 1500.0, 1000.0, 4), np.zeros(4))])
HUM = SimpleNamespace(name="mains_interference", parameter_values=lambda: {"level": 1.0})


@dataclass(frozen=True)
class Found:
    """Of a diagnosis, what `close` reads."""

    spec: TwinSpec
    names: tuple[str, ...]
    gap: float
    left: float | None

    @property
    def report(self) -> Any:
        status = "explained" if self.names else "no_gap"
        near = () if self.left is None else (SimpleNamespace(after=self.left),)
        return SimpleNamespace(
            verdict=SimpleNamespace(status=status, effects=self.names, closure=0.5),
            metrics=(SimpleNamespace(before=self.gap, floor=0.1),), closest=SimpleNamespace(metrics=near),
        )  # fmt: skip

    @property
    def explanation(self) -> Any:
        return SimpleNamespace(cannot={}, after=SimpleNamespace(effects=(HUM,)))

    def closest_twin(self) -> TwinSpec:
        return TwinSpec("phenomenological", effects=self.spec.effects, identified=Provenance("", "g"))


@pytest.mark.parametrize(
    ("last", "left", "place", "whole"),
    [
        (1.7, 0.6, 0, 1),  # no gap is called, and the closest twin is far closer
        (1.7, 1.6, 1, 1),  # hardly closer
        (0.15, 0.0, 1, 0),  # at its floor: not sought
    ],
)
def test_the_closest_twin_of_the_last_gap_is_handed_back_where_it_is_closer(
    last: float, left: float, place: int, whole: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    sought = []

    def diagnose(records: RecordSet, spec: TwinSpec, *, quick: bool = False, **given: Any) -> Found:
        if not quick:
            sought.append(spec)
        names, gap = ((), last) if spec.effects else (("mains_interference",), 4.0)
        return Found(spec, names, gap, None if quick else left)

    monkeypatch.setattr(closing, "diagnose", diagnose)
    way = closing.close(RECORDS, SPEC)
    assert way.place == place and len(sought) == whole
    assert way.twin.effects == (() if place == 0 else ("mains_interference",))
    assert way.left == pytest.approx(left if place == 0 else last)
    assert way.closure == pytest.approx((4.0 - way.left) / 3.9) and way.added == (("mains_interference",),)
