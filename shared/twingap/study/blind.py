"""Blinded world: the samples, nominal conditions and twin that a diagnosis receives, without the truth.

World (records, sim, twin, truth, ...) --copied, names replaced--> Blind (records, sim, twin)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from twingap.records import Record, RecordSet
from twingap.twins.twin_file import TwinSpec


class BlindableWorld(Protocol):
    """Attributes of a world that blinding uses; see `twingap.rigs.worlds`."""

    @property
    def records(self) -> RecordSet: ...
    @property
    def sim(self) -> RecordSet | None: ...
    @property
    def twin(self) -> Mapping[str, Any]: ...


@dataclass(frozen=True)
class Blind:
    """Input of a blind diagnosis: measured records, and those of the user's own simulator (None: the built-in twin)."""

    records: RecordSet
    sim: RecordSet | None
    twin: TwinSpec


def blinded(world: BlindableWorld) -> Blind:
    """Copy of what a diagnosis may use of a world, without any reference to the world itself.

    Names of sets, records and groups are replaced by numbers, and columns beyond the record-set schema are dropped,
    since either could reveal the truth.
    """
    sim = None if world.sim is None else anonymous(world.sim, "simulator")
    return Blind(anonymous(world.records, "machine"), sim, spec_of(world.twin))


def anonymous(records: RecordSet, name: str) -> RecordSet:
    """The same records under neutral names."""
    groups = {group: f"g{place:04d}" for place, group in enumerate(records.groups)}
    copies = (
        Record(
            replace(r.condition, name=f"r{i:05d}", group=groups.get(r.condition.group or "", f"r{i:05d}"), extra={}),
            np.array(r.samples),
        )
        for i, r in enumerate(records)
    )
    return RecordSet.from_records(name, records.unit, records.bearing, copies)


def spec_of(twin: Mapping[str, Any]) -> TwinSpec:
    """Twin specification from the content of a TWIN.toml."""
    table = twin.get("twin", twin)
    effects, parameters = tuple(table.get("effects", ())), dict(twin.get("parameters", {}))
    return TwinSpec(str(table["model"]), effects, table.get("preset"), parameters)
