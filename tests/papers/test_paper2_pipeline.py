"""Paper 2's pipeline: nested runs, headlines, resuming; shown on the study that takes seconds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from papers.paper2_digital_twin import pipeline
from papers.paper2_digital_twin.pipeline import STUDIES, headlines, run
from twingap.errors import TwingapError
from twingap.track import FolderTracker


def test_one_study_whole_is_tracked_resumed_and_gives_headlines(tmp_path: Path) -> None:
    """Dynamics takes seconds; the others have tests of their own."""
    said: list[str] = []
    given: dict[str, Any] = {
        "out": tmp_path / "out", "backend": "sequential", "tracker": FolderTracker(tmp_path / "runs"), "draw": False,
        "only": ("dynamics",),
    }  # fmt: skip
    outcome = run("smoke", progress=lambda what, done, total: said.append(f"{what} {done} of {total}"), **given)
    assert said[-1] == "dynamics 8 of 8" and outcome.missing == ()
    assert {row["table"] for row in outcome.rows} == set(STUDIES["dynamics"])
    assert {row["study"] for row in outcome.rows} == {"dynamics"}
    assert [len(rows) for rows in outcome.shown().values()] == [2, 6]
    for rows in outcome.shown().values():
        assert len({tuple(row) for row in rows}) == 1, "rows of one table have the same columns"
    (inside,) = (tmp_path / "runs").glob("000-paper2*/runs/000-dynamics")
    assert (inside / "tables" / "dynamics-balance.csv").is_file()
    parameters = json.loads((inside / "parameters.json").read_text(encoding="utf-8"))
    assert "profiles.smoke.speeds_rpm" in parameters and "profiles.full.speeds_rpm" not in parameters
    again = run("smoke", **given)
    assert not any(r.why for r in again.studies["dynamics"].healthy)
    assert again.rows == outcome.rows


def test_every_study_that_is_there_has_what_the_pipeline_calls() -> None:
    import inspect

    wanted = {"out", "root", "seed", "backend", "address", "log", "progress", "draw"}
    for name in STUDIES:
        module = pipeline._module(name)
        if module is not None:
            assert wanted <= set(inspect.signature(module.run).parameters), name
            settings = pipeline._settings(Path(module.CONFIG), "smoke")
            assert settings["profiles"]["smoke"] and list(settings["profiles"]) == ["smoke"], name


def test_headlines_name_study_and_table_and_fall_back_to_the_first() -> None:
    tables = {"live-other": pd.DataFrame([{"a": 1}]), "live-targets": pd.DataFrame([{"met": True}, {"met": False}])}
    assert headlines("live", tables) == [
        {"study": "live", "table": "live-targets", "met": True},
        {"study": "live", "table": "live-targets", "met": False},
    ]
    del tables["live-targets"]
    assert headlines("live", tables) == [{"study": "live", "table": "live-other", "a": 1}]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"profile": "huge"}, "unknown profile 'huge'; use one of smoke, full"),
        ({"only": ("fate",)}, "unknown study 'fate'"),
        ({"backend": "slurm"}, "unknown backend 'slurm'"),
    ],
)
def test_wrong_input_is_one_line(tmp_path: Path, options: dict[str, Any], said: str) -> None:
    with pytest.raises(TwingapError, match=said):
        run(**{"out": tmp_path, **options})
