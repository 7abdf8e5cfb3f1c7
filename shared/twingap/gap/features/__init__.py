"""Features: named numbers measured on records, and their comparison between measured and simulated records.

record --registry.measure--> record features -----------------+
both sets of records --comparison.compare (registry)----------+--> one vector of named features

`registry` lists all features and describes how to add one.
"""
