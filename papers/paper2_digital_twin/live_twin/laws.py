"""Laws of clearance and damping with temperature."""

import math
from dataclasses import dataclass

from twingap import Bearing, TwingapError


@dataclass(frozen=True)
class Laws:
    """How clearance and damping follow temperature, and the temperature at which the twin's own hold.

    Radial clearance shrinks as the inner ring grows warmer than the outer one: u(T) = u(T_ref) - (1/2) alpha D excess
    (T - T_ref), D the pitch diameter (SKF, Rolling Bearings: 0.012 um per K and mm of mean diameter, both sides of the
    shaft together). The inner ring's lead is taken as a fixed part of the outer one's rise; rings and balls of one
    temperature grow alike and change nothing.

    One part of the damping follows the oil's viscosity: c(T) / c(T_ref) = (1 - film) + film (nu(T) / nu(T_ref))^power.
    Reynolds' equation is linear in viscosity, so that a film squeezed at small amplitude damps with power 1; nu follows
    Walther's equation (ASTM D341), log10 log10(nu + 0.7) = A - B log10(T / K), through two points of a data sheet.
    """

    reference_c: float = 40.0
    expansion: float = 12e-6  # alpha, 1/K; of bearing steel
    # By how much the inner ring outruns the outer one's rise, a fraction. 5 to 10 K are usual at 40 K of rise.
    excess: float = 0.15
    # nu40, nu100: kinematic viscosity at 40 and 100 deg C, mm^2/s. The defaults are an ISO VG 32 oil's.
    nu40: float = 32.0
    nu100: float = 5.4
    film: float = 0.8  # part of the damping at the reference temperature that is the film's
    power: float = 1.0
    # the structure's broadband force grows with speed to this power; rolling noise of rough surfaces: 1
    speed_power: float = 1.0

    def __post_init__(self) -> None:
        if not 0 < self.nu100 < self.nu40 < math.inf:
            raise TwingapError(
                f"nu40 = {self.nu40!r}, nu100 = {self.nu100!r}: 0 < nu100 < nu40 expected", where="damping law"
            )
        if not 0 <= self.film <= 1:
            raise TwingapError(f"film = {self.film!r}, between 0 and 1 expected", where="damping law")

    def clearance_change_um(self, bearing: Bearing, temperature_c: float) -> float:
        """What is added to the clearance, um, at this temperature of the outer ring."""
        rise_k = temperature_c - self.reference_c
        return -0.5 * self.expansion * 1e3 * bearing.pitch_diameter_mm * self.excess * rise_k

    def viscosity(self, temperature_c: float) -> float:
        """Kinematic viscosity, mm^2/s. Held at the ends of -30 and 200 deg C, beyond which the law is not stated."""
        kelvin = min(max(temperature_c, -30.0), 200.0) + 273.15
        at40, at100 = (math.log10(math.log10(nu + 0.7)) for nu in (self.nu40, self.nu100))
        slope = (at40 - at100) / (math.log10(373.15) - math.log10(313.15))
        return math.pow(10, math.pow(10, at40 - slope * (math.log10(kelvin) - math.log10(313.15)))) - 0.7

    def damping_factor(self, temperature_c: float) -> float:
        """c(T) / c(T_ref)."""
        thinner = self.viscosity(temperature_c) / self.viscosity(self.reference_c)
        return 1 - self.film + self.film * math.pow(thinner, self.power)
