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
# A data set is read by its name. This page uses recordings of a healthy bearing and of the smallest faults of its races
# at two motor loads, two pieces of half a second from each. Pieces of one recording share a group, so that a split never
# separates them.

import matplotlib.pyplot as plt

import twingap
from twingap.data import cut, load
from twingap.twins import TwinSpec

everything = load("cwru")
table = everything.table
wanted = (
    table.load_hp.isin([0, 2])
    & table.fault_size_inch.isin([0, 0.007])
    & (table.fault != "ball")
)
recordings = everything.take(table[wanted].index)
pieces = cut(recordings, duration_s=0.5, step=50000)
records = pieces.take(pieces.table.groupby("group").head(2).index)
records.table[["record", "fault", "speed_rpm", "fs_hz", "group"]].head()

# %%
# The twin's free parameters
# --------------------------
#
# The twin file states what is modelled. What it leaves out is identified from the records, with intervals where there
# are enough recordings.

twin = TwinSpec("phenomenological")
identified = twingap.identify(records, twin, seed=0)
for name, estimate in identified.estimates.items():
    interval = (
        ""
        if estimate.interval is None
        else "(90 % interval {:.3g} to {:.3g})".format(*estimate.interval)
    )
    print(f"{name}: {estimate.value:.4g} {interval}")

# %%
# The diagnosis
# -------------
#
# ``diagnose`` calibrates by itself, on a part of the records, so it takes the original twin. A quick diagnosis leaves
# out the :term:`closest twin`.

found = twingap.diagnose(records, twin, seed=0, quick=True)
print(found.report.sentence)

# %%
# Six seconds of six recordings are enough to show that there is a gap, and where it lies. They are not enough to tell
# what causes it: real machines have much that no effect describes, and many explanations fit. A diagnosis of more
# recordings is more conclusive but takes minutes, so it is left out here::
#
#     recordings = where(load("cwru"), ["load_hp=2"])  # from twingap.data
#     found = twingap.diagnose(cut(recordings, duration_s=1.0), twin)
#     print(found.report.closest.sentence)  # what the closest twin closes, and which effects close it
#
# Where the gap lies, largest share first:

found.report.where[["domain", "lo", "hi", "unit", "share"]].head(6).round(2)

# %%
# The most probable effects, and what adding each of them closes:

found.report.which[["effect", "probability", "closure"]].head(5).round(2)

# %%
# The curves of the report are data too. These are the median spectra of the held-out records and of the twin.

curve = found.report.curves["spectrum"]
fig, ax = plt.subplots(figsize=(8, 3.2))
ax.plot(curve.x, curve.real, label="records", color="black", linewidth=1)
ax.plot(curve.x, curve.before, label="twin", linewidth=1)
if curve.after is not None:
    ax.plot(curve.x, curve.after, label="twin with the named effects", linewidth=1)
ax.set(xlabel=curve.x_unit, ylabel=curve.y_unit)
ax.legend(frameon=False)
plt.show()

# %%
# Fault classes without labels
# ----------------------------
#
# The classifier was trained on simulated machines only; it uses lines at the bearing's orders, and levels. The faults of
# the records are dropped first.

predictions = twingap.classify(recordings, twin)
for name, predicted, confidence in zip(
    predictions.names, predictions.predicted, predictions.confidence, strict=True
):
    print(f"{name}: {predicted} ({confidence:.2f})")
