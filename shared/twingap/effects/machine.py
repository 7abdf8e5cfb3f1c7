"""Protocol of a machine, from which effects draw plausible values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from twingap.bearing import Bearing
from twingap.effects.modes import Mode
from twingap.records import Condition


class Parameters(Protocol):
    """Parameters of the machine's phenomenological twin.

    Attributes
    ----------
    resonance_hz, damping_ratio : float
        Of its own mode.
    structure_noise_rms, white_noise_rms : float
        Parts of the healthy vibration: noise that passes the mode, and noise that does not.
    impact_amplitude : Mapping[str, float]
        Fault to the amplitude of its impacts.
    """

    @property
    def resonance_hz(self) -> float: ...
    @property
    def damping_ratio(self) -> float: ...
    @property
    def structure_noise_rms(self) -> float: ...
    @property
    def white_noise_rms(self) -> float: ...
    @property
    def impact_amplitude(self) -> Mapping[str, float]: ...


class Machine(Protocol):
    """A machine whose records are to be simulated.

    Attributes
    ----------
    bearing : Bearing
        Geometry of the bearing under test.
    parameters : Parameters
    conditions : tuple of Condition
        Of its records, all at one sampling rate.
    modes : tuple of Mode
        Of its structure, beside the one in `parameters`.
    """

    @property
    def bearing(self) -> Bearing: ...
    @property
    def parameters(self) -> Parameters: ...
    @property
    def conditions(self) -> tuple[Condition, ...]: ...
    @property
    def modes(self) -> tuple[Mode, ...]: ...
