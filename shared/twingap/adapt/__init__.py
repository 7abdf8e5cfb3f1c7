"""From simulated to real: a plain network, adversarial adaptation, selection without target labels, and judging.

Windows --inputs--> train(source, labels, target without labels) -> checkpoints -> select -> score
"""

from twingap.adapt.dann import DomainDiscriminator, adversarial_schedule, reverse_gradient
from twingap.adapt.evaluate import Scores, bootstrap_interval, score, t_interval
from twingap.adapt.nets import FEATURES, PlainCNN, best_device
from twingap.adapt.selection import CRITERIA, DEFAULT, Evidence, select
from twingap.adapt.training import Checkpoint, Method, Outputs, Trained, Training, outputs, reproducible, train
from twingap.adapt.views import VIEWS, inputs
from twingap.adapt.windows import Windows, cut, joined, split_by_group

__all__ = [
    "CRITERIA",
    "DEFAULT",
    "FEATURES",
    "VIEWS",
    "Checkpoint",
    "DomainDiscriminator",
    "Evidence",
    "Method",
    "Outputs",
    "PlainCNN",
    "Scores",
    "Trained",
    "Training",
    "Windows",
    "adversarial_schedule",
    "best_device",
    "bootstrap_interval",
    "cut",
    "inputs",
    "joined",
    "outputs",
    "reproducible",
    "reverse_gradient",
    "score",
    "select",
    "split_by_group",
    "t_interval",
    "train",
]
