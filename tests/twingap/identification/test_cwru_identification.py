"""Identification on the real CWRU records."""

from __future__ import annotations

import os

import pytest

from twingap.identification import identify
from twingap.twins.twin_file import TwinSpec

pytestmark = [
    pytest.mark.data,
    pytest.mark.skipif("TWINGAP_DATA" not in os.environ, reason="TWINGAP_DATA names no data root"),
]


@pytest.mark.parametrize("load_hp", [0, 2])
def test_the_mode_that_faults_excite_is_found_at_both_loads(load_hp: int) -> None:
    """The drive end rings between 2.5 and 4 kHz whatever the fault; healthy spectra are mostly shaft harmonics."""
    from twingap.data import load

    records = load("cwru", fs_hz=12000.0).select(lambda c: c.extra["load_hp"] == load_hp)
    found = identify(records, TwinSpec("phenomenological"))
    assert 2800 < found.estimates["resonance_hz"].value < 3500
    assert 0.02 < found.estimates["damping_ratio"].value < 0.12
    assert any("not one mode" in note for note in found.notes)
    amplitudes = {f: found.estimates[f"impact_amplitude.{f}"].value for f in ("inner", "outer", "ball")}
    assert amplitudes["outer"] > amplitudes["inner"] > amplitudes["ball"] > 0
