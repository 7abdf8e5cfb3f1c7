"""Fault classes of records by a network, or a support vector machine, trained on simulated machines like a twin.

records --speeds, mode--> twin --draw--> simulated machines --train--> network (`methods`) --> probabilities
                            +--> other simulated machines --> temperature (`confidence`)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from twingap.adapt.classify_options import FEWEST_MACHINES, ClassifyOptions
from twingap.adapt.confidence import Reliability, calibrate_temperature, cross_checked
from twingap.adapt.fault_classifier import votes
from twingap.adapt.methods import METHODS, fit
from twingap.adapt.mode_inputs import ModeInputs
from twingap.adapt.population import CLASSES, Population, stated
from twingap.adapt.selection import DEFAULT
from twingap.adapt.training import Training
from twingap.adapt.windows import cut
from twingap.bearing import Bearing
from twingap.errors import TwingapError
from twingap.identification.calibrate import calibrate
from twingap.identification.speed_without_labels import speeds_without_labels
from twingap.records import RecordSet
from twingap.twins.twin_file import TwinSpec, flat, nested

Array = NDArray[np.float64]


def classify_by_network(
    records: RecordSet, twin: TwinSpec, bearing: Bearing, length: int, seed: int, options: ClassifyOptions,
    notes: list[str], progress: Callable[[str, float], None],
) -> tuple[Array, float, Reliability]:  # fmt: skip
    """Train `options.method` on simulated machines and apply it to records.

    Parameters
    ----------
    records : RecordSet
        Without labels.
    twin : TwinSpec
    bearing : Bearing
    length : int
        Samples of a window.
    seed : int
    options : ClassifyOptions
    notes : list of str
        Gets what people should know.
    progress : callable
        Called with what is being done and how much is done (0 to 1).

    Returns
    -------
    Array [records, classes]
        Calibrated probabilities.
    float
        The temperature that calibrated them.
    Reliability
        Of simulated machines kept apart.
    """
    known = stated(twin)
    if options.match:
        progress("reading speeds and modes", 0.0)
        records, twin, known = matched(records, twin, bearing, seed, notes)
    population = Population(twin, bearing, records.unit, records.conditions, known, options.windows * length)
    progress("simulating machines", 0.1)
    source = cut(population.records(options.machines, _stream(seed, 1)), length, options.windows, CLASSES)
    spare = population.records(max(FEWEST_MACHINES, options.machines // 2), _stream(seed, 2))
    held = cut(spare, length, options.windows, CLASSES)
    target = cut(records, length, options.windows)
    progress("training", 0.3)
    fitted = fit(
        options.method, source, target, seed, n_classes=len(CLASSES),
        settings=Training(steps=options.steps, checkpoints=min(6, options.steps)), inputs=inputs_of(options),
        criterion=criterion_of(options), device="cpu",
    )  # fmt: skip
    progress("calibrating", 0.95)
    assert held.labels is not None
    shown, labels = votes(fitted.predict_proba(held), options.windows), held.labels[:: options.windows]
    calibration = calibrate_temperature(shown, labels)
    predicted = votes(fitted.predict_proba(target), options.windows)
    return calibration(predicted), calibration.temperature, cross_checked(shown, labels)


def inputs_of(options: ClassifyOptions) -> ModeInputs:
    """Envelope spectra of modes for a network; for the support vector machine the modes, whose features it takes."""
    quantity = "modes" if METHODS[options.method].architecture is None else "envelope_spectrum"
    return ModeInputs(quantity=quantity, max_iterations=options.max_iterations)


def criterion_of(options: ClassifyOptions) -> str:
    """Criterion that chooses the checkpoint.

    A method without adaptation is chosen by simulated machines alone: information maximisation wants every class among
    the records, and a user's may well be of one.
    """
    return DEFAULT if METHODS[options.method].alignment.active else "source_accuracy"


def matched(
    records: RecordSet, twin: TwinSpec, bearing: Bearing, seed: int, notes: list[str]
) -> tuple[RecordSet, TwinSpec, frozenset[str]]:
    """Records with true speeds, the twin with the mode and noises that they show, and the names of what is known.

    States are read off combs in the envelopes for this (`identification.calibrate`). That is good enough for a mode; an
    impact's amplitude it would only give where the comb is plain, so amplitudes are drawn instead.
    """
    known = stated(twin)
    speeds = speeds_without_labels(records, bearing)
    notes += speeds.notes
    records = speeds.corrected(records)
    if twin.model != "phenomenological":
        notes.append(
            f"the {twin.model} twin was taken as it is: `twingap identify` matches it to records of known state"
        )
        return records, twin, known
    try:
        found = calibrate(records, twin, _stream(seed, 3))
    except TwingapError as error:
        notes.append(f"the twin could not be matched to the records ({error}): it was taken as it is")
        return records, twin, known
    assert found.spec is not None
    kept = {k: v for k, v in flat(found.spec.parameters).items() if k in known or not k.startswith("impact_amplitude.")}
    twin = dataclasses.replace(found.spec, parameters=nested(kept))
    return found.speeds.corrected(records), twin, frozenset(kept)


def _stream(seed: int, purpose: int) -> np.random.Generator:
    return np.random.default_rng([seed, 40, purpose])
