"""Remaining life of the FEMTO learning bearings by the score of the PHM 2012 challenge: one prediction at each cut."""
