"""Remaining life of the six FEMTO learning bearings: the online estimator beside its rivals."""
