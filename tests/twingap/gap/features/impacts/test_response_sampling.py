"""Samples of ringing against a continuous response: against SciPy's filters."""

import numpy as np
import pytest
from scipy import signal

from twingap.gap.features.impacts.response_sampling import continuous


@pytest.mark.parametrize("mode", [0.06, 0.2, 0.33, 0.45])
def test_it_is_the_ratio_of_a_modes_transfer_function_to_its_impulse_invariant_filter(mode):
    damping = 1e-4
    w = 2 * np.pi * mode
    analog = signal.TransferFunction([w * np.sqrt(1 - damping**2)], [1.0, 2 * damping * w, w**2])
    b, a, _ = signal.cont2discrete((analog.num, analog.den), 1.0, method="impulse")
    f = np.linspace(0.01, 0.49, 80)
    f = f[np.abs(f - mode) > 0.01]
    ours = signal.freqresp(analog, 2 * np.pi * f)[1]
    theirs = signal.freqz(np.squeeze(b), a, worN=f, fs=1.0)[1]
    expected = 2 * np.log(np.abs(ours / theirs))
    np.testing.assert_allclose(continuous(f, mode), expected, atol=0.01)


def test_at_the_mode_they_are_the_same():
    assert continuous(np.array([0.21]), 0.21)[0] == pytest.approx(0, abs=1e-2)
