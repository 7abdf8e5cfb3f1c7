"""Truth about a world, and seals that show that it was not changed after the diagnosis had begun.

Truth --canonical JSON--> text --sha256 with nonce--> seal;  seal + text + nonce --open_seal--> Truth, or an error

The seal is published, truth and nonce are kept. Without the nonce, the few possible truths could be tried one by one.
"""

from __future__ import annotations

import hashlib
import hmac
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from twingap.errors import TwingapError

Parameters = Mapping[str, Any]


@dataclass(frozen=True)
class Truth:
    """Effects, parameters, speeds and base machine of a world.

    Parameters
    ----------
    case, kind, arm : str
    seed : int
    effects : tuple of str
        Catalogued effects that the records have and the baseline lacks.
    parameters : Mapping[str, Mapping[str, Any]]
        Effect -> physical quantities with the unit in their names, catalogued or not.
    strength : Mapping[str, str]
        Strength of each effect, catalogued or not.
    uncatalogued : tuple of str
        Effects outside the catalogue.
    bearing : Mapping[str, Any]
    fs_hz : float
    speed_rpm : tuple of float
        True mean speed of each record; the records state other values.
    base : Mapping[str, Any]
        The machine without effects: modes, noise, impact levels, gain, its own effects.
    notes : tuple of str
    """

    case: str
    kind: str
    arm: str
    seed: int
    effects: tuple[str, ...]
    parameters: Mapping[str, Parameters]
    strength: Mapping[str, str]
    uncatalogued: tuple[str, ...]
    bearing: Parameters
    fs_hz: float
    speed_rpm: tuple[float, ...]
    base: Parameters = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def to_json(self) -> str:
        """Canonical JSON: sorted keys, no spaces, shortest floats that read back as equal, no NaN."""
        return json.dumps(asdict(self), sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=True)

    @classmethod
    def from_json(cls, text: str) -> Truth:
        """The inverse of `to_json`.

        Raises
        ------
        TwingapError
            When the text is no truth.
        """
        try:
            values = json.loads(text)
            names = {f.name for f in fields(cls)}
            if not isinstance(values, dict) or set(values) != names:
                raise ValueError("its keys are not those of a truth")
        except ValueError as error:
            raise TwingapError(f"is no truth of a world: {error}", where="sealed truth") from None
        for name in ("effects", "uncatalogued", "speed_rpm", "notes"):
            values[name] = tuple(values[name])
        return cls(**values)


def seal(truth: Truth | str, nonce: str) -> str:
    """Seal of a truth: a digest that fixes it without revealing it.

    Parameters
    ----------
    truth : Truth or str
        The truth, or its canonical JSON.
    nonce : str
        Random text of at least 16 characters, secret until the seal is opened.

    Returns
    -------
    str
        Hex sha256.

    Raises
    ------
    TwingapError
        For a nonce that is too short.
    """
    if len(nonce) < 16:
        raise TwingapError(f"nonce of {len(nonce)} characters, at least 16 expected", where="seal")
    text = truth.to_json() if isinstance(truth, Truth) else truth
    # With the nonce's length first, no characters can move from the nonce to the text.
    return hashlib.sha256(f"{len(nonce)}:{nonce}:{text}".encode()).hexdigest()


def open_seal(sealed: str, truth: Truth | str, nonce: str) -> Truth:
    """The truth, verified against its seal.

    Parameters
    ----------
    sealed : str
        From `seal`.
    truth : Truth or str
        The truth, or its canonical JSON.
    nonce : str

    Raises
    ------
    TwingapError
        When truth or nonce are not those of the seal.
    """
    text = truth.to_json() if isinstance(truth, Truth) else truth
    if not hmac.compare_digest(seal(text, nonce), sealed):
        raise TwingapError("truth or nonce are not those that were sealed", where=f"seal {sealed[:12]}")
    return Truth.from_json(text)
