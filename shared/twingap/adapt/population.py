"""Simulated machines similar to a twin: labelled records with random parameters around those of its file.

TwinSpec --draw--> parameters, small effects, second mode, fault level, noise --one machine each--> labelled records

Parameters that cannot be estimated from unlabelled records vary widely (domain randomisation, Tobin et al. 2017,
arXiv:1703.06907), so that the classifier is valid for all machines of the population.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from twingap.bearing import Bearing
from twingap.effects import CageModulation, Effect, EntryExit, ImpactScatter, LoadZone, effect_name, make_effect
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet
from twingap.twins.base import Twin
from twingap.twins.twin_file import TwinSpec, flat, model_of, model_parameters

CLASSES: Final = ("healthy", "inner", "outer", "ball")
"""Classes in the order of their labels. Cage faults are not included, since a window has too few turns of the cage."""
KNOWN_SPREAD: Final = 0.1
FREE_SPREAD: Final = 0.4
"""Log standard deviation between machines of a parameter that the twin file states, and of one that it does not. Wider
spreads make a classifier valid for more machines and less certain about each."""
SEVERITY_SPREAD: Final = 0.5
"""The same for stated values of a fault, since defects differ."""
FAULT_SNR_DB: Final = (-5.0, 15.0)
"""Power of the impacts over that of healthy vibration where the twin file does not state it: from barely detectable to
obvious."""
NOISE_SNR_DB: Final = (0.0, 30.0)
"""Range of the signal-to-noise ratio of white noise added to each record, dB."""
SPEED_SPREAD: Final = 0.005
"""Half width of the relative range of a simulated machine's speed around the stated one, as the error of
tachometers."""
TRIES: Final = 100
"""Most draws of a machine until one can be simulated."""
ON_IMPACTS: Final = frozenset(effect_name(kind) for kind in (ImpactScatter, LoadZone, CageModulation, EntryExit))
"""Effects that act on a train of impacts; contact dynamics has its own load zone and edges."""


@dataclass(frozen=True)
class Population:
    """Distribution of simulated machines.

    Parameters
    ----------
    spec : TwinSpec
        Twin around which parameters are drawn.
    bearing : Bearing
    unit : str
        Unit of the samples.
    conditions : tuple of Condition
        Conditions of the real records: speed, load, rate and length are used, faults are not.
    known : frozenset[str]
        Dotted names of parameters that are stated or identified, which vary little.
    longest_samples : int
        Most samples of a simulated record.

    Raises
    ------
    TwingapError
        When the twin cannot simulate a class under one of the conditions (for instance a resonance above half their
        rate).
    """

    spec: TwinSpec
    bearing: Bearing
    unit: str
    conditions: tuple[Condition, ...]
    known: frozenset[str]
    longest_samples: int

    def __post_init__(self) -> None:
        slowest = min(self.conditions, key=lambda c: (c.fs_hz, c.speed_rpm))
        twin = self.twin({}, {})
        for fault in CLASSES:
            pilot = dataclasses.replace(slowest, fault=fault, n_samples=min(slowest.n_samples, 1024))
            twin.simulate([pilot], np.random.default_rng(0))

    def records(self, per_class: int, rng: np.random.Generator) -> RecordSet:
        """One labelled record of each of `per_class` random machines per class; each is its own group."""
        made = [self._record(fault, number, rng) for number in range(per_class) for fault in CLASSES]
        return RecordSet.from_records("simulated machines", self.unit, self.bearing, made)

    def _record(self, fault: str, number: int, rng: np.random.Generator) -> Record:
        like = self.conditions[int(rng.integers(len(self.conditions)))]
        condition = dataclasses.replace(
            like,
            name=f"{fault}-{number}",
            group=f"{fault}-{number}",
            fault=fault,
            n_samples=min(like.n_samples, self.longest_samples),
            speed_rpm=like.speed_rpm * (1 + SPEED_SPREAD * rng.uniform(-1, 1)),
            extra={},
        )
        for attempt in range(TRIES):
            try:
                record = self._drawn(condition, rng).simulate([condition], rng)[0]
            except TwingapError:  # for instance a mode above half the sampling rate: another machine is drawn
                if attempt == TRIES - 1:
                    raise
                continue
            if np.isfinite(record.samples).all() and np.ptp(record.samples) > 0:
                break
        else:
            raise TwingapError("the twin gives no finite vibration", where=f"record {like.name!r}")
        noise = float(record.samples.std()) * 10 ** (-rng.uniform(*NOISE_SNR_DB) / 20)
        return Record(condition, record.samples + noise * rng.standard_normal(record.samples.size))

    def _drawn(self, condition: Condition, rng: np.random.Generator) -> Twin:
        """Twin of one random machine."""
        values = self.drawn_values(rng)
        values |= self.impact_levels(values, condition, rng.uniform(*FAULT_SNR_DB))
        effects = {
            "slip_jitter": {"sigma": rng.uniform(0, 0.02)},
            "impact_scatter": {"sigma": rng.uniform(0, 0.3)},
            "load_zone": {"depth": rng.uniform(0, 0.9)},
            "second_resonance": {
                "frequency_hz": condition.fs_hz * math.exp(rng.uniform(math.log(0.05), math.log(0.45))),
                "damping_ratio": math.exp(rng.uniform(math.log(0.01), math.log(0.1))),
                "gain": math.exp(rng.uniform(math.log(0.1), math.log(2.0))),
            },
        }
        return self.twin(values, effects)

    def drawn_values(self, rng: np.random.Generator, known_spread: float = KNOWN_SPREAD) -> dict[str, Any]:
        """Random parameters of one machine by name, except its scale; known ones vary less."""
        middle = model_parameters(self.spec)
        values: dict[str, Any] = {}
        for field in dataclasses.fields(middle):
            value = getattr(middle, field.name)
            if not field.init or field.name == "scale":
                continue
            if isinstance(value, Mapping):
                # Drawn for every key, so that all classes have the same draws.
                values[field.name] = {k: v * _factor(SEVERITY_SPREAD, rng) for k, v in value.items()}
            elif isinstance(value, float):
                values[field.name] = value * _factor(known_spread if field.name in self.known else FREE_SPREAD, rng)
        return values

    def impact_levels(
        self, values: Mapping[str, Any], condition: Condition, snr_db: float
    ) -> dict[str, dict[str, float]]:
        """Impact amplitudes that a phenomenological twin's file does not state, for a given power of the impacts.

        Impacts A h(t) at a rate r have the power A^2 r / (4 zeta w), since h is a sine that decays at zeta w.

        Parameters
        ----------
        values : Mapping
            Parameters of the machine from `drawn_values`.
        condition : Condition
        snr_db : float
            Power of the impacts over that of healthy vibration.

        Returns
        -------
        dict
            ``impact_amplitude``; empty for another model, whose impacts follow from its defects.
        """
        if self.spec.model != "phenomenological":
            return {}
        amplitudes = dict(values["impact_amplitude"])
        healthy = values["structure_noise_rms"] ** 2 + values["white_noise_rms"] ** 2
        decay = 4 * values["damping_ratio"] * 2 * math.pi * values["resonance_hz"]
        for fault in amplitudes:
            if f"impact_amplitude.{fault}" not in self.known:
                rate = self.bearing.fault_order(fault) * condition.speed_rpm / 60
                amplitudes[fault] = math.sqrt(10 ** (snr_db / 10) * healthy * decay / rate)
        return {"impact_amplitude": amplitudes}

    def twin(self, values: Mapping[str, Any], more: Mapping[str, Mapping[str, float]], loudness: float = 1.0) -> Twin:
        """Twin with these parameters, the effects of its file, and further effects that can act on it.

        Parameters
        ----------
        values : Mapping
            Parameters that replace those of the file.
        more : Mapping
            Parameters of further effects by their names.
        loudness : float
            Factor on all amplitudes.
        """
        middle = model_parameters(self.spec)
        parameters = dataclasses.replace(middle, **values, scale=middle.scale * loudness)
        own = [make_effect(name, self.spec.parameters.get(name), "twin") for name in self.spec.effects]
        model = model_of(self.spec)
        excitation = model.build(parameters, self.bearing, (), self.unit).excitation
        if excitation == "waveform":
            more = {}
        elif excitation == "rollers":
            more = {name: more[name] for name in more if name not in ON_IMPACTS}
        added: list[Effect] = [make_effect(n, dict(more[n]), "twin") for n in more if n not in self.spec.effects]
        return model.build(parameters, self.bearing, (*own, *added), self.unit)


def stated(spec: TwinSpec) -> frozenset[str]:
    """Dotted names of the parameters that a twin file states."""
    return frozenset(flat(spec.parameters))


def _factor(spread: float, rng: np.random.Generator) -> float:
    return float(np.exp(spread * rng.standard_normal()))
