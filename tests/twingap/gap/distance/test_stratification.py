"""Records of like condition, and slopes over what varies within them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.twingap.gap.distance.test_paired import conditions_of, run_of
from twingap.gap.distance.stratification import independent_units, slopes, strata
from twingap.records import Condition


def test_slopes_are_centred_in_strata_and_orthonormal_over_all() -> None:
    conditions = run_of(24)
    parts = [[[conditions[i]] for i in part] for part in strata(conditions)]
    table = slopes(parts)
    assert [t.shape for t in table] == [(len(part), table[0].shape[1]) for part in parts]
    for tilt in table:
        np.testing.assert_allclose(tilt.mean(axis=0), 0, atol=1e-12)
    whole = np.concatenate(table)
    np.testing.assert_allclose(whole.T @ whole, np.eye(whole.shape[1]), atol=1e-12)
    # Speeds that differ between strata alone have no slope within them; two records a stratum tell none from chance.
    apart = [[[replace(c, speed_rpm=1000.0 * (k + 1), time_s=None)] for [c] in part] for k, part in enumerate(parts)]
    assert all(t.shape[1] == 0 for t in slopes(apart))
    assert all(t.shape[1] == 0 for t in slopes([part[:2] for part in parts]))


def test_strata_hold_every_record_once_and_like_with_like() -> None:
    conditions = conditions_of(24, ("healthy", "outer", "inner"))
    parts = strata(conditions)
    assert sorted(np.concatenate(parts).tolist()) == list(range(24))
    for part in parts:
        assert len({conditions[i].fault for i in part}) == 1 and len(part) >= 2
    lonely = strata(conditions_of(3, ("healthy", "outer", "inner")))
    assert [len(p) for p in lonely] == [3]
    same = [Condition(f"r{i}", (1000, 2000)[i % 2], 1e4, 99) for i in range(10)]
    assert {len({same[i].speed_rpm for i in part}) for part in strata(same)} == {1}


def test_no_recording_is_cut_in_two_and_each_is_one_witness() -> None:
    conditions = conditions_of(32, ("outer",), per_group=4)
    parts = strata(conditions)
    assert len(parts) > 1
    groups = [{conditions[i].group for i in part} for part in parts]
    assert sum(map(len, groups)) == len(set.union(*groups))
    found = independent_units(conditions[:8])
    assert [one.tolist() for one in found] == [[0, 1, 2, 3], [4, 5, 6, 7]]
    assert len(independent_units(conditions[:4])) == 4  # one recording: then its windows are all there is
