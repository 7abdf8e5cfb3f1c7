"""From simulated to real: networks, adversarial adaptation, selection without target labels, and judging.

Windows --inputs--> train(source, labels, target without labels) -> checkpoints -> select -> score
Windows --------------------- fit("Proposed", ...) -> Fitted ------------------------------> judge
"""

from twingap.adapt.alignment import Alignment, kernel_discrepancy
from twingap.adapt.dann import DomainDiscriminator, adversarial_schedule, reverse_gradient
from twingap.adapt.evaluate import Scores, bootstrap_interval, score, t_interval
from twingap.adapt.methods import METHODS, Fitted, Judged, MethodOptions, fit, judge, steps_of_epochs
from twingap.adapt.mode_inputs import ModeInputs
from twingap.adapt.mode_network import Architecture, ModeNetwork
from twingap.adapt.nets import FEATURES, PlainCNN, best_device
from twingap.adapt.noise import with_noise
from twingap.adapt.selection import CRITERIA, DEFAULT, Evidence, select
from twingap.adapt.training import Checkpoint, Method, Outputs, Trained, Training, outputs, reproducible, train
from twingap.adapt.views import VIEWS, inputs
from twingap.adapt.windows import Windows, cut, joined, split_by_group

__all__ = [
    "CRITERIA",
    "DEFAULT",
    "FEATURES",
    "METHODS",
    "VIEWS",
    "Alignment",
    "Architecture",
    "Checkpoint",
    "DomainDiscriminator",
    "Evidence",
    "Fitted",
    "Judged",
    "Method",
    "MethodOptions",
    "ModeInputs",
    "ModeNetwork",
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
    "split_by_group",
    "steps_of_epochs",
    "t_interval",
    "train",
    "with_noise",
]
