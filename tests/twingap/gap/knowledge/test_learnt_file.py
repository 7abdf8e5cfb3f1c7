"""Files of what was learnt: read back as written, matched by name, refused when they do not fit."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from twingap.effects import trainable
from twingap.errors import TwingapError
from twingap.gap.knowledge.learn import Examples, learn
from twingap.gap.knowledge.learnt import Learnt
from twingap.gap.knowledge.learnt_file import definition, read_learnt, write_learnt
from twingap.gap.knowledge.score_calibration import ScoreCalibration

EFFECTS = ("clipping", "quantisation")
ROUNDING = 5e-3
"""Largest change of log odds and values by the rounding of leaves."""
RANK = 0.02
"""Largest change of p-values: their ranks are among a few hundred scores, some of which change places."""
NAMES = (*(f"context|records{k}" for k in range(30)), *(f"converter.rail_{k}|all.level" for k in range(30)))


@pytest.fixture(scope="module")
def features() -> np.ndarray:
    rng = np.random.default_rng(0)
    made = rng.standard_normal((500, len(NAMES))).astype(np.float32)
    made[rng.random(made.shape) < 0.03] = np.nan
    return made


@pytest.fixture(scope="module")
def small(features: np.ndarray) -> Learnt:
    n, rng = len(features), np.random.default_rng(1)
    known = np.nan_to_num(features)
    missing = np.stack([known[:, 33] > 0.8, known[:, 7] + 0.3 * rng.standard_normal(n) > 1.0], axis=1)
    values = np.where(missing[:, :1], 2.0 * known[:, 41:42] + 0.2 * rng.standard_normal((n, 1)), np.nan)
    nothing, first = np.zeros(n, bool), rng.random(n) < 0.8
    examples = Examples(features, missing, np.zeros_like(missing), nothing, np.arange(n), first, values, features)
    learnt = learn(examples, EFFECTS, (("clipping", "rail"),), NAMES, lambda what, part: None)
    learnt.calibration = ScoreCalibration(np.linspace(-1, 1, 9), 0.3, 0.7)
    return learnt


def test_what_is_read_back_predicts_as_what_was_written(small: Learnt, features: np.ndarray, tmp_path: Path) -> None:
    write_learnt(small, tmp_path)
    again = read_learnt(tmp_path, NAMES)
    assert again.outdated == frozenset()
    for later in (False, True):
        np.testing.assert_allclose(
            again.log_odds(features, later=later), small.log_odds(features, later=later), atol=ROUNDING
        )
    for row in features[:40]:
        assert again.p_value(row) == pytest.approx(small.p_value(row), abs=RANK)
        assert again.rest_p(row, ("clipping",)) == pytest.approx(small.rest_p(row, ("clipping",)), abs=RANK)
    one, other = (of.estimators["clipping", "rail"] for of in (small, again))
    np.testing.assert_allclose(other.estimate(features), one.estimate(features), atol=ROUNDING)
    np.testing.assert_allclose(other.within(features), one.within(features), rtol=ROUNDING)
    assert again.calibration is not None
    assert again.calibration.named_from == 0.7
    assert again.thresholds == small.thresholds


def test_leaves_are_rounded_and_thresholds_are_not(small: Learnt, tmp_path: Path) -> None:
    _, data = write_learnt(small, tmp_path)
    models = small.any_gap.models  # whose nodes are the last of the file
    values, leaf = (np.concatenate([getattr(model, name) for model in models]) for name in ("value", "is_leaf"))
    with np.load(data) as stored:
        written = stored["trees.value"][-values.size :]
    np.testing.assert_array_equal(written[~leaf], values[~leaf])
    np.testing.assert_allclose(written[leaf], values[leaf], rtol=2**-8)
    assert (written[leaf] != values[leaf]).any()


def test_the_same_training_writes_the_same_bytes(small: Learnt, tmp_path: Path) -> None:
    one, other = (write_learnt(small, tmp_path / name) for name in "ab")
    assert [path.read_bytes() for path in one] == [path.read_bytes() for path in other]


def test_columns_follow_their_names(small: Learnt, features: np.ndarray, tmp_path: Path) -> None:
    """A feature that was added, and another order of the others, change nothing."""
    write_learnt(small, tmp_path)
    order = np.random.default_rng(2).permutation(len(NAMES))
    again = read_learnt(tmp_path, ("context|new", *(NAMES[k] for k in order)))
    moved = np.column_stack([np.full(len(features), 7.0, np.float32), features[:, order]])
    np.testing.assert_allclose(again.log_odds(moved), small.log_odds(features), atol=ROUNDING)
    one, other = (of.estimators["clipping", "rail"] for of in (small, again))
    np.testing.assert_allclose(other.estimate(moved), one.estimate(features), atol=ROUNDING)


def test_a_feature_that_is_gone_is_named(small: Learnt, tmp_path: Path) -> None:
    write_learnt(small, tmp_path)
    used = NAMES[int(small.estimators["clipping", "rail"].anchors[0].column)]
    with pytest.raises(TwingapError, match="no longer computed"):
        read_learnt(tmp_path, tuple(name for name in NAMES if name != used))


def test_nothing_learnt_is_applied_to_an_effect_that_was_edited(small: Learnt, tmp_path: Path) -> None:
    known = {name: definition(name) for name in EFFECTS}
    known["clipping"]["rail"]["plausible"] = [1.0, 2.0]
    write_learnt(small, tmp_path, known)
    again = read_learnt(tmp_path, NAMES)
    assert again.outdated == {"clipping"}
    assert not again.covers("clipping")
    assert again.covers("quantisation")
    assert set(again.detectors) == {"quantisation"}
    assert again.estimators == {}


def test_an_effect_with_a_parameter_more_is_still_known(small: Learnt, tmp_path: Path) -> None:
    """At its default it acts as before."""
    known = {name: definition(name) for name in EFFECTS}
    known["clipping"] = dict(list(known["clipping"].items())[:-1])
    write_learnt(small, tmp_path, known)
    assert not read_learnt(tmp_path, NAMES).outdated


@pytest.mark.parametrize("name", ["learnt.json", "learnt.npz"])
def test_missing_and_altered_files_are_refused(small: Learnt, tmp_path: Path, name: str) -> None:
    write_learnt(small, tmp_path)
    path = tmp_path / name
    whole = path.read_bytes()
    path.write_bytes(whole[:-9] + b"damaged!!")
    with pytest.raises(TwingapError, match=r"cannot be read|is not the file"):
        read_learnt(tmp_path, NAMES)
    path.unlink()
    with pytest.raises(TwingapError, match="cannot be read"):
        read_learnt(tmp_path, NAMES)


def test_another_format_is_refused(small: Learnt, tmp_path: Path) -> None:
    write_learnt(small, tmp_path)
    path = tmp_path / "learnt.json"
    table = json.loads(path.read_text())
    path.write_text(json.dumps(table | {"format": "twingap.learnt/0"}))
    with pytest.raises(TwingapError, match=r"twingap\.learnt/1 expected"):
        read_learnt(tmp_path, NAMES)


def test_what_ships_covers_the_catalogue_and_is_read_without_what_learns() -> None:
    code = (
        "import sys; from twingap.gap.knowledge import shipped; learnt = shipped();"
        "print(len(learnt.detectors), len(learnt.outdated), 'sklearn' in sys.modules, 'torch' in sys.modules)"
    )
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert printed == [str(len(trainable())), "0", "False", "False"]


def test_what_ships_is_small() -> None:
    from twingap.gap.knowledge import SHIPPED

    assert sum(path.stat().st_size for path in SHIPPED.iterdir()) < 8e6
