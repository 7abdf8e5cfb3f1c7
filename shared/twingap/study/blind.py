"""What a diagnosis gets to see of a world: samples, nominal conditions and the twin; nothing else hangs on to them.

World (records, sim, twin, truth, ...) --copied, names replaced--> Blind (records, sim, twin)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from twingap.records import Record, RecordSet
from twingap.twins.twin_file import TwinSpec


class Worldly(Protocol):
    """What is used of a world; see `twingap.rigs.worlds`."""

    @property
    def records(self) -> RecordSet: ...
    @property
    def sim(self) -> RecordSet | None: ...
    @property
    def twin(self) -> Mapping[str, Any]: ...


@dataclass(frozen=True)
class Blind:
    """What a diagnosis gets.

    Parameters
    ----------
    records : RecordSet
    sim : RecordSet or None
        The user's own simulator; None = the built-in twin.
    twin : TwinSpec
    """

    records: RecordSet
    sim: RecordSet | None
    twin: TwinSpec


def blinded(world: Worldly) -> Blind:
    """Copies of what may be seen of a world, from which no reference leads back to it.

    Names of sets, records and groups are replaced by numbers, and columns beyond those of the record-set form are
    dropped, since either could tell.
    """
    return Blind(
        anonymous(world.records, "machine"),
        None if world.sim is None else anonymous(world.sim, "simulator"),
        spec_of(world.twin),
    )


def anonymous(records: RecordSet, name: str) -> RecordSet:
    """The same records under names that say nothing."""
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
    """The spec that TWIN.toml of this content describes."""
    table = twin.get("twin", twin)
    return TwinSpec(
        model=str(table["model"]),
        effects=tuple(table.get("effects", ())),
        preset=table.get("preset"),
        parameters=dict(twin.get("parameters", {})),
    )
