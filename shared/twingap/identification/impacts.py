"""Impact amplitudes from the energy that a fault adds around the resonance.

faulty records  --PSD in the band of the mode--> energy --+
healthy records --PSD in the same band-------> energy  ---+--> excess / (energy of unit impacts) = amplitude^2
twin, unit impacts, no noise --PSD, same band--> energy --+

The energy of unit impacts comes from the twin itself, run without noise at each record's own rate, length and speed, so
that overlapping ringing and the twin's excitation and path effects (jitter, load zone) are counted. Speeds are nominal
to several per cent in real sets, which moves lines across a sharp mode: the spacing of impacts is first read off the
squared envelope. Nothing is clipped before averaging, so a fault too weak to see comes out as 0 within its interval
rather than as a small amplitude that is always there.
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
"""How far real speeds may lie from nominal, as a fraction."""
REACH = 1.5
"""Impact rates on either side of a resonance that its band holds at least: three lines or four."""


def band(spectra: Spectra, fit: HealthyFit, impact_hz: float) -> NDArray[np.bool_]:
    """Bins where the mode's own spectrum is above a tenth of its peak, and whatever lies near it.

    Impacts come as lines `impact_hz` apart: a sharp mode may stand between two of them, and nearly nothing of their
    energy is in its own band then. So bins within `REACH` such distances of the resonance belong to it.
    """
    mode = spectra.expected(autocorrelation(fit.resonance_hz, fit.damping_ratio, spectra.fs_hz, spectra.segment))
    f = np.arange(mode.size) * spectra.fs_hz / spectra.segment
    near = np.abs(f - fit.resonance_hz) <= REACH * impact_hz
    return np.asarray(spectra.usable & (near | (mode > 0.1 * mode[spectra.usable].max())))


def band_energy(spectra: Spectra, psd: Array, inside: NDArray[np.bool_]) -> Array:
    """Mean square within the band [...] of PSDs [..., bins]."""
    return np.asarray(psd[..., inside].sum(axis=-1) * spectra.fs_hz / spectra.segment)


def impact_gain(spectra: Spectra, fit: HealthyFit) -> Array:
    """Power that the mode passes at each bin [bins], for equal impacts: how unit spectra change with the fit.

    A ratio of two of these moves every line by what the mode passes there; in a sharp mode that is far from the change
    of the whole band.
    """
    mode = spectra.expected(autocorrelation(fit.resonance_hz, fit.damping_ratio, spectra.fs_hz, spectra.segment))
    return mode * impulse_energy(fit.resonance_hz, fit.damping_ratio, spectra.fs_hz)


def unit_spectra(twin: PhenomenologicalTwin, fit: HealthyFit, spectra: Spectra, records: RecordSet, root: int) -> Array:
    """PSDs of the twin's impacts alone, of unit amplitude, under each record's condition.

    Parameters
    ----------
    twin : PhenomenologicalTwin
        Whose excitation and path effects act; its disturbances and acquisition are left out.
    fit : HealthyFit
        The mode.
    spectra : Spectra
        Of faulty records.
    records : RecordSet
        The set that they are of.
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
    """The twin's unit impacts alone, through this mode: no noise, no disturbance, no acquisition."""
    effects = [e for e in twin.effects if e.stage in (Stage.SHAFT, Stage.EXCITATION, Stage.PATH)]
    faults = dict.fromkeys(FAULTS[1:], 1.0)
    # The twin refuses to be without any noise; this much is nothing beside unit impacts.
    parameters = PhenomenologicalParameters(fit.resonance_hz, fit.damping_ratio, faults, 0.0, 1e-9, 1.0)
    return PhenomenologicalTwin(twin.bearing, parameters, effects, twin.unit)


def ringing_power(samples: Array, fs_hz: float, centre_hz: float, half_hz: float) -> Array:
    """[samples] Squared envelope of what lies within `half_hz` of `centre_hz`."""
    n = samples.size
    spectrum = np.fft.rfft(samples - samples.mean())
    spectrum[np.abs(np.fft.rfftfreq(n, 1 / fs_hz) - centre_hz) > half_hz] = 0
    return np.asarray(np.abs(hilbert(np.fft.irfft(spectrum, n))) ** 2)


def actual_speed(twin: PhenomenologicalTwin, fit: HealthyFit, record: Record) -> float:
    """Speed (rpm) at which the twin's impact rate is that of this record.

    The squared envelope of the record, band-passed around the mode, is searched for the comb of three harmonics that
    stands highest within `TOLERANCE` of the nominal impact rate. Where none stands out the nominal speed is kept.
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

    # Too few impacts for the search to resolve anything within the tolerance.
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
    """Impacts per turn in the twin, its own slip included."""
    t = np.arange(2) / condition.fs_hz
    draft = Draft(condition, twin.bearing, 1.0, t, t * (condition.speed_rpm / 60))
    for effect in twin.effects:
        if effect.stage == Stage.SHAFT:
            effect.apply(draft, np.random.Generator(np.random.SFC64(0)))
    return draft.fault_order
