"""
First diagnosis
===============

A simulation never behaves exactly like the machine. This page compares records of a machine with a simulation of it, a
:term:`twin`, and finds out what the twin lacks. The machine is simulated too, so that the truth is known and can be
compared with what is found.
"""

# %%
# A machine
# ---------
#
# A record needs a condition: shaft speed, sampling rate, length, and the fault if it is known. Here a 6205 bearing is
# healthy or has a fault of one race or of a ball, at two speeds.

import matplotlib.pyplot as plt

import twingap
from twingap import BEARINGS, Condition
from twingap.signal import amplitude_spectrum
from twingap.twins import TwinSpec

bearing = BEARINGS["6205"]
conditions = [
    Condition(
        f"{fault} {speed_rpm} rpm {i}",
        speed_rpm,
        fs_hz=12000,
        n_samples=8192,
        fault=fault,
    )
    for fault in ("healthy", "inner", "outer", "ball")
    for speed_rpm in (1500, 1800)
    for i in range(2)
]

# %%
# The machine is a chain of effects: its shaft is out of balance, and impacts of its rolling elements do not come at
# perfectly even angles. The twin that we compare it with has neither.

machine = TwinSpec(
    "phenomenological", effects=("slip_jitter", "shaft_harmonics"), bearing=bearing
)
records = twingap.simulate(conditions, machine, seed=1)
twin = TwinSpec("phenomenological", bearing=bearing)

# %%
# What the twin lacks
# -------------------
#
# A diagnosis calibrates the twin on one part of the records and measures everything that it reports on the rest. A quick
# one names effects and leaves out the :term:`closest twin`, which takes most of the time.

found = twingap.diagnose(records, twin, seed=0, quick=True)
print(found.report.sentence)

# sphinx_gallery_start_ignore
assert set(found.report.verdict.effects) == set(machine.effects)
# sphinx_gallery_end_ignore

# %%
# Both effects that were hidden in the machine are named, and no other. Every effect of the catalogue is a candidate;
# the most probable ones are these.

found.report.which[["effect", "probability", "closure"]].head(4).round(2)

# %%
# How far the gap shrinks when the named effects are added is measured in several ways. ``floor`` is what a perfect twin
# would reach: records against other records.

found.report.shrink[["metric", "before", "after", "floor"]].round(2)

# %%
# With and without
# ----------------
#
# The diagnosis holds simulated records of the twin as given, and with the named effects. Their spectra show one of the
# two that were missing: tones at one, two and three times the shaft speed.

name = "outer 1800 rpm 0"
shown = {
    "records": records,
    "twin": found.sim_before(),
    "twin with the effects": found.sim_after(),
}
fig, axes = plt.subplots(1, 3, figsize=(10, 3), sharex=True, sharey=True)
for ax, (title, several) in zip(axes, shown.items(), strict=True):
    record = next(record for record in several if record.condition.name == name)
    spectrum = amplitude_spectrum(record.samples, record.condition.fs_hz)
    kept = spectrum.frequency < 150
    ax.plot(spectrum.frequency[kept], spectrum.values[kept])
    ax.set(title=title, xlabel="frequency, Hz")
axes[0].set_ylabel("amplitude, m/s$^2$")
plt.show()

# %%
# On the command line
# -------------------
#
# The same with records in a folder and the twin in a file::
#
#     twingap gap my-records --twin twin.toml --out gap
#
# :doc:`/how-to/bring-your-records` describes the folder, :doc:`/reference/twin-file` the file.
# Next, :doc:`read_a_report` goes through the page that this command writes.
