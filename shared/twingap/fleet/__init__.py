"""Fleets: the diagnosis of every record set below a folder, and what the machines have in common.

folder + twin --run_fleet--> a report each, Fleet --write_fleet--> fleet.json, fleet.csv, fleet.html
"""

from twingap.fleet.diagnoses import run_fleet
from twingap.fleet.summary import Fleet, Machine, SharedEffect
from twingap.fleet.written import write_fleet

__all__ = ["Fleet", "Machine", "SharedEffect", "run_fleet", "write_fleet"]
