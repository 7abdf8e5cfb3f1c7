"""Reports of diagnoses, made by hand; diagnoses with few candidates."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from twingap.effects import Effect, catalogue, registry
from twingap.gap import held_out
from twingap.gap.report.model import (
    Candidate,
    Curve,
    GapReport,
    Metric,
    ParameterValue,
    Place,
    Status,
    TwoSampleTest,
    Verdict,
)

MakeReport = Callable[..., GapReport]
FewEffects = Callable[..., None]


@pytest.fixture(scope="session")
def make_report() -> MakeReport:
    """Makes a full report of a status; the texts in it are hostile to HTML."""
    return _report


@pytest.fixture
def few_effects(monkeypatch: pytest.MonkeyPatch) -> FewEffects:
    """Restricts the candidates of a report to a few effects, for tests of something else."""

    def restrict(*names: str) -> None:
        def few() -> dict[str, type[Effect]]:
            return {name: kind for name, kind in catalogue().items() if name in (*names, *registry.own_effects())}

        monkeypatch.setattr(held_out, "trainable", few)

    return restrict


def _report(status: Status = "explained", records: str = "Prüfstand <b>7</b> & Co </script>") -> GapReport:
    effects = {"explained": ("second_resonance", "slip_jitter"), "partly_explained": ("second_resonance",)}.get(
        status, ()
    )
    rival = ("second_resonance", "speed_fluctuation")
    sets = {"no_gap": ((),), "unexplained": ()}.get(status, (effects, rival))
    frequency = {
        "frequency_hz": ParameterValue(1203.4, "Hz", (1188.0, 1219.0)),
        "damping_ratio": ParameterValue(0.031, "", (0.02, 0.05)),
    }
    return GapReport(
        verdict=Verdict(status, effects, sets, 0.0005 if effects else 0.4, 0.93, (0.86, 0.97)),
        places=()
        if status == "no_gap"
        else (
            Place("condition", None, None, "", 0.1, 0.04, {"fault": "<i>inner</i>", "speed_rpm": 1797.0}),
            Place("frequency", 1010.0, 1400.0, "Hz", 0.6, 0.002),
            Place("envelope_order", 5.2, 5.6, "orders", 0.3, 0.004, {"time_s": [0.0, 10.0]}),
        ),
        candidates=(
            Candidate("clipping", 0.02, 1.9, 1.9, 0.0, (-0.05, 0.04), acts="it saturates <already>"),
            Candidate("sensor_rolloff", 0.5, 1.9, 1.8, 0.05, (-0.4, 0.1), {"order": ParameterValue(3.0)}),
            Candidate("second_resonance", 0.99, 1.9, 0.9, 0.62, (0.55, 0.7), frequency),
            Candidate("slip_jitter", 0.93, 0.9, 0.4, 0.31, (0.2, 0.4), fitted_with=("second_resonance",)),
        ),
        metrics=(
            Metric("log-spectral distance", 4.1, 0.8, 0.6, (0.7, 1.1), unit="dB"),
            Metric("accuracy", 0.61, 0.95, 0.97, (0.9, 0.97), (0.55, 0.66), higher_is_better=True),
            Metric("nothing to close", 0.5, 0.5, 0.5, (0.4, 0.6)),
        ),
        provenance={
            "seed": 3, "version": "0.1.0", "records_sha256": "ab" * 32, "runtime_s": 41.2, "records": records,
            "twin_model": "phenomenological", "twin_effects": ["load_zone"], "n_records": 24, "n_held_out": 16,
        },
        notes=("Nominal <speeds> are used for two records.",),
        calibration={"resonance_hz": ParameterValue(3402.0, "Hz", (3390.0, 3415.0)), "unit_gain": ParameterValue(9.81)},
        rest=(Place("order", 0.9, 1.1, "orders", 0.2, 0.01),) if status == "partly_explained" else (),
        tests=(TwoSampleTest("classifier two-sample test", 0.93, 0.002),),
        curves={
            "spectrum": Curve(
                (100.0, 1200.0, 3400.0), "frequency (Hz)", (-60.0, -40.0, -35.0), (-60.0, math.nan, -35.0),
                (-60.0, -41.0, -35.0), "dB", "Spectrum", "frequency",
                {"real": ((-63.0, -43.0, -38.0), (-57.0, -37.0, -32.0))},
            ),
            "condition": Curve(("<a>", "b"), "condition", (1.0, 1.0), (2.0, 3.0), None, "", "Conditions", "condition"),
        },
    )  # fmt: skip
