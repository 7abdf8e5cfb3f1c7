"""Choice of a method of diagnosis by how many fault records are labelled, with the reason.

Paper 2 names three regimes (section 3.2.4): sufficient fault data, SOM-MQE; a small amount, SVM; little or none, the
network trained on the twin. It gives no number. `Thresholds` come from `papers.paper2_digital_twin.availability`, whose
table of crossing points says where they lie after a full run: one label helps at once, and nothing passes the corrected
network by more than luck. Hence neither SVM nor maps are chosen unless a threshold is given.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from twingap import TwingapError

Approach = Literal["twin network", "corrected network", "SVM", "SOM-MQE"]


@dataclass(frozen=True)
class Thresholds:
    """Labelled records of the class that has fewest, from which on a method is chosen."""

    correct: int = 1  # the network from the twin is corrected by a head
    svm: int | None = None  # the SVM; None = never, the corrected network stays ahead
    som: int | None = None  # maps by class; None = never


@dataclass(frozen=True)
class Choice:
    approach: Approach  # "twin network", "corrected network", "SVM", "SOM-MQE": for naming the fault
    alarm: bool  # whether the healthy map can alarm at the wanted rate; it needs no fault record
    why: str  # one or two sentences


def choose(
    n_labelled_per_class: Mapping[str, int] | int, n_healthy_windows: int = 0, *,
    false_alarm: float = 0.01, thresholds: Thresholds | None = None,
) -> Choice:  # fmt: skip
    """Choose a method by the labelled records of each fault (0 where there is none; or one number for all), the windows
    of healthy vibration, and the wanted false-alarm rate."""
    counts = {"each fault": n_labelled_per_class} if isinstance(n_labelled_per_class, int) else n_labelled_per_class
    if not counts or min(counts.values()) < 0 or n_healthy_windows < 0:
        raise TwingapError(f"{dict(counts)} labelled records, {n_healthy_windows} healthy windows", where="choose",
                           mend="give each fault's number, 0 or more")  # fmt: skip
    limits = thresholds or Thresholds()
    scarcest = min(counts, key=lambda fault: counts[fault])
    n = counts[scarcest]
    alarm = n_healthy_windows + 1 >= 1 / false_alarm - 1e-9
    count = f"{n} labelled record{'s' * (n != 1)} of {scarcest}" + ("" if len(counts) == 1 else ", the scarcest")
    if limits.som is not None and n >= limits.som:
        approach: Approach = "SOM-MQE"
        why = f"{count}: from {limits.som} on, maps of each class are as good as anything and show severity too"
    elif limits.svm is not None and n >= limits.svm:
        approach, why = "SVM", f"{count}: from {limits.svm} on the SVM is ahead of the network"
    elif n >= limits.correct:
        approach = "corrected network"
        why = f"{count}: enough to correct the network that the twin has taught"
    else:
        approach, why = "twin network", f"{count}: only the twin can show what that fault looks like"
    ability = "alarms" if alarm else "cannot alarm"
    why += f"; the healthy map {ability} at {false_alarm:g} false alarms with {n_healthy_windows} healthy windows"
    return Choice(approach, alarm, why)
