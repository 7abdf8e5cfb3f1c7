"""Distances between records and twin: feature vectors, tests, localisation, closure.

records --feature_vectors--> vector of bins in each domain (`domains`: how to add one), on the bins of `grid`
vectors, measured and simulated --paired--> gap --localisation--> places; --two_sample_tests--> p-values
gap before and after effects are added --closure, closure_metrics (how to add a measure)--> what they close
"""
