"""Vibration records with their conditions: in memory, on disk, and split by group."""

from twingap.records.folder import read_record_set, write_record_set, write_records
from twingap.records.model import UNITS, Array, Condition, Record, RecordSet

__all__ = ["UNITS", "Array", "Condition", "Record", "RecordSet", "read_record_set", "write_record_set", "write_records"]
