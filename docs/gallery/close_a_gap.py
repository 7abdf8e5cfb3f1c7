"""
Close a gap
===========

Knowing what a twin lacks is useful once it is added. This tutorial adds the effects that a diagnosis names until no
further one closes anything, and uses the resulting closest twin.
"""

# %%
# A gap
# -----
#
# The machine's converter clips large samples, and a second bearing of the machine is damaged. The twin knows neither.

import matplotlib.pyplot as plt
import numpy as np

import twingap
from twingap import BEARINGS, Condition
from twingap.signal import squared_envelope_spectrum
from twingap.twins import TwinSpec

bearing = BEARINGS["6205"]
conditions = [
    Condition(f"{fault} {i}", speed_rpm=1600, fs_hz=12000, n_samples=8192, fault=fault)
    for fault in ("healthy", "inner", "outer")
    for i in range(3)
]
machine = TwinSpec(
    "phenomenological", effects=("clipping", "foreign_bearing"), bearing=bearing
)
records = twingap.simulate(conditions, machine, seed=3)
twin = TwinSpec("phenomenological", bearing=bearing)

# %%
# Close it
# --------
#
# ``close`` diagnoses, adds the named effects at the values found, and diagnoses again, until a diagnosis names no further
# effect that closes anything. The last one that finds a gap looks for the :term:`closest twin` too, which is handed back
# where something is left to close.

way = twingap.close(records, twin, seed=0)
print(way.sentence)

# %%
# Each step is a :doc:`diagnosis <read_a_report>` with a report of its own.

for step in way.diagnoses:
    print(f"- {step.report.sentence}")

# sphinx_gallery_start_ignore
assert set(machine.effects) <= set(way.twin.effects)
# sphinx_gallery_end_ignore

# %%
# The closest twin
# ----------------
#
# It has the named effects, and whatever else brings it closer (nothing, where the named effects close the gap). Compare the
# values of the named effects with those of the machine, which are the defaults of the
# :doc:`catalogue </reference/catalogue>`.

print("effects:", ", ".join(way.twin.effects))
for name in machine.effects:
    print(
        name,
        {
            parameter: round(value, 3)
            for parameter, value in way.twin.parameters[name].items()
        },
    )

# %%
# It simulates conditions that were never measured: another speed, another fault. Here the machine is simulated too, for
# comparison.

unmeasured = [
    Condition(
        "ball at 2400 rpm", speed_rpm=2400, fs_hz=12000, n_samples=24000, fault="ball"
    )
]
fig, ax = plt.subplots(figsize=(8, 3))
for label, chosen, seed in (("machine", machine, 6), ("closest twin", way.twin, 7)):
    (record,) = twingap.simulate(unmeasured, chosen, seed=seed)
    spectrum = squared_envelope_spectrum(record.samples, record.condition.fs_hz)
    orders = spectrum.frequency / (record.condition.speed_rpm / 60)
    kept = (orders > 0.3) & (orders < 15)
    offset = 1.2 * np.max(spectrum.values[kept]) if label == "machine" else 0.0
    ax.plot(orders[kept], spectrum.values[kept] + offset, linewidth=1, label=label)
ax.set(xlabel="envelope order, shaft speeds", ylabel="squared envelope, offset")
ax.legend(loc="upper right", frameon=False)
plt.show()

# %%
# On the command line
# -------------------
#
# ::
#
#     twingap close my-records --twin twin.toml --out closer.toml
#
# ``closer.toml`` is a :doc:`twin file </reference/twin-file>` like any other.
#
# From one diagnosis
# ------------------
#
# Every diagnosis looks for a closest twin, starting from the given one. Records of real machines differ from a twin in
# many ways at once, so there it has many effects, and the search takes minutes::
#
#     found = twingap.diagnose(records, twin)
#     print(found.report.closest.sentence)  # what it closes, and which groups of effects close it
#     found.write("out", export=True)  # closest.toml, and the closest twin's records in sim_closest
#
# ``twingap.diagnose(records, twin, quick=True)`` leaves it out. :doc:`/explanation/how-a-diagnosis-works` describes how it is
# found.
