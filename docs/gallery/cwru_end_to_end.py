"""
CWRU end to end
===============

From public recordings to a diagnosis: the drive-end records of Case Western Reserve University's bearing data center,
compared with the phenomenological twin.

.. only:: without_data

   .. note::

      This page was built without the recordings, so it shows no results. ``twingap data fetch cwru --root data`` and
      the environment variable ``TWINGAP_DATA`` bring them.
"""

# %%
# Records
# -------
#
# A data set is read by its name. Of each recording at one load three pieces of half a second are taken; pieces of one
# recording share a group, so that they never stand on both sides of a split.

import twingap
from twingap.data import cut, load, where
from twingap.twins import TwinSpec

recordings = where(load("cwru"), ["load_hp=2"])
records = cut(recordings, duration_s=0.5, step=40000)
records.table[["record", "fault", "speed_rpm", "fs_hz", "group"]].head()

# %%
# The twin's free parameters
# --------------------------
#
# The twin file states what is modelled. What it leaves out is identified from the records, with intervals where there
# are recordings enough to tell.

twin = TwinSpec("phenomenological", effects=("slip_jitter", "load_zone"))
identified = twingap.identify(records, twin, seed=0)
for name, estimate in identified.estimates.items():
    interval = "" if estimate.interval is None else "(90 % interval {:.3g} to {:.3g})".format(*estimate.interval)
    print(f"{name}: {estimate.value:.3g} {interval}")

# %%
# The diagnosis
# -------------
#
# ``diagnose`` calibrates by itself, on a part of the records, so it is given the twin as it was.

found = twingap.diagnose(records, twin, seed=0)
print(found.report.sentence)

# %%
# Where the gap lies, largest share first:

found.report.where[["domain", "lo", "hi", "unit", "share"]].head(6).round(2)

# %%
# What is named, and what adding it closes:

named = found.report.which
named[named.effect.isin(found.report.verdict.effects)][["effect", "probability", "closure"]].round(2)

# %%
# Fault classes without labels
# ----------------------------
#
# A classifier that has seen simulated machines only reads lines at the bearing's orders and levels. Faults of the
# records are dropped before anything else is done.

predictions = twingap.classify(recordings, twin)
for name, predicted, confidence in zip(predictions.names, predictions.predicted, predictions.confidence, strict=True):
    print(f"{name}: {predicted} ({confidence:.2f})")
