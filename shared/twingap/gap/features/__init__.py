"""What is measured on a record: named, dimensionless numbers, each moved by some effect and little by others.

RecordView --events, lines, background, converter, answer--> one number per name, NaN where it does not apply
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.acquisition import features as converter
from twingap.gap.features.impacts import features as events
from twingap.gap.features.impacts import impulse_response as answer
from twingap.gap.features.spectrum import features as background
from twingap.gap.features.tones import features as lines
from twingap.signal.record_transforms import RecordView

_KINDS: Final = {"events": events, "lines": lines, "background": background, "converter": converter, "answer": answer}

NAMES: Final[tuple[str, ...]] = tuple(f"{kind}.{name}" for kind, module in _KINDS.items() for name in module.NAMES)
"""Of what `measure` returns, in its order."""


def measure(view: RecordView) -> NDArray[np.float64]:
    """[signatures] All signatures of one record."""
    found: dict[str, float] = {}
    for kind, module in _KINDS.items():
        for name, value in module.measure(view).items():
            found[f"{kind}.{name}"] = value
    values = np.array([found[name] for name in NAMES], float)
    return np.where(np.isfinite(values), np.clip(values, -1e6, 1e6), np.nan)


__all__ = ["NAMES", "measure"]
