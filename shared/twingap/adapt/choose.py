"""Which method, given how many fault records are labelled: one function that chooses and says why.

labelled records of each fault, healthy records --> network from the twin | network, fine-tuned | SVM | SOM-MQE

Paper 2 names three regimes (section 3.2.4): sufficient fault data, SOM-MQE; a small amount, SVM; little or none, the
network trained on the twin. It gives no number. `Thresholds` come from `papers.paper2_digital_twin.availability`, whose
table of crossing points says where they lie after a full run; for another machine measure them again. Recordings of
CWRU called right, other recordings of the same bearings being labelled (five seeds):

records of each fault      0      1      2      5     10     50
network from the twin   74 %   78 %   81 %   84 %   85 %   88 %
SVM                             68 %   81 %   95 %   97 %   99 %
SOM-MQE, map a class            73 %   79 %   98 %  100 %  100 %

So the twin is worth about two records of each fault, and from five on SVM and maps are better than the network, tuned
or not. On HIT-SM the network is right in 97 to 98 % without a label, and the SVM passes it where all are labelled,
whence the late threshold of maps, which do not. Where the labels are of other bearings, neither learns CWRU from any
number of them (62 to 70 %, the network 72 to 79 %): then more labels are no reason to leave the twin.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from twingap.errors import TwingapError

Approach = Literal["twin network", "fine-tuned network", "SVM", "SOM-MQE"]


@dataclass(frozen=True)
class Thresholds:
    """Labelled records of the class that has fewest, from which on a method is chosen.

    Parameters
    ----------
    fine_tune : int
        The network from the twin is fine-tuned.
    svm : int or None
        The SVM; None = never, the network stays ahead.
    som : int or None
        Maps by class; None = never.
    """

    fine_tune: int = 1
    svm: int | None = 5
    som: int | None = 50


@dataclass(frozen=True)
class Choice:
    """What to use.

    Parameters
    ----------
    approach : {"twin network", "fine-tuned network", "SVM", "SOM-MQE"}
        For naming the fault.
    alarm : bool
        Whether the healthy map can alarm at the rate asked for; it needs no fault record.
    why : str
        One or two sentences.
    """

    approach: Approach
    alarm: bool
    why: str


def choose(
    n_labelled_per_class: Mapping[str, int] | int, n_healthy_windows: int = 0, *,
    false_alarm: float = 0.01, thresholds: Thresholds | None = None,
) -> Choice:  # fmt: skip
    """Choose a method by what is labelled.

    Parameters
    ----------
    n_labelled_per_class : mapping or int
        Fault -> labelled records of it (an entry for every fault to be told apart, 0 where there is none); or one
        number for all.
    n_healthy_windows : int
        Windows of healthy vibration.
    false_alarm : float
        Rate asked of the alarm.
    thresholds : Thresholds, optional

    Returns
    -------
    Choice

    Raises
    ------
    TwingapError
        For negative numbers or no fault.
    """
    counts = {"each fault": n_labelled_per_class} if isinstance(n_labelled_per_class, int) else n_labelled_per_class
    if not counts or min(counts.values()) < 0 or n_healthy_windows < 0:
        raise TwingapError(f"{dict(counts)} labelled records, {n_healthy_windows} healthy windows", where="choose",
                           mend="give each fault's number, 0 or more")  # fmt: skip
    limits = thresholds or Thresholds()
    scarcest = min(counts, key=lambda fault: counts[fault])
    n = counts[scarcest]
    alarm = n_healthy_windows + 1 >= 1 / false_alarm - 1e-9
    said = f"{n} labelled records of {scarcest}" + ("" if len(counts) == 1 else ", the scarcest")
    if limits.som is not None and n >= limits.som:
        approach: Approach = "SOM-MQE"
        why = f"{said}: from {limits.som} on, maps of each class are as good as anything and show severity too"
    elif limits.svm is not None and n >= limits.svm:
        approach, why = "SVM", f"{said}: from {limits.svm} on the SVM is ahead of the network"
    elif n >= limits.fine_tune:
        approach = "fine-tuned network"
        why = f"{said}: too few to learn from alone, enough to correct the network that the twin has taught"
    else:
        approach, why = "twin network", f"{said}: only the twin can show what that fault looks like"
    ability = "alarms" if alarm else "cannot alarm"
    why += f"; the healthy map {ability} at {false_alarm:g} false alarms with {n_healthy_windows} healthy windows"
    return Choice(approach, alarm, why)
