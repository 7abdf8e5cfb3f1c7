"""What paper 3's network reads: the same trials but for the quantity, gains by pairs, a run that goes on."""

from __future__ import annotations

import dataclasses
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from papers.extra.quantities.jobs import METHODS, QUANTITIES, trials
from papers.extra.quantities.study import STUDY, means
from papers.paper3_zoa_dann.comparison.jobs import CONFIG, Cell, Prepared
from papers.paper3_zoa_dann.comparison.jobs import read_options as read_comparison
from papers.paper3_zoa_dann.comparison.task_files import FOLDER, read_task
from papers.paper3_zoa_dann.inputs.options import read_options
from papers.paper3_zoa_dann.source import Recipe
from twingap.adapt import ModeInputs, Windows
from twingap.bearing import BEARINGS

SMALL = """
[profiles.small]
tasks = ["A3", "B1"]
available = ["balanced", "scarce"]
seeds = 1
strict_seeds = 1
noise_seeds = []
snr_db = []
steps = 2
bearings_per_class = 2
records_per_bearing = 1
evaluations = 0
rig_duration_s = 0.3
"""


def test_trials_differ_in_the_quantity_and_in_what_follows_from_it() -> None:
    options, common = read_comparison(), read_options()
    recipe = Recipe(
        1e9, 100.0, 0.5, (1750.0,), 12000.0, BEARINGS["6205"], ("healthy", "inner"), common.source, 2, 1, 2048, 0
    )
    material: Any = None
    ready = Prepared(Cell("balanced", None, (0, 1), ()), material, {}, recipe)
    made = list(trials(ready, read_task("A1"), options, common, 5))
    assert len(made) == len(METHODS) * len(QUANTITIES) * 2
    pairs = [made[i : i + 2] for i in range(0, len(made), 2)]
    for waveforms, spectra in pairs:
        assert waveforms.training.vary and not spectra.training.vary
        assert (waveforms.inputs.quantity, spectra.inputs.quantity) == QUANTITIES
        same = dataclasses.replace(spectra, inputs=waveforms.inputs, training=waveforms.training)
        assert same == waveforms
    assert {bool(trial.recipe.closed) for trial in made if "closed" in trial.method} == {True}
    assert {bool(trial.recipe.closed) for trial in made if "closed" not in trial.method} == {False}


def test_gains_are_by_pairs_of_task_and_seed_in_any_order() -> None:
    rows = [
        {
            "data": "CWRU", "task": task, "method": "Non-DA", "quantity": quantity, "seed": seed,
            "accuracy": base + (0.25 if quantity != "modes" else 0.0), "oracle": 1.0, "source_accuracy": 0.9,
            "seconds": 1.0,
        }
        for base, (task, seed) in zip((0.1, 0.3, 0.5, 0.7), (("A1", 0), ("A1", 1), ("A2", 0), ("A2", 1)), strict=True)
        for quantity in QUANTITIES
    ]  # fmt: skip
    whole = pd.DataFrame(rows)
    told = means(whole)
    spectra = told[told["quantity"] == "envelope_spectrum"].iloc[0]
    assert spectra["gain"] == pytest.approx(0.25)
    assert (spectra["pairs_won"], spectra["pairs"]) == (4, 4)
    assert spectra["p"] == pytest.approx(2 / 16)
    shuffled = means(whole.sample(frac=1, random_state=2)).sort_values("quantity").reset_index(drop=True)
    pd.testing.assert_frame_equal(shuffled, told.sort_values("quantity").reset_index(drop=True))


def test_a_run_without_records_says_so_and_is_taken_up_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    config, tasks = tmp_path / "comparison.toml", tmp_path / "tasks"
    text = CONFIG.read_text(encoding="utf-8")
    for name, small in {"checkpoints": "2", "n_modes": "2", "batch": "4"}.items():
        text = re.sub(rf"(?m)^{name} = \d+", f"{name} = {small}", text)
    config.write_text(text.replace('quantity = "modes"', 'max_iterations = 10\nquantity = "modes"') + SMALL, "utf-8")
    shutil.copytree(FOLDER, tasks)
    task = (tasks / "A3.toml").read_text(encoding="utf-8").replace("= 2048", "= 1024")
    task = re.sub(r"(?m)^(healthy|inner|outer|ball) = \d+", r"\1 = 3", task)
    (tasks / "A3.toml").write_text(task, encoding="utf-8")
    how: dict[str, Any] = {"out": tmp_path, "backend": "sequential", "config": config}
    decomposed: list[str] = []
    plain = ModeInputs._decomposed

    def counted(self: ModeInputs, windows: Windows) -> Any:
        decomposed.append(self.key(windows))
        return plain(self, windows)

    monkeypatch.setattr(ModeInputs, "_decomposed", counted)
    first = STUDY.run("small", **how)
    assert len(set(decomposed)) == len(decomposed) < first.computed, "trials of a cell share the modes of their windows"
    assert not (tmp_path / "modes").exists()
    rows = first.tables["quantities"]
    assert first.missing == ("B1",), "HIT-SM has no stand-in"
    assert first.computed - 1 == len(rows) == len(METHODS) * len(QUANTITIES), "balanced data and all bearings alone"
    assert set(rows["data"]) == {"virtual rig, not CWRU"}
    assert np.isfinite(rows["accuracy"]).all()
    written = (tmp_path / "tables" / "quantities.csv").read_bytes()
    assert STUDY.run("small", **how).computed == 0
    assert (tmp_path / "tables" / "quantities.csv").read_bytes() == written
