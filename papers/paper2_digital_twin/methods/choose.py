"""Choice of a method of diagnosis by how many fault records are labelled, with the reason.

labelled records of each fault, healthy records --> network from the twin | network, corrected | SVM | SOM-MQE

Paper 2 names three regimes (section 3.2.4): sufficient fault data, SOM-MQE; a small amount, SVM; little or none, the
network trained on the twin. It gives no number; `Thresholds` are measured by the study of availability.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Thresholds:
    """Labelled records of each fault from which on a method is chosen."""

    correct: int = 1  # the network from the twin is corrected by a head
    svm: int | None = None  # the SVM; None = never, the corrected network stays ahead
    som: int | None = None  # maps by class; None = never


@dataclass(frozen=True)
class Choice:
    approach: Literal["twin network", "corrected network", "SVM", "SOM-MQE"]  # for naming the fault
    alarm: bool  # whether the healthy map can alarm at the wanted rate; it needs no fault record
    why: str  # one or two sentences


def choose(n: int, n_healthy_windows: int, false_alarm: float, limits: Thresholds) -> Choice:
    """Choose a method by the number of labelled records of each fault and of windows of healthy vibration."""
    alarm = n_healthy_windows + 1 >= 1 / false_alarm - 1e-9
    ability = "alarms" if alarm else "cannot alarm"
    healthy = f"; the healthy map {ability} at {false_alarm:g} false alarms with {n_healthy_windows} healthy windows"
    count = f"{n} labelled record{'s' * (n != 1)} of each fault"
    if limits.som is not None and n >= limits.som:
        why = f"{count}: from {limits.som} on, maps of each class are as good as anything and show severity too"
        return Choice("SOM-MQE", alarm, why + healthy)
    if limits.svm is not None and n >= limits.svm:
        return Choice("SVM", alarm, f"{count}: from {limits.svm} on the SVM is ahead of the network{healthy}")
    if n >= limits.correct:
        why = f"{count}: enough to correct the network that the twin has taught"
        return Choice("corrected network", alarm, why + healthy)
    return Choice("twin network", alarm, f"{count}: only the twin can show what that fault looks like{healthy}")
