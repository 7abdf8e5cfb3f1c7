"""Bearing geometry and its kinematic fault orders.

Orders are multiples of the shaft speed, for a fixed outer ring and rolling without slip.
Source: eq. 5 of paper 1 (Simulation-based remaining useful life prediction of rolling element bearings under varying
operating conditions), the usual kinematic relations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, get_args

from twingap.errors import TwingapError

Fault = Literal["healthy", "inner", "outer", "ball", "cage"]
FAULTS: Final[tuple[str, ...]] = get_args(Fault)


@dataclass(frozen=True)
class Bearing:
    """Geometry of one rolling-element bearing.

    Parameters
    ----------
    name : str
        Designation.
    n_rollers : int
        Number of rolling elements Z, at least 3.
    roller_diameter_mm, pitch_diameter_mm : float
        Diameters d and D in mm, 0 < d < D.
    contact_angle_deg : float
        Contact angle in degrees, 0 <= angle < 90.

    Raises
    ------
    TwingapError
        For an impossible geometry.
    """

    name: str
    n_rollers: int
    roller_diameter_mm: float
    pitch_diameter_mm: float
    contact_angle_deg: float = 0.0

    def __post_init__(self) -> None:
        where = f"bearing {self.name!r}"
        if self.n_rollers < 3:
            raise TwingapError(f"n_rollers = {self.n_rollers}, expected at least 3", where=where)
        if not 0 < self.roller_diameter_mm < self.pitch_diameter_mm < math.inf:
            raise TwingapError(
                f"roller_diameter_mm = {self.roller_diameter_mm:g}, pitch_diameter_mm = {self.pitch_diameter_mm:g}, "
                "expected 0 < roller < pitch",
                where=where,
            )
        if not 0 <= self.contact_angle_deg < 90:
            raise TwingapError(f"contact_angle_deg = {self.contact_angle_deg:g}, expected 0 <= angle < 90", where=where)
        # Neighbouring rollers may touch but not overlap on the pitch circle.
        if self.roller_diameter_mm > self.pitch_diameter_mm * math.sin(math.pi / self.n_rollers):
            raise TwingapError(
                f"{self.n_rollers} rollers of {self.roller_diameter_mm:g} mm do not fit on a pitch circle of "
                f"{self.pitch_diameter_mm:g} mm",
                where=where,
                mend="check the units (mm) and the number of rollers",
            )

    @property
    def ratio(self) -> float:
        """(d / D) cos(contact angle), dimensionless."""
        return self.roller_diameter_mm / self.pitch_diameter_mm * math.cos(math.radians(self.contact_angle_deg))

    @property
    def ftf(self) -> float:
        """Cage (fundamental train) order: turns of the cage per turn of the shaft."""
        return 0.5 * (1 - self.ratio)

    @property
    def bpfo(self) -> float:
        """Ball-pass order of the outer race."""
        return self.n_rollers * self.ftf

    @property
    def bpfi(self) -> float:
        """Ball-pass order of the inner race. BPFO + BPFI = Z."""
        return self.n_rollers * (1 - self.ftf)

    @property
    def bsf(self) -> float:
        """Ball-spin order: turns of a roller about its own axis, per turn of the shaft, seen from the cage."""
        return 0.5 * self.pitch_diameter_mm / self.roller_diameter_mm * (1 - self.ratio**2)

    def fault_order(self, fault: str) -> float:
        """Order at which a defect of this kind causes impacts.

        A ball defect meets both races once per spin, so its impacts occur at 2 BSF (public records and paper 3's
        "141.17 Hz" agree); eq. 5 of paper 1 gives BSF, of which 2 BSF is the second harmonic.

        Parameters
        ----------
        fault : {"inner", "outer", "ball", "cage"}

        Returns
        -------
        float
            Impacts per shaft turn.
        """
        orders = {"inner": self.bpfi, "outer": self.bpfo, "ball": 2 * self.bsf, "cage": self.ftf}
        try:
            return orders[fault]
        except KeyError:
            raise TwingapError(f"no fault order for fault {fault!r}", mend=f"use one of {', '.join(orders)}") from None

    def side_line_order(self, fault: str, cage_speed_ratio: float = 1.0) -> float | None:
        """Distance, in shaft orders, of the side lines of a defect's impacts: its turns through the load zone.

        1 for the inner race, the order of the cage for a rolling element; None where the defect does not turn through
        the zone (outer race) or carries no load (cage). `cage_speed_ratio` as in `slipped`.
        """
        return {"inner": 1.0, "ball": self.ftf * cage_speed_ratio}.get(fault)

    def slipped(self, cage_speed_ratio: float) -> dict[str, float]:
        """Fault orders when the cage runs at `cage_speed_ratio` times its kinematic speed.

        BPFO scales with the cage, BPFI = Z - BPFO changes in the opposite direction; the rollers are assumed to roll
        on the inner ring, so that the spin order follows the speed of the inner ring relative to the cage.

        Parameters
        ----------
        cage_speed_ratio : float
            Cage speed over kinematic cage speed, dimensionless; 1 is no slip.

        Returns
        -------
        dict[str, float]
            Fault -> impacts per shaft turn.
        """
        cage = self.ftf * cage_speed_ratio
        return {
            "inner": self.n_rollers * (1 - cage),
            "outer": self.n_rollers * cage,
            "ball": 2 * self.bsf * (1 - cage) / (1 - self.ftf),
            "cage": cage,
        }


def _by_name(*bearings: Bearing) -> dict[str, Bearing]:
    return {bearing.name: bearing for bearing in bearings}


PUBLIC_BEARINGS: Final[dict[str, Bearing]] = _by_name(
    Bearing("6205", 9, 7.94, 39.04, 0.0),  # CWRU drive end, HIT-SM, Smart Maintenance
    Bearing("6203", 8, 6.746, 28.4988, 0.0),  # CWRU fan end
    Bearing("ZA-2115", 16, 8.4074, 71.501, 15.17),  # IMS
    Bearing("PRONOSTIA", 13, 3.5, 25.6, 0.0),  # FEMTO
    Bearing("UER204", 8, 7.92, 34.55, 0.0),  # XJTU-SY
)
"""Bearings of public data sets, by name. Training draws from them: another one makes other simulated machines."""
BEARINGS: Final[dict[str, Bearing]] = PUBLIC_BEARINGS | _by_name(
    Bearing("6203-PU", 8, 6.75, 28.55, 0.0),  # Paderborn
    Bearing("NICE", 8, 5.969, 31.623, 0.0),  # MFPT
    Bearing("ER-12K", 8, 7.938, 33.477, 0.0),  # SpectraQuest simulators
    Bearing("ER-16K", 9, 7.938, 38.506, 0.0),  # SpectraQuest simulators, University of Ottawa
    Bearing("6204", 8, 7.938, 33.5, 0.0),
    Bearing("6206", 9, 9.525, 46.0, 0.0),
    Bearing("6207", 9, 11.112, 53.5, 0.0),
    Bearing("6308", 8, 15.081, 65.0, 0.0),
)
"""Known bearings by name. Manufacturers' geometries of one designation differ slightly."""
