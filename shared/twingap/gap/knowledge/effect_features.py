"""Features of each effect: the inputs of its detector, restricted to avoid spurious correlations."""

from __future__ import annotations

from fnmatch import fnmatchcase
from functools import cache
from typing import Final

from twingap.effects import Effect, catalogue

_OF_THE_SET: Final = ("shape", "path", "change", "pooled", "impulse_response", "comb", "trend")
"""Families of features of sets of records, named ``family|feature`` in patterns."""
_ALWAYS: Final = ("own_simulator", "records", "healthy_share", "log_samples", "log_turns", "speeds", "span_s")
"""Features of the records' conditions that every detector uses."""


def columns(effect: str, features: tuple[str, ...]) -> tuple[int, ...]:
    """Indices of the features that an effect may show in, see `Effect.features`; all for an unknown effect.

    `features` are names as in `comparison.feature_names`.
    """
    return _columns(catalogue().get(effect), features)


@cache
def _columns(kind: type[Effect] | None, features: tuple[str, ...]) -> tuple[int, ...]:
    if kind is None or not kind.features:
        return tuple(range(len(features)))
    return tuple(i for i, feature in enumerate(features) if _may_tell(kind, feature))


def _may_tell(kind: type[Effect], feature: str) -> bool:
    """Whether a feature is an input of an effect's detector."""
    of, _, about = feature.partition("|")
    if of == "distance":  # distance between records and twin in a domain
        return True
    if of == "context":
        return about in _ALWAYS or _matches(feature, kind)
    if of in _OF_THE_SET:
        return _matches(feature, kind)
    # Trends over conditions are used only for effects that declare them.
    return _matches(of, kind) and (not about.startswith("on_") or about.startswith(kind.trends))


def _matches(feature: str, kind: type[Effect]) -> bool:
    """Whether one of the effect's patterns matches a feature."""
    return any(fnmatchcase(feature, pattern) for pattern in kind.features)
