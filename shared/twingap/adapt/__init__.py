"""Fault classes of unlabelled records: simulated training data, features, networks, trees, adaptation, selection.

records without labels, TwinSpec --Population, Fleets--> classify -> Classified
Windows --inputs--> train(source, labels, target without labels) -> checkpoints -> select -> score
Windows --------------------- fit("Proposed", ...) -> Fitted ------------------------------> judge

`classify` here is the function; from the module of that name import by ``from ... import``. The other names are loaded
when they are first used, since many of their modules are slow to import (PyTorch, scikit-learn).
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from twingap.adapt.classify import Classified, classify
from twingap.adapt.classify_options import ClassifyOptions

if TYPE_CHECKING:
    from twingap.adapt.alignment import Alignment, kernel_discrepancy
    from twingap.adapt.confidence import Calibration, Reliability, calibrate_temperature, cross_checked
    from twingap.adapt.dann import DomainDiscriminator, adversarial_schedule, reverse_gradient
    from twingap.adapt.domain_adaptation import DomainAdaptationClassifier
    from twingap.adapt.evaluate import Scores, bootstrap_interval, score, t_interval
    from twingap.adapt.fault_classifier import FaultClassifier
    from twingap.adapt.fleets import Fleets
    from twingap.adapt.learning import train_classifier
    from twingap.adapt.methods import METHODS, Fitted, Judged, MethodOptions, fit, judge, steps_of_epochs
    from twingap.adapt.mode_inputs import ModeInputs
    from twingap.adapt.mode_network import Architecture, ModeNetwork
    from twingap.adapt.nets import FEATURES, PlainCNN, best_device
    from twingap.adapt.order_classifier import shipped_classifier
    from twingap.adapt.order_forest import OrderForest, train_forest
    from twingap.adapt.order_transformer import OrderFeatures
    from twingap.adapt.population import Population
    from twingap.adapt.selection import CRITERIA, DEFAULT, Evidence, select
    from twingap.adapt.training import Checkpoint, Method, Outputs, Trained, Training, outputs, reproducible, train
    from twingap.adapt.views import VIEWS, inputs
    from twingap.adapt.windows import Windows, cut, joined, split_by_group

_MODULES: Final = {
    "alignment": (
        "Alignment",
        "kernel_discrepancy",
    ),
    "confidence": (
        "Calibration",
        "Reliability",
        "calibrate_temperature",
        "cross_checked",
    ),
    "dann": (
        "DomainDiscriminator",
        "adversarial_schedule",
        "reverse_gradient",
    ),
    "domain_adaptation": ("DomainAdaptationClassifier",),
    "evaluate": (
        "Scores",
        "bootstrap_interval",
        "score",
        "t_interval",
    ),
    "fault_classifier": ("FaultClassifier",),
    "fleets": ("Fleets",),
    "learning": ("train_classifier",),
    "methods": (
        "METHODS",
        "Fitted",
        "Judged",
        "MethodOptions",
        "fit",
        "judge",
        "steps_of_epochs",
    ),
    "mode_inputs": ("ModeInputs",),
    "mode_network": (
        "Architecture",
        "ModeNetwork",
    ),
    "nets": (
        "FEATURES",
        "PlainCNN",
        "best_device",
    ),
    "order_classifier": ("shipped_classifier",),
    "order_forest": (
        "OrderForest",
        "train_forest",
    ),
    "order_transformer": ("OrderFeatures",),
    "population": ("Population",),
    "selection": (
        "CRITERIA",
        "DEFAULT",
        "Evidence",
        "select",
    ),
    "training": (
        "Checkpoint",
        "Method",
        "Outputs",
        "Trained",
        "Training",
        "outputs",
        "reproducible",
        "train",
    ),
    "views": (
        "VIEWS",
        "inputs",
    ),
    "windows": (
        "Windows",
        "cut",
        "joined",
        "split_by_group",
    ),
}
_HOME: Final = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "CRITERIA",
    "DEFAULT",
    "FEATURES",
    "METHODS",
    "VIEWS",
    "Alignment",
    "Architecture",
    "Calibration",
    "Checkpoint",
    "Classified",
    "ClassifyOptions",
    "DomainAdaptationClassifier",
    "DomainDiscriminator",
    "Evidence",
    "FaultClassifier",
    "Fitted",
    "Fleets",
    "Judged",
    "Method",
    "MethodOptions",
    "ModeInputs",
    "ModeNetwork",
    "OrderFeatures",
    "OrderForest",
    "Outputs",
    "PlainCNN",
    "Population",
    "Reliability",
    "Scores",
    "Trained",
    "Training",
    "Windows",
    "adversarial_schedule",
    "best_device",
    "bootstrap_interval",
    "calibrate_temperature",
    "classify",
    "cross_checked",
    "cut",
    "fit",
    "inputs",
    "joined",
    "judge",
    "kernel_discrepancy",
    "outputs",
    "reproducible",
    "reverse_gradient",
    "score",
    "select",
    "shipped_classifier",
    "split_by_group",
    "steps_of_epochs",
    "t_interval",
    "train",
    "train_classifier",
    "train_forest",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(f"twingap.adapt.{_HOME[name]}"), name)
    globals()[name] = found
    return found
