"""
Read a report
=============

A diagnosis writes ``gap.json`` for programs and ``report.html`` for people, a page that opens without a network. This
tutorial makes one and reads it from top to bottom.
"""

# %%
# A machine that picks up hum of the mains, which its twin does not have.

import tempfile

import twingap
from twingap import BEARINGS, Condition
from twingap.twins import TwinSpec

bearing = BEARINGS["6205"]
conditions = [
    Condition(f"{fault} {i}", speed_rpm=1750, fs_hz=12000, n_samples=8192, fault=fault)
    for fault in ("healthy", "inner", "outer")
    for i in range(4)
]
machine = TwinSpec("phenomenological", effects=("mains_interference",), bearing=bearing)
records = twingap.simulate(conditions, machine, seed=2)
found = twingap.diagnose(records, TwinSpec("phenomenological", bearing=bearing), seed=0)
written = found.write(tempfile.mkdtemp())

# %%
# The headline
# ------------
#
# The first sentence is the verdict: what is missing, how much of the gap it closes, whether a :term:`rest` remains,
# how many other explanations there are, and :term:`p`, the probability of records as different as these if there were no
# gap.

report = found.report
print(report.verdict.status)
print(report.sentence)

# %%
# There are four statuses.
#
# ``no_gap``
#     Records and calibrated twin cannot be told apart.
# ``explained``
#     Nothing points to a further effect: the named ones leave at most a tenth of the gap, or no more than real records
#     leave, or no more than slightly wrong values leave.
# ``partly_explained``
#     They leave more.
# ``unexplained``
#     There is a gap, and no effect can be named.
#
# Where the gap lies
# ------------------
#
# Every place is significant; the probability that any of them is wrong is at most 5 %. The :term:`share` is the
# part of the whole gap that lies there. Frequencies are in Hz of the raw spectrum, orders are multiples of shaft speed.

report.where[["domain", "lo", "hi", "unit", "share", "p_value"]].head(5).round(3)

# %%
# Which effect is missing
# -----------------------
#
# ``probability`` is that of the machine having the effect and the twin lacking it. ``closure`` is what the effect closes
# in addition to the verdict's other ones, on records that were not used to fit it. The two differ: an effect may be
# certain and close little.

report.which[["effect", "probability", "closure", "closure_lo", "closure_hi"]].head(
    5
).round(2)

# %%
# Fitted values of the named effect come with 90 % intervals.

for name, value in report.candidates[0].parameters.items():
    interval = (
        "" if value.ci is None else "90 % interval {:.3g} to {:.3g}".format(*value.ci)
    )
    print(f"{name}: {value.value:.3g} {value.unit} {interval}")

# sphinx_gallery_start_ignore
assert report.verdict.effects == ("mains_interference",)
# sphinx_gallery_end_ignore

# %%
# The confidence set
# ------------------
#
# The data may not distinguish two explanations. The confidence set lists all sets of effects that fit; the true one
# should be in it nine times of ten. An empty set in it means that the data also fit without any effect.

for effects in report.verdict.confidence_set[:4]:
    print(effects)

# %%
# The closest twin
# ----------------
#
# The :term:`closest twin` has all effects that bring it closer, named or not, and says what each group of them closes.
# Other real records in place of the twin show how much can be closed at all. This machine has one effect more than its
# twin, so that little is left for others.

print(report.closest.sentence)
for share in report.closest.attribution:
    members = ", ".join(one.effect for one in share.effects)
    print(f"{share.group}: {share.share:.2f}, p {share.p_value:.2g} ({members})")

# %%
# Its effects are not claims about the machine. :doc:`/explanation/how-a-diagnosis-works` explains how they are found.
# ``closest.toml``, written beside the report, is a :doc:`twin file </reference/twin-file>`.
#
# What it does not say
# --------------------
#
# Closures hold for these records, and for a twin calibrated on them. A place without a name is a difference that
# no named effect explains; :doc:`/explanation/limits` says what else to keep in mind.

# sphinx_gallery_thumbnail_path = 'images/report.png'
