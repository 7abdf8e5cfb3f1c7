"""The closest twin holds for other records; its ceiling closes what differs between twin and machine, not bearings."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tests.twingap.gap.search.test_free_spectra import evidence_of
from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.gap import closest
from twingap.gap.closest import ceiling
from twingap.gap.distance.closure import closure_interval, paired
from twingap.gap.held_out import HeldOut
from twingap.gap.knowledge import shipped
from twingap.gap.search.effect_search import Explanation
from twingap.gap.search.evidence import Evidence, simulator_of
from twingap.identification.calibrate import calibrate
from twingap.records import Condition, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec

OWN = PhenomenologicalParameters(2400.0, 0.05, {"inner": 6.0, "outer": 8.0}, 0.7, 0.6, 1.5)
SPEC = TwinSpec("phenomenological", bearing=BEARINGS["6205"])


def ceiling_of(tilts_db: tuple[float, ...], seed: int) -> Any:
    """Of a machine with a hum, and a bearing for each tilt of the path."""
    records = []
    for unit, tilt in enumerate(tilts_db):
        path = make_effect("transfer_path", {"frequencies_hz": (500.0, 4500.0), "gains_db": (-tilt, tilt)})
        conditions = [
            Condition(f"{fault}{unit}{i}", 1500.0 + 30.0 * i, 10000.0, 10000, fault, extra={"bearing_id": f"b{unit}"})
            for fault in ("healthy", "inner", "outer") for i in range(9)
        ]  # fmt: skip
        hum = make_effect("mains_interference", {"level": 0.8})
        rng = np.random.default_rng([seed, unit])
        records += list(PhenomenologicalTwin(BEARINGS["6205"], OWN, (path, hum)).simulate(conditions, rng))
    found = RecordSet.from_records("machine", "m/s^2", BEARINGS["6205"], records)
    calibrated = calibrate(found, SPEC, np.random.default_rng(seed))
    evidence = Evidence(calibrated, simulator_of(calibrated), SPEC, 7)
    bare = SimpleNamespace(simulator=evidence.against().simulator, effects=())
    held_out = HeldOut(evidence, cast(Any, SimpleNamespace(before=bare)))
    return ceiling(held_out, held_out.replicates(bare.simulator, (), 3), 0.0)


@pytest.mark.parametrize("seed", range(2))
def test_records_of_the_same_bearing_close_nearly_all(seed: int) -> None:
    found = ceiling_of((0.0,), seed)
    assert 0.85 < found.same_unit <= 1.0
    assert found.other_unit is None, "there is no other"


def test_records_of_another_bearing_close_less() -> None:
    found = ceiling_of((-5.0, 5.0), 0)
    assert found.other_unit < found.same_unit - 0.2


def test_what_is_farther_from_held_out_records_is_not_the_closest(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search sees the fit part alone: a twin that widens the gap on other records is not handed back."""
    evidence = evidence_of(make_effect("mains_interference", {"level": 0.8}), n=6)
    bare, rng = evidence.against(), np.random.default_rng(0)
    worse = evidence.against((make_effect("coloured_noise", {"level": 4.0}),))
    monkeypatch.setattr(closest, "closest_twin", lambda *given: worse)
    held_out = HeldOut(evidence, Explanation(0.01, True, (), {}, ((),), 0.01, bare, bare, {}))
    before = held_out.replicates(bare.simulator, (), 3)
    pairs = paired(held_out.real, before, before)
    of_named = closure_interval(*pairs, pairs[1].floor(rng)[0], rng)
    found, twin = closest.closest_of(
        held_out, shipped(), before, of_named, (), pairs[0].scale, closest.Ceiling(), rng, lambda what, part: None
    )
    assert twin.effects == () and found.closure == 0 and found.attribution == ()
    assert found.twin == "closest.toml"
