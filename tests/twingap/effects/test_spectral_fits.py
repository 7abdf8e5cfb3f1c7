"""Fits of mean spectra by sums of known shapes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from twingap.effects._spectral_fits import least_misfit, misfit_of_modes


def test_two_powers_are_those_of_non_negative_least_squares() -> None:
    rng = np.random.default_rng(0)
    white = np.exp(rng.normal(0, 0.2, 60))
    alone = set()
    for power in np.linspace(-0.5, 2.0, 40):  # of no mode, of both, of less than no white noise
        modes = np.exp(rng.normal(0, 0.6, (1, 60)))
        wanted = modes[0] ** power * np.exp(rng.normal(0, 0.2, 60))
        powers, _ = nnls(np.stack((modes[0], white), axis=1) / wanted[:, None], np.ones(60))
        alone |= {tuple(powers > 0)}
        model = (powers @ np.stack((modes[0], white))) / wanted
        expected = np.minimum(np.log(np.maximum(model, 1e-6)) ** 2, 1.0).mean()
        assert misfit_of_modes(modes, white, wanted) == pytest.approx(expected, rel=1e-6)
    assert alone == {(True, True), (True, False), (False, True)}


def test_three_powers_are_those_of_non_negative_least_squares_where_none_is_nought() -> None:
    rng = np.random.default_rng(2)
    for wide in (1.0, 1e9):  # the wanted spectrum may span nine orders of magnitude
        basis = np.exp(rng.normal(0, 0.6, (5, 3, 60)))
        wanted = np.geomspace(1.0, 1 / wide, 60) * np.exp(rng.normal(0, 0.1, 60))
        basis[:, 0] *= wanted
        found, powers = least_misfit(basis, wanted)
        each = [nnls((own / wanted).T, np.ones(60))[0] for own in basis]
        assert found == np.inf or any(np.allclose(powers, one, rtol=1e-5) for one in each if (one > 0).all())
    whole = np.stack([np.ones(60), np.linspace(1, 2, 60), np.linspace(2, 1, 60) ** 3])
    found, powers = least_misfit(whole[None], np.array([0.5, 1.0, 0.2]) @ whole)
    assert found == pytest.approx(0.0, abs=1e-9)
    assert powers == pytest.approx([0.5, 1.0, 0.2], rel=1e-4)
    alike = np.stack([np.ones(60), np.ones(60), np.zeros(60)])
    assert np.isfinite(least_misfit(alike[None], 1e-12 * np.ones(60))[1]).all()
