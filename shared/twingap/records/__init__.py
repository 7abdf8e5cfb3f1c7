"""Conditions, records and record sets: the one form in which vibration enters and leaves."""

from twingap.records.model import UNITS, Array, Condition, Record, RecordSet

__all__ = ["UNITS", "Array", "Condition", "Record", "RecordSet"]
