"""Fault classes of unlabelled records, from a classifier that has only seen simulated machines with their faults.

records (labels dropped) --likely speeds--> windows --features--> trees that ship with twingap (`order_classifier`)
                                               |  or --------> a network trained for this twin (`network_classifier`)
     probabilities --mean over windows and speeds, temperature--> --lines of whole records (trees)--> class, confidence

The trees read lines at the bearing's orders and levels over the quietest record. They have learnt from simulated fleets
of random machines (`twingap.adapt.train_classifier`) and need of the user's machine its bearing and speeds only. A
network (one of paper 3's methods) is trained anew, on simulated machines like the twin.

Confidence is calibrated on simulated machines, so it holds for machines like those; whether the real one is like them
no unlabelled record can show (`twingap gap` reports what the twin lacks).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from twingap.adapt.classify_options import ORDERS, ClassifyOptions
from twingap.adapt.confidence import Reliability
from twingap.adapt.population import CLASSES
from twingap.adapt.window_length import window_samples
from twingap.errors import TwingapError
from twingap.records import RecordSet
from twingap.records.measurable import refuse_unmeasurable

if TYPE_CHECKING:
    from twingap.twins.twin_file import TwinSpec

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Classified:
    """What is predicted of each record.

    Parameters
    ----------
    names : tuple[str, ...]
        Records that could be read.
    classes : tuple[str, ...]
    probabilities : Array [records, classes]
        Calibrated.
    temperature : float
        That calibrated them.
    simulated : Reliability
        Of simulated machines that were neither trained nor selected on; of the trees without lines of whole records.
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


def classify(
    records: RecordSet,
    twin: TwinSpec,
    *,
    options: ClassifyOptions | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Classified:
    """Classify unlabelled records.

    Parameters
    ----------
    records : RecordSet
        Of one sampling rate. Faults are dropped before anything else is done.
    twin : TwinSpec
        Gives the bearing where the records do not. A network is trained on machines like it; the trees do not use it.
    options : ClassifyOptions, optional
    seed : int
        Of a network's training: same seed, same bytes. The trees have nothing to draw.
    progress : callable, optional
        Called with what is being done and how much is done (0 to 1).

    Returns
    -------
    Classified

    Raises
    ------
    TwingapError
        For records or a twin that cannot be used: no bearing, several rates, too short; where no record can be read.
    """
    from twingap.twins.twin_file import in_unit, overruled

    options, progress = options or ClassifyOptions(), progress or _quiet
    records, twin = records.without_labels(), in_unit(twin, records.unit)
    bearing = records.bearing or twin.bearing
    if bearing is None:
        raise TwingapError(
            "the bearing is not known",
            where=f"record set {records.name!r}",
            mend="add a [bearing] table to recordset.toml or to the twin file",
        )
    records, notes = _readable(records)
    length = window_samples(records, bearing)
    notes += [other] if (other := overruled(twin, records.bearing)) else []
    if options.method != ORDERS:
        from twingap.adapt.network_classifier import classify_by_network  # slow to import

        found = classify_by_network(records, twin, bearing, length, seed, options, notes, progress)
    else:
        from twingap.adapt.order_classifier import (
            rows_at_speeds,
            shipped_classifier,
            weighed_by_lines,
        )  # slow to import
        from twingap.adapt.windows import cut
        from twingap.identification.speed_without_labels import as_stated, speeds_without_labels

        progress("reading speeds", 0.0)
        speeds = speeds_without_labels(records, bearing) if options.match else as_stated(len(records))
        notes += speeds.notes
        if hidden := int((~speeds.shown).sum()):
            notes.append(
                f"{hidden} of {len(records)} records do not show their speed: they were classified at all speeds that "
                "are likely, which makes their confidence lower"
            )
        progress("classifying", 0.5)
        trees = shipped_classifier()
        rows, weights = rows_at_speeds(cut(records, length, options.windows), speeds, bearing)
        probabilities = trees.predict_proba(rows, weights)[:, np.searchsorted(trees.classes_, CLASSES)]
        assert trees.calibration_ is not None and trees.reliability_ is not None
        if speeds.lines is not None:
            bounded = replace(trees.calibration_, temperature=1.0)
            probabilities = bounded(weighed_by_lines(probabilities, speeds))
        found = probabilities, trees.calibration_.temperature, trees.reliability_
    return Classified(tuple(c.name for c in records.conditions), CLASSES, *found, length, tuple(notes))


def _quiet(what: str, fraction: float) -> None:
    """Report nothing."""


def _readable(records: RecordSet) -> tuple[RecordSet, list[str]]:
    """Records that are no dead channel: finite, not constant, of a size that is measured; and a note on the others."""
    kept, faults = [], []
    for place, condition in enumerate(records.conditions):
        where = f"record {condition.name!r}"
        try:
            samples = records[place].samples
            if not np.isfinite(samples).all():
                raise TwingapError("a sample is not a finite number", where=where)
            if not np.ptp(samples) > 0:
                raise TwingapError("all samples are equal", where=where)
            refuse_unmeasurable(samples, where)
        except TwingapError as error:
            faults.append(error)
        else:
            kept.append(place)
    if not faults:
        return records, []
    if not kept:
        raise TwingapError(faults[0].what, where=faults[0].where, mend="give records that vibrate")
    more = f", and {len(faults) - 1} more" if len(faults) > 1 else ""
    return records.take(kept), [f"left out, since it cannot be classified: {faults[0]}{more}"]
