"""Measurements that distinguish effects which look alike in one set of records."""

from __future__ import annotations

from typing import Final

TACHO: Final = (
    "record a tacho or encoder signal along with the vibration: it measures the shaft angle, so that whatever "
    "stays in the lines after order tracking belongs to the cage and not to the shaft"
)
OTHER_SPEED: Final = (
    "record the same machine at another speed: lines of mains, drive and structure stay at their frequency, lines of "
    "shaft, gears and bearings move with the speed"
)
HAMMER: Final = (
    "strike the housing with an instrumented hammer at standstill: the response shows the modes and the sensor's "
    "roll-off without the bearing's excitation"
)
BACKGROUND: Final = (
    "record the background with the bearing unloaded or at standstill and its surroundings running: noise stays, "
    "what the bearing excites vanishes"
)
CHAIN: Final = (
    "check the acquisition: range and resolution of the converter against the largest sample, and whether "
    "samples were lost on the way"
)
LONGER: Final = (
    "record longer, at one constant speed and load: lines of the envelope spectrum then narrow down to what truly "
    "broadens them"
)
LOAD: Final = (
    "record at another radial load: modulation by the load zone changes with it, modulation by the cage hardly does"
)
ALONG: Final = (
    "take more records along the run, at the same speed and load, to distinguish growth from operating conditions"
)
