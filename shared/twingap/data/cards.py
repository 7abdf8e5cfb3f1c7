"""Data cards: what a data set holds, what to beware of, and which commands it suits.

Croissant manifest --facts of its recordings, key twingap:card--> Card
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

from twingap.bearing import BEARINGS, Bearing
from twingap.data.manifest import Manifest


@dataclass(frozen=True)
class Card:
    """What is to be known about a data set before it is used.

    Parameters
    ----------
    name, title, licence, citation : str
    channels : str
        Accelerometers, and how one is chosen.
    unit : str
        Of the samples; empty = not stated by the owner.
    bearing : Bearing
        Geometry, from which the fault orders follow.
    fs_hz : tuple of float
        Sampling rates.
    speeds_rpm : tuple of float
    recordings : int
        As the manifest lists them: recordings, or runs to failure.
    snapshots : int or None
        Of all runs; None where a recording is one record.
    loads, labels : str
    faults : dict[str, int]
        Number of recordings by fault, or by the fault at the end of a run.
    traps : tuple of str
    suits : tuple of str
        Commands for which it is suited.
    listed : str
        What the manifest lists, where that is neither recordings nor runs.
    """

    name: str
    title: str
    licence: str
    citation: str
    channels: str
    unit: str
    bearing: Bearing
    fs_hz: tuple[float, ...]
    speeds_rpm: tuple[float, ...]
    recordings: int
    snapshots: int | None
    loads: str
    labels: str
    faults: dict[str, int]
    traps: tuple[str, ...]
    suits: tuple[str, ...]
    listed: str = ""

    def rows(self) -> list[tuple[str, str]]:
        """Heading and text of each entry."""
        b = self.bearing
        geometry = (
            f"{b.name}: {b.n_rollers} rollers, d = {b.roller_diameter_mm:g} mm, D = {b.pitch_diameter_mm:g} mm, "
            f"contact angle {b.contact_angle_deg:g} degrees"
        )
        ball = f"BSF {b.bsf:.4g} (a ball strikes at {2 * b.bsf:.4g})"
        orders = f"BPFO {b.bpfo:.4g}, BPFI {b.bpfi:.4g}, {ball}, FTF {b.ftf:.4g}"
        count = "made on demand" if not self.recordings else f"{self.recordings} {self.listed}".rstrip()
        if self.snapshots:
            count = f"{self.recordings} runs, {self.snapshots} snapshots"
        faults = ", ".join(f"{n} {fault}" for fault, n in self.faults.items())
        return [
            ("channels", self.channels),
            ("unit", self.unit or "not stated"),
            ("rates", _listed(self.fs_hz, "Hz") or "12000 Hz unless asked otherwise"),
            ("recordings", count + (f" ({faults})" if faults else "")),
            ("bearing", geometry),
            ("orders", orders),
            ("speeds", _listed(self.speeds_rpm, "rpm") or "as stated per record"),
            ("loads", self.loads),
            ("labels", self.labels),
            *(("beware", trap) for trap in self.traps),
            ("suits", ", ".join(f"twingap {command}" for command in self.suits)),
        ]

    def about(self) -> dict[str, Any]:
        """For JSON."""
        b = self.bearing
        return {
            "name": self.name, "title": self.title, "licence": self.licence, "citation": self.citation,
            "channels": self.channels, "unit": self.unit, "fs_hz": list(self.fs_hz),
            "speeds_rpm": list(self.speeds_rpm),
            "recordings": self.recordings, "snapshots": self.snapshots, "faults": self.faults, "loads": self.loads,
            "labels": self.labels, "traps": list(self.traps), "suits": list(self.suits),
            "bearing": {
                "name": b.name, "n_rollers": b.n_rollers, "roller_diameter_mm": b.roller_diameter_mm,
                "pitch_diameter_mm": b.pitch_diameter_mm, "contact_angle_deg": b.contact_angle_deg,
            },
            "orders": {"bpfo": b.bpfo, "bpfi": b.bpfi, "bsf": b.bsf, "ftf": b.ftf},
        }  # fmt: skip


def card_of(facts: Manifest) -> Card:
    """The card of a data set."""
    rows = facts.recordings
    stated = facts.card
    snapshots = [row["n_snapshots"] for row in rows if "n_snapshots" in row]
    faults = Counter(str(row.get("fault", row.get("end_fault", row.get("damage", "unknown")))) for row in rows)
    return Card(
        facts.name, facts.title, facts.licence, facts.citation, stated["channels"], facts.unit,
        BEARINGS[facts.bearing or "6205"], _values(facts, "fs_hz"), _values(facts, "speed_rpm"), len(rows),
        sum(snapshots) if snapshots else None, stated["loads"], stated["labels"], dict(faults), tuple(stated["traps"]),
        tuple(stated["suits"]), stated.get("listed", ""),
    )  # fmt: skip


def _values(facts: Manifest, key: str) -> tuple[float, ...]:
    return tuple(sorted({float(row[key]) for row in facts.recordings if key in row}))


def _listed(values: tuple[float, ...], unit: str, most: int = 6) -> str:
    if len(values) > most:
        return f"{values[0]:g} to {values[-1]:g} {unit}"
    return ", ".join(f"{value:g}" for value in values) + (f" {unit}" if values else "")
