"""Transformer from records to the features that the shipped fault classifier reads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, TransformerMixin

from twingap.adapt.order_classifier import features
from twingap.adapt.window_length import window_samples as samples_of_a_window
from twingap.adapt.windows import cut
from twingap.bearing import Bearing
from twingap.errors import TwingapError
from twingap.records import Record, RecordSet


class OrderFeatures(TransformerMixin, BaseEstimator):  # type: ignore[misc]
    """Features of records at the orders of their bearing, and levels above the quietest record.

    The features of a record depend on the other records given with it: levels are relative to the quietest of them.
    Records that are transformed together should therefore come from the same kind of machine and sensor. Labels are not
    read. Speeds are taken as stated; `twingap.identification.speed.estimate_speeds` corrects them.

    Parameters
    ----------
    bearing : Bearing, optional
        Default: the one of the record set.
    windows : int
        Windows of a record, evenly spread over it.
    window_samples : int, optional
        Length of a window. Default: about five turns of the slowest shaft.

    See Also
    --------
    twingap.adapt.FaultClassifier : Takes these features as they are.
    twingap.adapt.order_classifier.FEATURES : Their names.

    Notes
    -----
    A classifier that takes rows needs one row a record, such as the mean over windows:
    ``make_pipeline(OrderFeatures(), FunctionTransformer(lambda rows: rows.mean(axis=1)), RandomForestClassifier())``.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.pipeline import make_pipeline
    >>> from twingap import BEARINGS, Condition
    >>> from twingap.adapt import OrderFeatures, shipped_classifier
    >>> from twingap.twins.phenomenological import PhenomenologicalTwin
    >>> states = ["healthy", "healthy", "outer"]
    >>> conditions = [Condition(f"r{i}", 1797.0, 12000.0, 24000, state) for i, state in enumerate(states)]
    >>> records = PhenomenologicalTwin(BEARINGS["6205"]).simulate(conditions, np.random.default_rng(0))
    >>> pipeline = make_pipeline(OrderFeatures(), shipped_classifier())
    >>> pipeline.predict(records).tolist()
    ['healthy', 'healthy', 'outer']
    """

    def __init__(self, bearing: Bearing | None = None, windows: int = 6, window_samples: int | None = None) -> None:
        self.bearing = bearing
        self.windows = windows
        self.window_samples = window_samples

    def fit(self, X: RecordSet | Sequence[Record], y: object = None) -> OrderFeatures:
        """Nothing is fitted.

        Parameters
        ----------
        X : RecordSet or sequence of Record
        y : ignored

        Returns
        -------
        OrderFeatures
        """
        return self

    def transform(self, X: RecordSet | Sequence[Record]) -> NDArray[np.float32]:
        """Features of each window of each record.

        Parameters
        ----------
        X : RecordSet or sequence of Record
            Of one sampling rate.

        Returns
        -------
        float32 array [records, windows, features]

        Raises
        ------
        TwingapError
            For records without a bearing, of several rates, or too short.
        """
        records = X if isinstance(X, RecordSet) else RecordSet.from_records("records", "", self.bearing, X)
        bearing = self.bearing or records.bearing
        if bearing is None:
            raise TwingapError(
                "the bearing is not known", where=f"record set {records.name!r}", mend="pass it: OrderFeatures(bearing)"
            )
        length = self.window_samples or samples_of_a_window(records, bearing)
        found = features(cut(records, length, self.windows), bearing)
        return found.reshape(len(records), self.windows, -1)

    def __sklearn_is_fitted__(self) -> bool:
        return True

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.requires_fit = False
        tags.input_tags.two_d_array = False
        return tags
