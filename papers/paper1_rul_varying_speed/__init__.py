"""Paper 1: remaining life under varying speed, from simulated run-to-failure records.

healthy rows --> S(k) --> anomaly --> D(k) --> simulated lives, labelled --+
                                                                           +--> one of five models --> remaining life
rows after the anomaly, no labels -----------------------------------------+

Used in: Simulation-based remaining useful life prediction of rolling element bearings under varying operating
conditions. Equations of general use are in `twingap.prognosis`, the paper's own in `methods/`.
"""
