"""What paper 2's own twin teaches, with its gap closed and without."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from papers.__main__ import main
from papers.extra.transfer_gap import study
from papers.extra.transfer_gap.jobs import KINDS, Kind, Population, machine_of, simulate
from papers.extra.transfer_gap.study import STUDY, means
from papers.paper2_digital_twin.availability.jobs import read_options
from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.errors import TwingapError
from twingap.twins.contact_parameters import PRESETS

HUM = make_effect("mains_interference", {"level": 2.0, "mains_hz": 60.0})


def population(kind: Kind = "as printed", machines: int = 3) -> Population:
    effects = (HUM,) if kind == "gap closed" else ()
    return Population(
        "made", kind, effects, ("healthy", "inner", "outer", "ball"), (1772.0,), 12000.0, BEARINGS["6205"], machines,
        (1, 3), (0.0, 30.0), (0.2, 0.95), read_options().image, 4,
    )  # fmt: skip


def test_machines_are_the_printed_twin_but_for_noise_and_the_named_effects() -> None:
    plain, closed = (machine_of(population(kind), 1772.0, np.random.default_rng(2)) for kind in KINDS)
    assert plain.parameters == closed.parameters
    noises = {name: getattr(plain.parameters, name) for name in ("structure_noise_rms", "white_noise_rms")}
    assert plain.parameters == dataclasses.replace(PRESETS["paper"], **noises)
    assert HUM in closed.effects and HUM not in plain.effects
    levels = [
        np.hypot(own.structure_noise_rms, own.white_noise_rms)
        for own in (machine_of(population(), 1772.0, np.random.default_rng(k)).parameters for k in range(40))
    ]
    assert 20 < 20 * np.log10(max(levels) / min(levels)) <= 30 + 1e-9


def test_a_machine_has_a_record_of_each_class_and_effects_alone_differ() -> None:
    plain, closed = (simulate(population(kind)) for kind in KINDS)
    assert plain["labels"].tolist() == closed["labels"].tolist() == [0, 0, 1, 1, 2, 2, 3, 3] * 3
    assert plain["machine"].tolist() == [m for m in range(3) for _ in range(8)]
    assert np.isfinite(plain["images"]).all() and plain["images"].shape == closed["images"].shape
    assert not np.allclose(plain["images"], closed["images"])
    again = simulate(population())
    np.testing.assert_array_equal(plain["images"], again["images"])


def test_a_mean_is_over_seeds_and_a_gain_is_of_pairs() -> None:
    rows = [
        {"data": "CWRU", "split by": split, "twin": kind, "seed": seed, "recordings": 39, "accuracy": accuracy,
         "balanced accuracy": accuracy, "on its own machines held out": 0.9}
        for split in ("recording", "bearing")
        for seed, base in enumerate((0.3, 0.5, 0.4, 0.6))
        for kind, accuracy in zip(KINDS, (base, base + 0.1), strict=True)
    ]  # fmt: skip
    found = means(pd.DataFrame(rows)).set_index(["split by", "twin"])
    closed = found.loc["recording", "gap closed"]
    assert closed["gain"] == pytest.approx(0.1) and closed["p"] == pytest.approx(2 / 16)
    assert found.loc["recording", "as printed"]["accuracy"] == pytest.approx(0.45)
    assert np.isnan(found.loc["bearing", "as printed"]["gain"])


def test_every_named_effect_can_be_had_by_the_twin() -> None:
    options = STUDY.read()
    assert set(options.named) == set(options.data)
    for name, effects in options.named.items():
        own = dataclasses.replace(
            population(), data=name, effects=tuple(make_effect(n, values) for n, values in effects.items()),
            fs_hz={"cwru": 12000.0, "hit_sm": 12800.0}[name],
        )  # fmt: skip
        assert np.isfinite(simulate(dataclasses.replace(own, machines=1))["images"]).all()


def test_records_that_cannot_be_read_are_not_taken_for_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cwru").mkdir()
    (tmp_path / "cwru" / "105.mat").write_bytes(b"cut short")
    monkeypatch.setenv("TWINGAP_DATA", str(tmp_path))
    with pytest.raises(TwingapError, match=r"105\.mat"):
        STUDY.run(out=tmp_path / "out", backend="sequential")


def test_a_run_without_records_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    config, text = tmp_path / "config.toml", STUDY.config.read_text(encoding="utf-8")
    for name, least in {"machines = 12": "machines = 4", "steps = 40": "steps = 4", "_s = 4.0": "_s = 2.0"}.items():
        assert text.count(name) == 1
        text = text.replace(name, least)
    config.write_text(text, encoding="utf-8")
    monkeypatch.setattr(study, "STUDY", dataclasses.replace(STUDY, config=config))
    main(["extra.transfer_gap", "--out", str(tmp_path), "--backend", "sequential", "--no-track"])
    assert "virtual rig" in capsys.readouterr().out
    table = pd.read_csv(tmp_path / "tables" / "transfer-gap.csv")
    assert table["twin"].tolist() == [*KINDS, *KINDS] and table["accuracy"].between(0, 1).all()
