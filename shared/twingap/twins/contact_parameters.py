"""Parameters of the contact twin, its presets, and quantities that follow from geometry and Hertz's theory."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Final, Literal

from twingap.bearing import Bearing
from twingap.effects import parameter
from twingap.errors import TwingapError

DEFECTS: Final = ("inner", "outer", "ball")
"""Faults of the contact model; a broken cage is not included."""


@dataclass(frozen=True)
class ContactParameters:
    """Parameters of the contact twin. The defaults are the `physical` preset, for a 6205 on a test bench.

    Parameters
    ----------
    stiffness : float
        K of the law Q = K delta^n, N/m^1.5 (N/m^(10/9) for cylinders), ring to ring through a roller. See
        `hertz_stiffness`. The papers print N/m, which a Hertz law does not have.
    damping : float
        c, N s/m, in each direction.
    mass_kg : float
        m, inner ring and the part of the shaft that moves with it.
    load_n, load_x_n : float
        F_y and F_x, N. A record's own `load_n` takes the place of F_y.
    clearance_um : float
        u, radial, um; negative is interference.
    eccentricity_um : float
        e, um, of the unbalance m e w^2.
    defect_depth_um : dict[str, float]
        Fault -> h, um: by how much a roller sinks in the middle of the defect. See `sink_depth_um` for what geometry
        allows.
    defect_width_mm : float
        Width of the defect along the raceway (for "ball": along the ball's circumference), mm.
    outer_angle_deg : float
        Where the outer race's defect is: 90 is the load's direction.
    edge : float
        Part of the defect's half width over which the depth rises; 1 is a smooth dip with no floor, 0 the papers' jump.
    contact : {"point", "line"}
        Balls (n = 3/2) or cylinders (n = 10/9).
    scale : float
        Record units per m/s^2 of the model, noises included.
    structure_noise_rms : float
        RMS, after the contact mode and in m/s^2 of the model, of the response to a broadband force.
    white_noise_rms : float
        RMS of the white noise of the measuring chain, m/s^2 of the model.
    oversampling : int or None
        Internal steps per sample, even; None: chosen from the fastest contact mode and the shortest edge.

    Raises
    ------
    TwingapError
        For a value that no bearing can have.
    """

    stiffness: float = parameter(
        9.3e9, unit="N/m^1.5", plausible=(1e9, 2e10), allowed=(1e3, 1e14), log=True, doc="contact stiffness"
    )
    damping: float = parameter(
        400.0, unit="N s/m", plausible=(50.0, 3000.0), allowed=(0.0, 1e7), log=True, doc="viscous damping"
    )
    mass_kg: float = parameter(0.6, unit="kg", plausible=(0.1, 10.0), allowed=(1e-4, 1e5), log=True, doc="moving mass")
    load_n: float = parameter(
        500.0, unit="N", plausible=(50.0, 5000.0), allowed=(0.0, 1e7), log=True, doc="radial load"
    )
    load_x_n: float = parameter(0.0, unit="N", plausible=(-500.0, 500.0), allowed=(-1e7, 1e7), doc="load across")
    clearance_um: float = parameter(
        5.0, unit="um", plausible=(-5.0, 20.0), allowed=(-1000.0, 1000.0), doc="radial clearance"
    )
    eccentricity_um: float = parameter(0.0, unit="um", plausible=(0.0, 20.0), allowed=(0.0, 1e4), doc="unbalance")
    defect_depth_um: dict[str, float] = field(default_factory=lambda: dict.fromkeys(DEFECTS, 1.0))
    defect_width_mm: float = parameter(
        0.178, unit="mm", plausible=(0.1, 2.0), allowed=(1e-4, 1e3), log=True, doc="width of the defect"
    )
    outer_angle_deg: float = parameter(
        90.0, unit="deg", plausible=(60.0, 120.0), allowed=(-360.0, 360.0), doc="angle of an outer-race defect"
    )
    edge: float = parameter(1.0, unit="", plausible=(0.2, 1.0), allowed=(0.0, 1.0), doc="smooth part of the half width")
    contact: Literal["point", "line"] = "point"
    scale: float = parameter(1.0, unit="", plausible=(1e-3, 10.0), allowed=(1e-12, 1e12), log=True, doc="units")
    structure_noise_rms: float = parameter(
        0.5, unit="m/s^2", plausible=(0.01, 10.0), allowed=(0.0, 1e9), log=True, doc="structure noise"
    )
    white_noise_rms: float = parameter(
        0.3, unit="m/s^2", plausible=(0.01, 10.0), allowed=(0.0, 1e9), log=True, doc="white noise"
    )
    oversampling: int | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "defect_depth_um", dict(self.defect_depth_um))
        where = "contact parameters"
        for each in fields(self):
            if not (allowed := each.metadata.get("allowed")):
                continue
            value, unit = getattr(self, each.name), each.metadata["unit"] or "a number"
            number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if not (number and math.isfinite(value) and allowed[0] <= value <= allowed[1]):
                raise TwingapError(
                    f"{each.name} = {value!r}, {unit} between {allowed[0]:g} and {allowed[1]:g} expected", where=where
                )
        for fault, depth in self.defect_depth_um.items():
            if fault not in DEFECTS:
                raise TwingapError(
                    f"defect_depth_um for unknown fault {fault!r}", where=where, mend=f"use {', '.join(DEFECTS)}"
                )
            if not (math.isfinite(depth) and 0 <= depth <= 1e4):
                raise TwingapError(f"defect_depth_um.{fault} = {depth!r}, um between 0 and 10000 expected", where=where)
        if self.contact not in ("point", "line"):
            raise TwingapError(f"contact = {self.contact!r}, 'point' or 'line' expected", where=where)
        if self.oversampling is not None and (self.oversampling % 2 or not 2 <= self.oversampling <= 4096):
            raise TwingapError(
                f"oversampling = {self.oversampling!r}, an even number from 2 to 4096 expected", where=where
            )

    @property
    def exponent(self) -> float:
        """n of the contact law."""
        return 1.5 if self.contact == "point" else 10 / 9


def sink_depth_um(width_mm: float, roller_diameter_mm: float) -> float:
    """Depth to which a ball sinks into a pit of this width until it touches both edges, um, for flat races.

    1.0, 4.0 and 8.9 um for a 7.94 mm ball and pits of 0.007, 0.014 and 0.021 inch.
    """
    radius, half = roller_diameter_mm / 2, min(width_mm / 2, roller_diameter_mm / 2)
    return 1e3 * (radius - math.sqrt(radius**2 - half**2))


def hertz_stiffness(bearing: Bearing, conformity: float = 0.52, modulus_pa: float = 2.06e11) -> float:
    """Stiffness K of a ball between both races, N/m^1.5, for steel and a given groove radius over ball diameter.

    By the formulas of Hamrock and Brewe (doi:10.1115/1.3254584) for each contact, and K^(-2/3) = Ki^(-2/3) + Ko^(-2/3)
    for both in series. 9.3e9 for the 6205.
    """
    d, g = 1e-3 * bearing.roller_diameter_mm, bearing.ratio
    reduced = modulus_pa / (1 - 0.3**2)
    flexibility = 0.0
    for along in (2 / d * (1 + g / (1 - g)), 2 / d * (1 - g / (1 + g))):
        across = (2 - 1 / conformity) / d
        ratio = along / across
        k, slope = ratio ** (2 / math.pi), math.pi / 2 - 1
        elliptic_e, elliptic_f = 1 + slope / ratio, math.pi / 2 + slope * math.log(ratio)
        stiffness = math.pi * k * reduced * math.sqrt(elliptic_e / (along + across) / (4.5 * elliptic_f**3))
        flexibility += stiffness ** (-2 / 3)
    return float(flexibility**-1.5)


PRESETS: Final[Mapping[str, ContactParameters]] = {
    # As printed in paper 3: K, c, F_y and the depth. The load exceeds the 6205's static rating (7.8 kN) and squeezes
    # the contacts by 0.3 mm; a 7.94 mm ball sinks 50 um only into a pit 1.26 mm wide. That width, 0.6 kg and
    # no clearance are assumptions, since the text states none. It vibrates about a hundred times more than a real
    # bearing.
    "paper": ContactParameters(
        stiffness=1.27e9, damping=139.0, mass_kg=0.6, load_n=12000.0, clearance_um=0.0, edge=0.0, defect_width_mm=1.26,
        defect_depth_um=dict.fromkeys(DEFECTS, 50.0),
    ),
    # K by `hertz_stiffness`, a fifteenth of the static rating, the clearance of a mounted bearing of normal class, 3 %
    # damping, and the depth that a ball reaches in a pit of 0.007 inch. Its vibration is similar to that of CWRU's
    # records.
    "physical": ContactParameters(),
}  # fmt: skip
"""Presets by name, for the 6205 of the papers' rigs."""
