"""Impact amplitudes from the energy that a fault adds around the resonance.

faulty records  --PSD in the band of the mode--> energy --+
healthy records --PSD in the same band-------> energy  ---+--> excess / (energy of unit impacts) = amplitude^2
twin, unit impacts, no noise --PSD, same band--> energy --+

The energy of unit impacts is simulated by the twin without noise at the rate, length and speed of each record, which
includes overlapping responses and the twin's excitation and path effects (jitter, load zone). Nominal speeds can be
wrong by several per cent, which shifts lines relative to a sharp mode, so the impact rate is first estimated from the
squared envelope. Excess energy may be negative before averaging, so that the estimate of an undetectable fault is not
biased.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import hilbert

from twingap.bearing import FAULTS
from twingap.effects import Draft, Stage
from twingap.identification.mode import autocorrelation, impulse_energy
from twingap.identification.resonance import HealthyFit
from twingap.identification.spectra import Spectra, power_density
from twingap.records import Condition, Record, RecordSet
from twingap.streams import Streams
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

Array = NDArray[np.float64]

TOLERANCE = 0.04
"""Largest relative deviation of speeds from nominal; larger finds larger errors and more false combs."""
REACH = 1.5
"""Smallest half width of a resonance's band, in impact rates: it then has three or four lines."""


def band(spectra: Spectra, fit: HealthyFit, impact_hz: float) -> NDArray[np.bool_]:
    """Bins where the spectrum of the mode is above a tenth of its peak, and those close to the resonance.

    Lines of impacts are `impact_hz` apart, and a sharp mode may be between two of them. Bins within `REACH` such
    distances of the resonance are therefore included.
    """
    mode = spectra.expected(autocorrelation(fit.resonance_hz, fit.damping_ratio, spectra.fs_hz, spectra.segment))
    f = np.arange(mode.size) * spectra.fs_hz / spectra.segment
    near = np.abs(f - fit.resonance_hz) <= REACH * impact_hz
    return np.asarray(spectra.usable & (near | (mode > 0.1 * mode[spectra.usable].max())))


def band_energy(spectra: Spectra, psd: Array, inside: NDArray[np.bool_]) -> Array:
    """Mean square within the band [...] of PSDs [..., bins]."""
    return np.asarray(psd[..., inside].sum(axis=-1) * spectra.fs_hz / spectra.segment)


def impact_gain(spectra: Spectra, fit: HealthyFit) -> Array:
    """Power gain of the mode at each bin [bins] for equal impacts.

    The ratio of two gains converts unit spectra from one fit to another line by line, which for a sharp mode differs
    from the change of the total band.
    """
    mode = spectra.expected(autocorrelation(fit.resonance_hz, fit.damping_ratio, spectra.fs_hz, spectra.segment))
    return mode * impulse_energy(fit.resonance_hz, fit.damping_ratio, spectra.fs_hz)


def unit_spectra(twin: PhenomenologicalTwin, fit: HealthyFit, spectra: Spectra, records: RecordSet, root: int) -> Array:
    """PSDs of the twin's impacts alone, of unit amplitude, under each record's condition.

    Parameters
    ----------
    twin : PhenomenologicalTwin
        Twin whose excitation and path effects are used, without its disturbances and acquisition.
    fit : HealthyFit
        Fitted mode.
    spectra : Spectra
        Spectra of faulty records.
    records : RecordSet
        Set of these records.
    root : int
        Entropy of the random effects.

    Returns
    -------
    Array [records, bins]
    """
    silent = silent_twin(twin, fit)
    out = []
    for place in spectra.places:
        record = records[int(place)]
        condition = replace(record.condition, speed_rpm=actual_speed(silent, fit, record))
        (made,) = silent.make([condition], [Streams(root, int(place))])
        out.append(power_density(made.samples, spectra.fs_hz, spectra.segment))
    return np.array(out)


def silent_twin(twin: PhenomenologicalTwin, fit: HealthyFit) -> PhenomenologicalTwin:
    """Twin with unit impacts through this mode only: without noise, disturbances and acquisition."""
    effects = [e for e in twin.effects if e.stage in (Stage.SHAFT, Stage.EXCITATION, Stage.PATH)]
    faults = dict.fromkeys(FAULTS[1:], 1.0)
    # The twin needs some noise; this amount is negligible relative to unit impacts.
    parameters = PhenomenologicalParameters(fit.resonance_hz, fit.damping_ratio, faults, 0.0, 1e-9, 1.0)
    return PhenomenologicalTwin(twin.bearing, parameters, effects, twin.unit)


def ringing_power(samples: Array, fs_hz: float, centre_hz: float, half_hz: float) -> Array:
    """[samples] Squared envelope of the band within `half_hz` of `centre_hz`."""
    n = samples.size
    spectrum = np.fft.rfft(samples - samples.mean())
    spectrum[np.abs(np.fft.rfftfreq(n, 1 / fs_hz) - centre_hz) > half_hz] = 0
    return np.asarray(np.abs(hilbert(np.fft.irfft(spectrum, n))) ** 2)


def actual_speed(twin: PhenomenologicalTwin, fit: HealthyFit, record: Record) -> float:
    """Speed, rpm, at which the impact rate of the twin is that of a record.

    It is that of the highest comb of three harmonics within `TOLERANCE` of the nominal impact rate, in the squared
    envelope of the record around the mode. Without a clear comb it is the nominal speed.
    """
    condition = record.condition
    nominal = fault_order(twin, condition) * condition.speed_rpm / 60
    n = record.samples.size
    half = max(3 * fit.damping_ratio * fit.resonance_hz, 4 * nominal)
    energy = ringing_power(record.samples, condition.fs_hz, fit.resonance_hz, half)
    size = 4 * 2 ** int(np.ceil(np.log2(n)))
    envelope = np.abs(np.fft.rfft((energy - energy.mean()) * np.hanning(n), size))
    step = condition.fs_hz / size

    def comb(at: Array) -> Array:
        places = np.rint(np.outer([1, 2, 3], at) / step).astype(int)
        return np.asarray(envelope[np.minimum(places, envelope.size - 1)].sum(axis=0))

    # Too few impacts to resolve speeds within the tolerance.
    if nominal * TOLERANCE * condition.duration_s < 1:
        return condition.speed_rpm
    near = np.arange(nominal * (1 - TOLERANCE), nominal * (1 + TOLERANCE), step / 3)
    far = comb(np.concatenate([near * 0.7, near * 0.85, near * 1.2, near * 1.4]))
    heights = comb(near)
    best = int(np.argmax(heights))
    if heights[best] < 1.5 * far.max():
        return condition.speed_rpm
    return float(condition.speed_rpm * near[best] / nominal)


def fault_order(twin: PhenomenologicalTwin, condition: Condition) -> float:
    """Impacts per turn in the twin, including its slip."""
    t = np.arange(2) / condition.fs_hz
    draft = Draft(condition, twin.bearing, 1.0, t, t * (condition.speed_rpm / 60))
    for effect in twin.effects:
        if effect.stage == Stage.SHAFT:
            effect.apply(draft, np.random.Generator(np.random.SFC64(0)))
    return draft.fault_order
