"""Digest of the code that a training of this paper depends on: part of the keys of stored results."""

from __future__ import annotations

import twingap.adapt.dann
import twingap.adapt.nets
import twingap.adapt.training
import twingap.bearing
import twingap.effects
import twingap.identification
import twingap.records
import twingap.streams
import twingap.twins
from papers.paper1_rul_varying_speed import cases, job, methods, models
from twingap.prognosis import anomaly, speed_influence
from twingap.provenance import digest_of_code


def code_of_training() -> str:
    """Digest of all code that a training depends on."""
    return digest_of_code(
        cases, job, methods, models, twingap.adapt.dann, twingap.adapt.nets, twingap.adapt.training, twingap.bearing,
        twingap.effects, twingap.identification, anomaly, speed_influence, twingap.records, twingap.streams,
        twingap.twins,
    )  # fmt: skip
