"""What a training of this paper depends on, for the keys of stored results."""

from __future__ import annotations

import twingap.adapt.dann
import twingap.adapt.nets
import twingap.adapt.training
import twingap.bearing
import twingap.effects
import twingap.identify
import twingap.records
import twingap.streams
import twingap.twins
from papers.paper1_rul_varying_speed import cases, job, models
from twingap.prognosis import (
    adaptive_twin,
    anomaly,
    architecture,
    degradation,
    encoding,
    healthy,
    losses,
    metrics,
    network,
    remaining_life,
    run,
    simulated_lives,
    speed_influence,
    struck_modes,
    training,
)
from twingap.provenance import digest_of_code


def code_of_training() -> str:
    """Digest of all code that a training depends on."""
    return digest_of_code(
        cases, job, models, twingap.adapt.dann, twingap.adapt.nets, twingap.adapt.training,
        adaptive_twin, anomaly, architecture, degradation, encoding, healthy, losses, metrics, network, remaining_life,
        run, simulated_lives, speed_influence, struck_modes, training, twingap.bearing, twingap.effects,
        twingap.identify, twingap.records, twingap.streams, twingap.twins,
    )  # fmt: skip
