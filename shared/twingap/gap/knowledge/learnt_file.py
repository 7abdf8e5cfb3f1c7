"""Files of the models of the diagnosis: learnt.json and learnt.npz in one folder.

Learnt --write_learnt--> learnt.json: names, thresholds, provenance
                         learnt.npz: trees and null distributions, as arrays
       <--read_learnt--  matched by name with the features and effects of the running version
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import Effect, catalogue
from twingap.errors import TwingapError
from twingap.files import replacing
from twingap.gap.knowledge.detectors import Anchor, Ensemble, Estimator
from twingap.gap.knowledge.learnt import Learnt
from twingap.gap.knowledge.null import MachineScores, Null
from twingap.gap.knowledge.score_calibration import ScoreCalibration
from twingap.trees import Trees

FORMAT: Final = "twingap.learnt/1"
"""Format of learnt.json; files of another format are rejected."""
_LEAF_BITS: Final = 8
"""Bits of the mantissa of what a leaf adds. A larger number is more exact and makes the file larger."""
_OWN: Final = "twingap.effects."
"""Modules of the catalogue's own effects; an effect of the same name from elsewhere was not trained on."""


def write_learnt(learnt: Learnt, folder: Path, parameters: Mapping[str, Any] | None = None) -> tuple[Path, Path]:
    """Write the models as arrays and JSON, without executable content: learnt.json and learnt.npz in this order.

    `parameters` are definitions of the effects that were trained on; None for those of the catalogue.
    """
    folder.mkdir(parents=True, exist_ok=True)
    trees, calibration = _TreeWriter(), learnt.calibration
    estimators = [_estimator(key, estimator, trees) for key, estimator in learnt.estimators.items()]
    table: dict[str, Any] = {
        "format": FORMAT,
        "about": learnt.about,
        "features": list(learnt.features),
        "effects": dict(parameters or {name: definition(name) for name in learnt.effects if name in catalogue()}),
        "order": list(learnt.effects),
        "detectors": {name: trees.add(detector) for name, detector in learnt.detectors.items()},
        "estimators": estimators,
        "any_gap": trees.add(learnt.any_gap),
        "thresholds": dict(learnt.thresholds),
        "set_level": learnt.set_level,
        "calibration": None if calibration is None else vars(calibration) | {"weights": calibration.weights.tolist()},
    }
    arrays = trees.arrays() | {"general": learnt.general.astype(np.int32)}
    for name, null in (("null", learnt.null), ("null_rest", learnt.null_rest)):
        arrays |= {f"{name}.{key}": value for key, value in vars(null.machines).items()}
    data, text = folder / "learnt.npz", folder / "learnt.json"
    with replacing(data) as temporary, temporary.open("wb") as file:
        # Scores and distances are rounded to seven digits: only their ranks are used.
        small: dict[str, Any] = {n: a.astype(np.float32) if a.dtype == np.float64 else a for n, a in arrays.items()}
        np.savez_compressed(file, **small)
    table["npz_sha256"] = hashlib.sha256(data.read_bytes()).hexdigest()
    with replacing(text) as temporary:
        rows = (f"{json.dumps(name)}:{json.dumps(value, separators=(',', ':'))}" for name, value in table.items())
        temporary.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8", newline="\n")
    return text, data


def read_learnt(folder: Path, features: Sequence[str]) -> Learnt:
    """Models from files, with their columns matched to `features`, the names that the running version computes, in
    order.

    Effects whose parameters have changed since, and a user's own effects of the same name, are `Learnt.outdated`: no
    model is applied to them.

    Raises
    ------
    TwingapError
        When a file is missing or altered, has another format, or uses a feature that is no longer computed.
    """
    mend = "install twingap again, or make it again with `twingap train`"
    text, data = folder / "learnt.json", folder / "learnt.npz"
    try:
        table = json.loads(text.read_text(encoding="utf-8"))
        content = data.read_bytes()
    except (OSError, ValueError) as error:
        raise TwingapError(f"what the diagnosis has learnt cannot be read: {error}", where=folder, mend=mend) from error
    if not isinstance(table, dict) or table.get("format") != FORMAT:
        raise TwingapError(f"{FORMAT} expected", where=text, mend=mend)
    if hashlib.sha256(content).hexdigest() != table["npz_sha256"]:
        raise TwingapError("is not the file that learnt.json was written with", where=data, mend=mend)
    with np.load(data, allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    place = {name: at for at, name in enumerate(features)}
    now = np.array([place.get(name, -1) for name in table["features"]], dtype=np.int64)
    trees = _TreeReader(arrays, now, table["features"], text)
    outdated = frozenset(name for name in table["order"] if not _as_learnt(name, table["effects"].get(name)))
    nulls = {
        name: Null(MachineScores(**{f.name: arrays[f"{name}.{f.name}"].astype(_FLOAT.get(f.name, float))
                                    for f in dataclasses.fields(MachineScores)}))
        for name in ("null", "null_rest")
    }  # fmt: skip
    calibration = table["calibration"]
    return Learnt(
        effects=tuple(table["order"]),
        detectors={n: trees.get(row) for n, row in table["detectors"].items() if n not in outdated},
        estimators={
            (row["effect"], row["parameter"]): _read_estimator(row, trees)
            for row in table["estimators"] if row["effect"] not in outdated
        },
        any_gap=trees.get(table["any_gap"], of_features=False),
        null=nulls["null"],
        features=tuple(features),
        about=table["about"],
        thresholds=table["thresholds"],
        set_level=table["set_level"],
        null_rest=nulls["null_rest"],
        general=trees.columns(arrays["general"]),
        calibration=None if calibration is None else ScoreCalibration(
            np.array(calibration["weights"]), calibration["offset"], calibration["named_from"]
        ),
        outdated=outdated,
    )  # fmt: skip


def definition(name: str) -> dict[str, dict[str, Any]]:
    """Definition of an effect that models depend on: its parameters with unit, plausible range and scale."""
    return {
        field.name: {
            "unit": field.metadata["unit"], "plausible": [float(end) for end in field.metadata["plausible"]],
            "log": bool(field.metadata["log"]),
        }
        for field in catalogue()[name].parameters()
    }  # fmt: skip


def _as_learnt(name: str, known: Mapping[str, Any] | None) -> bool:
    """Whether the running version has an effect of this name with the definition trained on.

    Parameters that it has got since are no obstacle: they keep their defaults, with which it acts as before.
    """
    kind: type[Effect] | None = catalogue().get(name)
    if kind is None or not kind.__module__.startswith(_OWN) or known is None:
        return False
    now = definition(name)
    return all(now.get(parameter) == value for parameter, value in known.items())


_FLOAT: Final[Mapping[str, Any]] = {"with_healthy": bool}
"""Types of the arrays of a null distribution that are not float."""


def _estimator(key: tuple[str, str], estimator: Estimator, trees: _TreeWriter) -> dict[str, Any]:
    """An estimator for JSON; its trees go to the shared arrays."""
    return {
        "effect": key[0],
        "parameter": key[1],
        "anchors": [[a.column, a.logarithmic, *a.line] for a in estimator.anchors],
        "default": estimator.default,
        "error": estimator.error,
        "error_factor": estimator.error_factor,
        "residual": None if estimator.residual is None else trees.add(estimator.residual),
        "error_model": None if estimator.error_model is None else trees.add(estimator.error_model),
    }


def _read_estimator(row: Mapping[str, Any], trees: _TreeReader) -> Estimator:
    """An estimator from a row of JSON and the shared arrays."""
    anchors = tuple(
        Anchor(int(trees.columns(np.array([column]))[0]), logarithmic, (slope, offset))
        for column, logarithmic, slope, offset in row["anchors"]
    )
    rest, error_model = (None if row[name] is None else trees.get(row[name]) for name in ("residual", "error_model"))
    return Estimator(anchors, row["default"], rest, row["error"], error_model, row["error_factor"])


class _TreeWriter:
    """Ensembles as rows of JSON that refer to shared arrays."""

    def __init__(self) -> None:
        self._nodes: dict[str, list[NDArray[Any]]] = {name: [] for name in ("column", "right", "value", "sizes")}
        self._trees = 0

    def add(self, ensemble: Ensemble) -> dict[str, Any]:
        """Row of an ensemble; its trees are appended to the shared arrays."""
        row: dict[str, Any] = {
            "columns": ensemble.columns.tolist(),
            "first_tree": self._trees,
            "start": [float(model.start[0]) for model in ensemble.models],
            "trees": [len(model.roots) for model in ensemble.models],
            "line": list(ensemble.line),
            "line_later": list(ensemble.line_later),
        }
        for model in ensemble.models:
            if max(model.column.itemsize, model.right.itemsize) > 1:
                raise ValueError("at most 254 features and 127 nodes a tree are expected")
            # Thresholds keep all bits: a rounded one may fall on the other side of a feature's value.
            values = np.where(model.is_leaf, _rounded(model.value, _LEAF_BITS), model.value)
            for name, nodes in (("column", model.column), ("right", model.right), ("value", values)):
                self._nodes[name].append(nodes)
            self._nodes["sizes"].append(np.diff(np.append(model.roots, model.column.size)).astype(np.uint8))
        self._trees += sum(row["trees"])
        return row

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The shared arrays by name."""
        return {f"trees.{name}": np.concatenate(parts) for name, parts in self._nodes.items()}


def _rounded(values: NDArray[np.float32], bits: int) -> NDArray[np.float32]:
    """[nodes] Values rounded to this number of bits of their mantissa; the other bits are 0, which compresses well."""
    mantissa, exponent = np.frexp(values)
    return np.asarray(np.ldexp(np.round(np.ldexp(mantissa, bits)), exponent - bits), np.float32)


class _TreeReader:
    """Ensembles from rows of JSON and shared arrays."""

    def __init__(
        self, arrays: Mapping[str, NDArray[Any]], now: NDArray[np.int64], names: Sequence[str], where: Path
    ) -> None:
        self._nodes = tuple(arrays[f"trees.{name}"] for name in ("column", "right", "value"))
        sizes = arrays["trees.sizes"].astype(np.int64)
        self._roots = np.cumsum(sizes) - sizes
        self._now, self._names, self._where = now, names, where

    def columns(self, stored: NDArray[Any]) -> NDArray[np.int64]:
        """Indices of stored columns among the features of the running version."""
        found = self._now[stored.astype(np.int64)]
        if (found < 0).any():
            gone = self._names[int(stored[np.argmin(found)])]
            raise TwingapError(
                f"feature {gone!r} is no longer computed", where=self._where, mend="make it again with `twingap train`"
            )
        return np.asarray(found)

    def get(self, row: Mapping[str, Any], *, of_features: bool = True) -> Ensemble:
        """Ensemble of a row; `of_features` is False where its columns are scores of other ensembles."""
        columns, first = np.array(row["columns"], dtype=np.int64), int(row["first_tree"])
        models = []
        for start, count in zip(row["start"], row["trees"], strict=True):
            models.append(Trees(np.array([start]), self._roots[first : first + count], *self._nodes))
            first += count
        line, later = (tuple(row[name]) for name in ("line", "line_later"))
        return Ensemble(self.columns(columns) if of_features else columns, models, line, later)
