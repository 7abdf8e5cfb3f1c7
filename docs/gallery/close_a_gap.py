"""
Close a gap
===========

Knowing what a twin lacks is worth something when it is added. This tutorial adds the named effects to the twin, checks
that nothing more is missing, and shows the closest twin for machines that have what no catalogue knows.
"""

# %%
# A gap
# -----
#
# The machine's converter clips large samples, and a second bearing of the machine is damaged.

import tempfile
from pathlib import Path

import twingap
from twingap import BEARINGS, Condition
from twingap.twins import TwinSpec, build_twin, write_twin

bearing = BEARINGS["6205"]
conditions = [
    Condition(f"{fault} {i}", speed_rpm=1600, fs_hz=12000, n_samples=8192, fault=fault)
    for fault in ("healthy", "inner", "outer")
    for i in range(4)
]
machine = TwinSpec("phenomenological", effects=("clipping", "foreign_bearing"), bearing=bearing)
records = twingap.simulate(conditions, machine, seed=3)
twin = TwinSpec("phenomenological", bearing=bearing)
found = twingap.diagnose(records, twin, seed=0)
print(found.report.sentence)

# %%
# Add what was named
# ------------------
#
# ``closest_twin`` is the calibrated twin with the named effects at their fitted values: a twin file like any other.

closer = found.closest_twin()
folder = Path(tempfile.mkdtemp())
write_twin(folder / "closer.toml", closer)
print((folder / "closer.toml").read_text().split("[bearing]")[0])

# %%
# Diagnosed again, on other records of the same machine, the closer twin lacks less, or nothing.

others = twingap.simulate(conditions, machine, seed=4)
again = twingap.diagnose(others, closer, seed=0)
print(again.report.sentence)

# %%
# Use it
# ------
#
# The closer twin simulates what the machine was never measured at: another speed, another fault.

asked = [Condition("ball 2400 rpm", speed_rpm=2400, fs_hz=12000, n_samples=12000, fault="ball")]
simulated = twingap.simulate(asked, closer, seed=5)
print(simulated[0].samples[:5].round(3), simulated.unit)
print(build_twin(closer).effects)

# %%
# When a rest remains
# -------------------
#
# Real machines differ from a twin in ways that no effect was written for. With ``closest=True`` (``--closest`` on the
# command line) further effects are added as far as they bring twin and records together. They are told apart from the
# verdict: that the machine has them is not shown. The search takes minutes, so it is not run here::
#
#     found = twingap.diagnose(records, twin, closest=True)
#     found.write("out", export=True)  # closest.toml, and the closest twin's records
