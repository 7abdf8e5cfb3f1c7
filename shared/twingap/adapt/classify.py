"""Fault classes of unlabelled records, from a classifier that has only seen simulated machines with their faults.

records (labels dropped) --speeds--> twin --draw--> simulated fleets --windows--> trees (`order_forest`), or a network
                     |                         +--> other simulated fleets --> temperature (`confidence`)
                     +--windows--> probabilities --mean over a record's windows--> tempered --> class, confidence

The trees read lines at the bearing's orders and levels over the quietest record. Paper 3's methods (`methods`) can be
had in their place, on simulated machines that are not in fleets, of a twin whose mode was matched to the records.

Confidence is calibrated on simulated machines, so it holds for machines like those; whether the real one is like them
no unlabelled record can show (`twingap gap` tells what the twin lacks).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from twingap.adapt.confidence import Reliability, calibrate_temperature, cross_checked
from twingap.adapt.fleets import Fleets
from twingap.adapt.levels import operating_points
from twingap.adapt.methods import METHODS, fit
from twingap.adapt.mode_inputs import ModeInputs
from twingap.adapt.order_forest import MOST_MEMBERS, examples, train_forest
from twingap.adapt.population import CLASSES, Population, stated
from twingap.adapt.selection import DEFAULT
from twingap.adapt.training import Training
from twingap.adapt.windows import cut
from twingap.bearing import Bearing
from twingap.errors import TwingapError
from twingap.records import RecordSet
from twingap.records.measurable import refuse_unmeasurable

if TYPE_CHECKING:
    from twingap.twins.twin_file import TwinSpec

Array = NDArray[np.float64]
Labels = NDArray[np.int64]
Report = Callable[[str, float], None]

ORDERS: Final = "orders"
METHODS_OF_CLASSIFY: Final = (ORDERS, *METHODS)
"""Trees on fault orders and levels; or one of paper 3's, of which those without adaptation did better on real records:
the others settle unlike classes onto each other."""
WANTED_TURNS: Final = 5.0
LEAST_TURNS: Final = 3.0
"""Of the shaft in one window: the orders of faults must stand apart in its envelope spectrum."""
SHORTEST_WINDOW: Final = 512
LONGEST_WINDOW: Final = 16384
FEWEST_MACHINES: Final = 4


@dataclass(frozen=True)
class ClassifyOptions:
    """How a classifier is made.

    Parameters
    ----------
    method : str
        "orders", or a key of `METHODS`.
    machines : int
        Simulated machines a class to train on (fleets of as many in all); half as many more to calibrate on.
    steps : int
        Gradient steps of a network; the trees take none.
    windows : int
        Per record, evenly spread.
    match : bool
        Correct speeds from the records, without their labels; for a network also identify what the twin leaves free.
    max_iterations : int
        Of the networks' mode decomposition.

    Raises
    ------
    TwingapError
        For an unknown method or sizes too small.
    """

    method: str = ORDERS
    machines: int = 200
    steps: int = 600
    windows: int = 6
    match: bool = True
    max_iterations: int = 200

    def __post_init__(self) -> None:
        if self.method not in METHODS_OF_CLASSIFY:
            known = ", ".join(METHODS_OF_CLASSIFY)
            raise TwingapError(f"unknown method {self.method!r}", mend=f"use one of {known}")
        for name, least in (("machines", FEWEST_MACHINES), ("steps", 1), ("windows", 1)):
            if getattr(self, name) < least:
                raise TwingapError(f"{name} = {getattr(self, name)}, at least {least} expected")

    @property
    def inputs(self) -> ModeInputs:
        """Envelope spectra of modes for a network; the modes themselves for the machine, whose numbers are theirs."""
        quantity = (
            "modes" if self.method == ORDERS or METHODS[self.method].architecture is None else "envelope_spectrum"
        )
        return ModeInputs(quantity=quantity, max_iterations=self.max_iterations)

    @property
    def criterion(self) -> str:
        """Of the checkpoint. A method that adapts to nothing is chosen by simulated machines alone: information
        maximisation wants every class among the records, and a user's may well be of one."""
        aligned = self.method in METHODS and METHODS[self.method].alignment.active
        return DEFAULT if aligned else "source_accuracy"


@dataclass(frozen=True)
class Classified:
    """What is said of each record.

    Parameters
    ----------
    names : tuple[str, ...]
    classes : tuple[str, ...]
    probabilities : Array [records, classes]
        Calibrated.
    temperature : float
        By which they were.
    simulated : Reliability
        Of simulated machines that were neither trained nor selected on.
    window_samples : int
    notes : tuple[str, ...]
        For people.
    """

    names: tuple[str, ...]
    classes: tuple[str, ...]
    probabilities: Array
    temperature: float
    simulated: Reliability
    window_samples: int
    notes: tuple[str, ...] = field(default=())

    @property
    def predicted(self) -> tuple[str, ...]:
        """Most probable class of each record."""
        return tuple(self.classes[i] for i in self.probabilities.argmax(axis=1))

    @property
    def confidence(self) -> Array:
        """Its probability [records]."""
        return np.asarray(self.probabilities.max(axis=1))

    def rows(self) -> list[dict[str, str | float]]:
        """Columns record, predicted, confidence and one probability per class; to six decimals."""
        return [
            {
                "record": name,
                "predicted": predicted,
                "confidence": round(float(p.max()), 6),
                **{c: round(float(v), 6) for c, v in zip(self.classes, p, strict=True)},
            }
            for name, predicted, p in zip(self.names, self.predicted, self.probabilities, strict=True)
        ]


def _quiet(what: str, fraction: float) -> None:
    """Report nothing."""


def classify(
    records: RecordSet,
    spec: TwinSpec,
    seed: int,
    options: ClassifyOptions | None = None,
    *,
    report: Report = _quiet,
) -> Classified:
    """Classify unlabelled records.

    Parameters
    ----------
    records : RecordSet
        Of one sampling rate. Faults are dropped before anything else is done.
    spec : TwinSpec
    seed : int
        Same seed, same bytes.
    options : ClassifyOptions, optional
    report : callable
        Told what is being done and how much is done (0 to 1).

    Returns
    -------
    Classified

    Raises
    ------
    TwingapError
        For records or a twin that cannot be used: no bearing, several rates, too short, not finite, constant.
    """
    from twingap.twins.twin_file import in_unit, overruled

    options = options or ClassifyOptions()
    records, spec = records.without_labels(), in_unit(spec, records.unit)
    bearing = records.bearing or spec.bearing
    if bearing is None:
        raise TwingapError(
            "the bearing is not known",
            where=f"record set {records.name!r}",
            mend="add a [bearing] table to recordset.toml or to the twin file",
        )
    length = window_samples(records, bearing)
    _refuse_unreadable(records)
    notes = [other] if (other := overruled(spec, records.bearing)) else []
    known = stated(spec)
    if options.match and options.method == ORDERS:
        report("reading speeds", 0.0)
        records = _at_true_speeds(records, bearing, notes)
    elif options.match:
        report("reading speeds and modes", 0.0)
        records, spec, known = _matched(records, spec, bearing, seed, notes)
    told = _by_orders if options.method == ORDERS else _by_network
    held, labels, target = told(records, spec, bearing, known, length, seed, options, report)
    report("calibrating", 0.95)
    shown = _votes(held, options.windows)
    calibration = calibrate_temperature(shown, labels)
    return Classified(
        tuple(c.name for c in records.conditions),
        CLASSES,
        calibration(_votes(target, options.windows)),
        calibration.temperature,
        cross_checked(shown, labels),
        length,
        tuple(notes),
    )


def _by_orders(
    records: RecordSet, spec: TwinSpec, bearing: Bearing, known: frozenset[str], length: int, seed: int,
    options: ClassifyOptions, report: Report,
) -> tuple[Array, Labels, Array]:  # fmt: skip
    """Of windows of held-out simulated records, probabilities and their records' classes; of real ones, the former."""
    # A window says little more than the one beside it: two a simulated record, and more records.
    windows, target = min(options.windows, 2), cut(records, length, options.windows)
    population = Population(spec, bearing, records.unit, records.conditions, known, windows * length)
    of_point = np.bincount(operating_points(np.array([c.speed_rpm for c in records.conditions])))
    fleets = Fleets(population, min(int(of_point.max()), MOST_MEMBERS))
    count = max(2, math.ceil(options.machines * len(CLASSES) / fleets.members))
    shown = examples(
        fleets, count, length, windows, _stream(seed, 1), lambda done: report("simulating fleets", 0.1 + 0.5 * done)
    )
    spare = examples(
        fleets, max(2, count // 2), length, options.windows, _stream(seed, 2),
        lambda done: report("simulating fleets to calibrate on", 0.6 + 0.25 * done),
    )  # fmt: skip
    report("training", 0.85)
    forest = train_forest(shown, bearing, len(CLASSES), seed)
    return forest.of_features(spare.features), spare.labels[:: options.windows], forest.probabilities(target)


def _by_network(
    records: RecordSet, spec: TwinSpec, bearing: Bearing, known: frozenset[str], length: int, seed: int,
    options: ClassifyOptions, report: Report,
) -> tuple[Array, Labels, Array]:  # fmt: skip
    """The same of one of paper 3's methods."""
    population = Population(spec, bearing, records.unit, records.conditions, known, options.windows * length)
    report("simulating machines", 0.1)
    source = cut(population.records(options.machines, _stream(seed, 1)), length, options.windows, CLASSES)
    spare = population.records(max(FEWEST_MACHINES, options.machines // 2), _stream(seed, 2))
    held = cut(spare, length, options.windows, CLASSES)
    target = cut(records, length, options.windows)
    report("training", 0.3)
    fitted = fit(
        options.method, source, target, seed, n_classes=len(CLASSES),
        settings=Training(steps=options.steps, checkpoints=min(6, options.steps)), inputs=options.inputs,
        criterion=options.criterion, device="cpu",
    )  # fmt: skip
    assert held.labels is not None
    return fitted.predict_proba(held), held.labels[:: options.windows], fitted.predict_proba(target)


def window_samples(records: RecordSet, bearing: Bearing) -> int:
    """Length of the windows: the shortest power of two that holds five turns of the slowest shaft, or what there is.

    Parameters
    ----------
    records : RecordSet
    bearing : Bearing

    Raises
    ------
    TwingapError
        For several sampling rates, one too low for the strikes of a fault to stand apart, and records too short.
    """
    rates = sorted({c.fs_hz for c in records.conditions})
    if len(rates) > 1:
        raise TwingapError(
            f"sampled at {', '.join(f'{r:g}' for r in rates[:4])} Hz, one rate for all expected",
            where=f"record set {records.name!r}",
            mend="classify the records of each rate by themselves, or resample them",
        )
    slowest = min(records.conditions, key=lambda c: c.speed_rpm)
    fastest = max(records.conditions, key=lambda c: c.speed_rpm)
    strikes_hz = max(bearing.fault_order(f) for f in CLASSES[1:]) * fastest.speed_rpm / 60
    if rates[0] < 8 * strikes_hz:
        raise TwingapError(
            f"is sampled at {rates[0]:g} Hz, at least {8 * strikes_hz:.0f} Hz expected: a fault would strike "
            f"{strikes_hz:.0f} times a second",
            where=f"record {fastest.name!r}",
            mend="correct fs_hz or speed_rpm, or record at a higher rate",
        )
    per_turn = rates[0] * 60 / slowest.speed_rpm
    wanted = _power_of_two(WANTED_TURNS * per_turn)
    shortest = min(records.conditions, key=lambda c: c.n_samples)
    length = min(wanted, LONGEST_WINDOW, 1 << (shortest.n_samples.bit_length() - 1))
    least = _power_of_two(LEAST_TURNS * per_turn)
    if least > LONGEST_WINDOW:
        raise TwingapError(
            f"has {per_turn:.0f} samples a turn, at most {LONGEST_WINDOW / LEAST_TURNS:.0f} expected",
            where=f"record {slowest.name!r}",
            mend="correct fs_hz or speed_rpm, or resample the records to a lower rate",
        )
    if length < least:
        raise TwingapError(
            f"has {shortest.n_samples} samples, at least {least} expected: the power of two that holds "
            f"{LEAST_TURNS:g} turns of the slowest shaft",
            where=f"record {shortest.name!r}",
            mend="bring longer records, or leave it out",
        )
    return length


def _power_of_two(samples: float) -> int:
    """The smallest that holds so many samples and makes a window."""
    return max(SHORTEST_WINDOW, 1 << math.ceil(math.log2(samples)))


def _refuse_unreadable(records: RecordSet) -> None:
    for record in records:
        where = f"record {record.condition.name!r}"
        if not np.isfinite(record.samples).all():
            raise TwingapError("a sample is not a finite number", where=where, mend="mend it or leave the record out")
        if not np.ptp(record.samples) > 0:
            raise TwingapError("all samples are equal", where=where, mend="leave the record out")
        refuse_unmeasurable(record.samples, where)


def _at_true_speeds(records: RecordSet, bearing: Bearing, notes: list[str]) -> RecordSet:
    """Records with their speeds as their lines show them, where they do.

    A mode is not identified for the trees: on real records, whose several modes one mode cannot stand for, drawing it
    from all that can be did better than holding on to the one found.
    """
    from twingap.identify.speed import estimate_speeds

    try:
        speeds = estimate_speeds(records, bearing)
    except TwingapError as error:
        notes.append(f"speeds could not be read off the records ({error}): they were taken as stated")
        return records
    notes += speeds.notes
    return speeds.corrected(records)


def _matched(
    records: RecordSet, spec: TwinSpec, bearing: Bearing, seed: int, notes: list[str]
) -> tuple[RecordSet, TwinSpec, frozenset[str]]:
    """Records with true speeds, and the twin with the mode and noises that they show; impacts stay open.

    States are read off combs in the envelopes for this (`twingap.identify.calibrate`). That is good enough for a mode;
    an impact's amplitude it would only give where the comb is plain, so amplitudes are drawn instead.
    """
    known = stated(spec)
    if spec.model != "phenomenological":
        notes.append(
            f"the {spec.model} twin was taken as it is: `twingap identify` matches it to records of known state"
        )
        return records, spec, known
    from twingap.identify.calibrate import calibrate
    from twingap.twins.twin_file import flat, nested

    try:
        found = calibrate(records, spec, _stream(seed, 3))
    except TwingapError as error:
        notes.append(f"the twin could not be matched to the records ({error}): it was taken as it is")
        return records, spec, known
    assert found.spec is not None
    kept = {k: v for k, v in flat(found.spec.parameters).items() if k in known or not k.startswith("impact_amplitude.")}
    spec = dataclasses.replace(found.spec, parameters=nested(kept))
    return found.speeds.corrected(records), spec, frozenset(kept)


def _votes(probabilities: Array, windows: int) -> Array:
    """Mean probabilities of each record [records, classes]: `cut` keeps the windows of a record together."""
    return np.asarray(probabilities.reshape(-1, windows, probabilities.shape[1]).mean(axis=1))


def _stream(seed: int, purpose: int) -> np.random.Generator:
    return np.random.default_rng([seed, 40, purpose])
