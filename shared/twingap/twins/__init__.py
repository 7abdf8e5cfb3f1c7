"""Twins: simulators of a machine, each a chain of effects around a model of excitation and path."""

from twingap.twins.base import Twin

__all__ = ["Twin"]
