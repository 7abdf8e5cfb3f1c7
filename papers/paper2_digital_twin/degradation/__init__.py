"""Degradation study: which indicator, which curve, and the remaining life that each predicts."""
