"""Distances between records and twin: feature vectors, tests, localisation, closure."""
