"""Domain-adaptation methods of paper 3 as a table of options, with common functions to fit and evaluate them.

source Windows (labelled) ---+--> ModeInputs --> split by group --> train --> checkpoints --> chosen without labels
target Windows (unlabelled) -+                                                                   |
                                              windows --> ModeInputs --> predict_proba, embed <--+--> judge

Source: paper 3, DOI 10.1177/10775463261462852. `METHODS` lists the options of each method. Where the paper is
ambiguous, it is interpreted as follows.

- "Dual-discriminator": one discriminator of the features, and one of features and predicted classes. (If it meant a
  label
  classifier and a domain discriminator, Proposed would have the alignment of DANN.)
- MMD, DANN and DACD align the convolutional extractor of the paper on the same modes, without denoising network and
  attention.
- DACD, "builds upon the DANN by incorporating category information": DANN and a discrepancy within classes.
- Base-Attn replaces inverse embedding and cosines by ordinary attention across time; Non-DN and Base-NDN have one
  strided
  convolution in place of the denoising network; all three have both discriminators.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.adapt.alignment import Alignment
from twingap.adapt.domain_adaptation import DomainAdaptationClassifier
from twingap.adapt.evaluate import Scores, score
from twingap.adapt.mode_inputs import ModeInputs
from twingap.adapt.mode_network import MULTIPLE, SHORTEST, Architecture
from twingap.adapt.mode_svm import ModeSVM, train_svm
from twingap.adapt.selection import CRITERIA, DEFAULT
from twingap.adapt.training import Inputs, Trained, Training, outputs
from twingap.adapt.windows import Windows
from twingap.errors import TwingapError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MethodOptions:
    """Options of a method.

    Parameters
    ----------
    name : str
    architecture : Architecture or None
        Architecture of the network; None = support vector machine.
    alignment : Alignment
        Alignment of the domains.
    """

    name: str
    architecture: Architecture | None
    alignment: Alignment = field(default_factory=Alignment)


_BARE: Final = Architecture(denoising=False, attention="none")
_DUAL: Final = Alignment(("features", "conditional"))

METHODS: Final[dict[str, MethodOptions]] = {
    m.name: m
    for m in (
        MethodOptions("VMD+SVM", None),
        MethodOptions("Non-DA", Architecture()),
        MethodOptions("MMD", _BARE, Alignment(discrepancy="domain")),
        MethodOptions("DANN", _BARE, Alignment(("features",))),
        MethodOptions("DACD", _BARE, Alignment(("features",), "category")),
        MethodOptions("Base-Attn", Architecture(attention="time"), _DUAL),
        MethodOptions("Non-DN", Architecture(denoising=False), _DUAL),
        MethodOptions("Base-NDN", Architecture(denoising=False, attention="time"), _DUAL),
        MethodOptions("Proposed", Architecture(), _DUAL),
    )
}
"""Methods by their names in the paper, in its order."""


def steps_of_epochs(epochs: float, n_windows: int, batch: int) -> int:
    """Gradient steps for `epochs` passes over `n_windows` source windows; at least 1."""
    return max(1, round(epochs * n_windows / batch))


@dataclass(frozen=True)
class Fitted:
    """Trained method.

    Parameters
    ----------
    method : MethodOptions
    inputs : ModeInputs
    trained : Trained or None
        Training of a network.
    svm : ModeSVM or None
        Model of VMD+SVM.
    criteria : Mapping[str, tuple[float, ...]]
        Label-free criterion -> score of each checkpoint; empty for VMD+SVM.
    chosen : Mapping[str, int]
        Criterion -> index of the checkpoint that it selects.
    criterion : str
        Criterion that is used.
    source_accuracy : tuple[float, ...]
        Accuracy of each checkpoint on source windows held out from training.
    """

    method: MethodOptions
    inputs: ModeInputs
    trained: Trained | None
    svm: ModeSVM | None
    criteria: Mapping[str, tuple[float, ...]]
    chosen: Mapping[str, int]
    criterion: str
    source_accuracy: tuple[float, ...]

    @property
    def checkpoints(self) -> int:
        """Number of checkpoints; 1 for VMD+SVM."""
        return 1 if self.trained is None else len(self.trained.checkpoints)

    @property
    def place(self) -> int:
        """Index of the checkpoint selected without target labels."""
        return self.chosen.get(self.criterion, 0)

    @property
    def history(self) -> list[dict[str, float]]:
        """One row per checkpoint: step, source_loss, domain_accuracy (NaN without), source_accuracy, each criterion."""
        if self.trained is None:
            return []
        return [
            {
                "step": float(c.step),
                "source_loss": c.source_loss,
                "domain_accuracy": c.domain_accuracy,
                "source_accuracy": self.source_accuracy[i],
                **{name: scores[i] for name, scores in self.criteria.items()},
            }
            for i, c in enumerate(self.trained.checkpoints)
        ]

    def predict_proba(self, windows: Windows, place: int | None = None) -> Array:
        """Probabilities [windows, classes] by the selected checkpoint or that with index `place`."""
        return self._outputs(self.inputs(windows), place)[0]

    def embed(self, windows: Windows, place: int | None = None) -> Array:
        """Features before the classifier [windows, 100] (for VMD+SVM the standardised features)."""
        return self._outputs(self.inputs(windows), place)[1]

    def _outputs(self, x: Inputs, place: int | None) -> tuple[Array, Array]:
        if self.svm is not None:
            return self.svm.probabilities(x), self.svm.features(x)
        assert self.trained is not None
        seen = outputs(self.trained.network(self.place if place is None else place), x)
        return seen.probabilities, seen.features.astype(np.float64)


def fit(
    method: str | MethodOptions,
    source: Windows,
    target_unlabelled: Windows,
    seed: int,
    *,
    n_classes: int,
    settings: Training | None = None,
    inputs: ModeInputs | None = None,
    held_out: float = 0.25,
    criterion: str = DEFAULT,
    device: str = "auto",
) -> Fitted:
    """Train a method and select a checkpoint without target labels.

    Parameters
    ----------
    method : str or MethodOptions
        Key of `METHODS`, or other options.
    source : Windows
        Labelled windows; a fraction of the groups of each class is held out from training, the same for every method.
    target_unlabelled : Windows
        Windows without labels; labels are an error.
    seed : int
        Seed of split, weights and batches. VMD+SVM does not depend on it and is trained on all source windows.
    n_classes : int
    settings : Training, optional
        Default: `Training`, with variation of inputs that are waveforms.
    inputs : ModeInputs, optional
    held_out : float
        Fraction of source groups for validation.
    criterion : str
        Key of `twingap.adapt.CRITERIA`.
    device : str
        "auto" (a GPU if there is one), "cpu" or "cuda".

    Returns
    -------
    Fitted

    Raises
    ------
    TwingapError
        For an unknown method or criterion, labels on the target, none on the source, a window length that
        the network does not support, or variation of inputs that are no waveforms.
    """
    options = _known(method)
    if criterion not in CRITERIA:
        raise TwingapError(f"unknown criterion {criterion!r}", mend=f"use one of {', '.join(CRITERIA)}")
    if target_unlabelled.labels is not None:
        raise TwingapError("the windows of the adaptation have labels", where="fit", mend="pass .unlabelled() windows")
    if source.labels is None:
        raise TwingapError("the source windows have no labels", where="fit", mend="cut them with their classes")
    prepare = inputs or ModeInputs()
    settings = settings or Training(vary=prepare.waveforms)
    if settings.vary and not prepare.waveforms:
        mend = "set vary = false"
        raise TwingapError(f"{prepare.quantity} is not invariant to shift and sign", where="Training.vary", mend=mend)
    x = prepare(source)
    if options.architecture is None:
        return Fitted(options, prepare, None, train_svm(x, source.labels, n_classes), {}, {}, criterion, ())
    if x.shape[2] % MULTIPLE or x.shape[2] < SHORTEST:
        raise TwingapError(
            f"{x.shape[2]} points per channel, a multiple of {MULTIPLE} and at least {SHORTEST} expected",
            where="fit",
            mend="cut windows of 1024 or 2048 samples",
        )
    found = DomainAdaptationClassifier(
        options.architecture, options.alignment, training=settings, held_out=held_out, criterion=criterion,
        device=device, random_state=seed,
    )  # fmt: skip
    found.fit(x, source.labels, X_target=prepare(target_unlabelled), groups=source.group, classes=np.arange(n_classes))
    return Fitted(
        options, prepare, found.trained_, None, found.criteria_, found.chosen_, criterion, found.source_accuracy_
    )  # fmt: skip


def _known(method: str | MethodOptions) -> MethodOptions:
    if isinstance(method, MethodOptions):
        return method
    if method not in METHODS:
        raise TwingapError(f"unknown method {method!r}", mend=f"use one of {', '.join(METHODS)}")
    return METHODS[method]


@dataclass(frozen=True)
class Judged:
    """Scores of a trained method on labelled windows that it was not adapted to.

    Parameters
    ----------
    scores : Scores
        Scores of the checkpoint selected without target labels: the result of the method.
    probabilities : Array [windows, classes]
        Probabilities by that checkpoint.
    accuracy_by_checkpoint : tuple[float, ...]
    accuracy_by_criterion : Mapping[str, float]
        Accuracy of the checkpoint that each label-free criterion selects.
    oracle_accuracy : float
        Accuracy of the best checkpoint by target labels, which no method can select.
    """

    scores: Scores
    probabilities: Array
    accuracy_by_checkpoint: tuple[float, ...]
    accuracy_by_criterion: Mapping[str, float]
    oracle_accuracy: float

    @property
    def accuracy(self) -> float:
        """Accuracy of the checkpoint selected without target labels."""
        return self.scores.accuracy

    def plain(self) -> dict[str, Any]:
        """Scores as numbers, dictionaries and arrays, for a result store."""
        return {
            "accuracy": self.accuracy,
            "balanced_accuracy": self.scores.balanced_accuracy,
            "confusion": self.scores.confusion,
            "recordings_right": self.scores.recordings_right,
            "recordings": self.scores.recordings,
            "probabilities": self.probabilities.astype(np.float32),
            "accuracy_by_checkpoint": list(self.accuracy_by_checkpoint),
            "accuracy_by_criterion": dict(self.accuracy_by_criterion),
            "oracle_accuracy": self.oracle_accuracy,
        }


def judge(fitted: Fitted, windows: Windows) -> Judged:
    """Scores on labelled windows that the method was not adapted to.

    Parameters
    ----------
    fitted : Fitted
    windows : Windows
        Labelled.

    Raises
    ------
    TwingapError
        When windows have no labels.
    """
    if windows.labels is None:
        raise TwingapError(
            "the windows of the evaluation have no labels", where="judge", mend="cut them with their classes"
        )
    x = fitted.inputs(windows)
    each = [fitted._outputs(x, place)[0] for place in range(fitted.checkpoints)]
    scores = [score(p, windows.labels, windows.group) for p in each]
    accuracies = tuple(s.accuracy for s in scores)
    return Judged(
        scores[fitted.place],
        each[fitted.place],
        accuracies,
        {name: accuracies[place] for name, place in fitted.chosen.items()},
        max(accuracies),
    )
