"""Twins: simulators of a machine, each a chain of effects around a model of excitation and path."""

from twingap.twins.base import Twin
from twingap.twins.contact import ContactTwin
from twingap.twins.contact_parameters import ContactParameters
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

__all__ = ["ContactParameters", "ContactTwin", "PhenomenologicalParameters", "PhenomenologicalTwin", "Twin"]
