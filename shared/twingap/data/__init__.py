"""Public data sets: manifests, verification, download, and one reader each.

File locations are known to this package alone: `load("cwru", fs_hz=12000.0)` gives a `RecordSet` like any other.
"""

from twingap.data.cards import Card, card_of
from twingap.data.cut import cut
from twingap.data.manifest import DataFile, Manifest, manifest_names, manifest_of
from twingap.data.registry import READERS, load
from twingap.data.resample import resampled
from twingap.data.root import NotAtHandError, data_root
from twingap.data.where import where

__all__ = [
    "READERS",
    "Card",
    "DataFile",
    "Manifest",
    "NotAtHandError",
    "card_of",
    "cut",
    "data_root",
    "load",
    "manifest_names",
    "manifest_of",
    "resampled",
    "where",
]
