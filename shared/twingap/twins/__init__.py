"""Twins: simulators of a machine, each a chain of effects around a model of excitation and path."""

from twingap.twins.base import Twin
from twingap.twins.callable_twin import register_callable
from twingap.twins.contact import ContactTwin
from twingap.twins.contact_parameters import ContactParameters
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import (
    MODELS,
    Model,
    Provenance,
    TwinSpec,
    build_twin,
    read_twin,
    register_model,
    write_twin,
)

__all__ = [
    "MODELS",
    "ContactParameters",
    "ContactTwin",
    "Model",
    "PhenomenologicalParameters",
    "PhenomenologicalTwin",
    "Provenance",
    "Twin",
    "TwinSpec",
    "build_twin",
    "read_twin",
    "register_callable",
    "register_model",
    "write_twin",
]
