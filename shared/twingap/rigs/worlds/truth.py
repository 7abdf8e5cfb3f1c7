"""What a world was made of, and seals that keep it from being changed once the diagnosis has begun.

Truth --canonical JSON--> text --sha256 with nonce--> seal;  seal + text + nonce --open_seal--> Truth, or an error

Publish the seal, keep truth and nonce; the nonce keeps the few possible truths from being found by trying them all.
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
    """What a world is made of.

    Parameters
    ----------
    case, kind, arm : str
    seed : int
    effects : tuple of str
        Catalogued effects that the records have and the baseline has not.
    parameters : Mapping[str, Mapping[str, Any]]
        Of effects and outsiders, by name: physical quantities with the unit in their names.
    strength : Mapping[str, str]
        Of each effect and outsider.
    outsiders : tuple of str
        Effects that the catalogue does not know.
    bearing : Mapping[str, Any]
    fs_hz : float
    speed_rpm : tuple of float
        True mean speeds, one a record (the records state others).
    base : Mapping[str, Any]
        Of the machine without effects: modes, noise, impact levels, gain, what it has of its own.
    notes : tuple of str
    """

    case: str
    kind: str
    arm: str
    seed: int
    effects: tuple[str, ...]
    parameters: Mapping[str, Parameters]
    strength: Mapping[str, str]
    outsiders: tuple[str, ...]
    bearing: Parameters
    fs_hz: float
    speed_rpm: tuple[float, ...]
    base: Parameters = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def to_json(self) -> str:
        """Canonical: sorted keys, no spaces, shortest floats that read back alike, no NaN."""
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
                raise ValueError("other keys than a truth has")
        except ValueError as error:
            raise TwingapError(f"is no truth of a world: {error}", where="sealed truth") from None
        for name in ("effects", "outsiders", "speed_rpm", "notes"):
            values[name] = tuple(values[name])
        return cls(**values)


def seal(truth: Truth | str, nonce: str) -> str:
    """Seal a truth.

    Parameters
    ----------
    truth : Truth or str
        Or its canonical JSON.
    nonce : str
        Random and secret until the opening, at least 16 characters.

    Returns
    -------
    str
        Hex sha256.

    Raises
    ------
    TwingapError
        For a nonce that could be guessed.
    """
    if len(nonce) < 16:
        raise TwingapError(f"nonce of {len(nonce)} characters, at least 16 expected", where="seal")
    text = truth.to_json() if isinstance(truth, Truth) else truth
    # The nonce's length goes first, so that no characters can move from the nonce to the text.
    return hashlib.sha256(f"{len(nonce)}:{nonce}:{text}".encode()).hexdigest()


def open_seal(sealed: str, truth: Truth | str, nonce: str) -> Truth:
    """The truth, if it is the one that was sealed.

    Parameters
    ----------
    sealed : str
        From `seal`.
    truth : Truth or str
        As revealed, or its canonical JSON.
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
