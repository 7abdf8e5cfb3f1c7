"""Sources that several effects cite."""

from __future__ import annotations

from typing import Final

RANDALL_ANTONI: Final = (
    "Randall & Antoni 2011, Rolling element bearing diagnostics - a tutorial, doi:10.1016/j.ymssp.2010.07.017"
)
RANDALL_BOOK: Final = "Randall 2011, Vibration-based condition monitoring, Wiley"
PAPER1: Final = "paper 1, Simulation-based remaining useful life prediction of rolling element bearings"
MCFADDEN: Final = (
    "McFadden & Smith 1984, Model for the vibration produced by a single point defect in a rolling element bearing"
)
IEEE_1057: Final = "IEEE Std 1057, Digitizing waveform recorders"
ISO_13373: Final = "ISO 13373-3, Guidelines for vibration diagnosis"
