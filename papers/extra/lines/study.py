"""Study of fault lines, and its tables: by data set, sensor and class, and by recording."""

from typing import Final

import numpy as np
import pandas as pd

from papers.extra.lines import jobs
from papers.framework import Rows, Step, Study, as_table

ANY: Final = "at least one"
"""In place of a sensor: counts of recordings of which something holds at one of their sensors or more."""


@as_table
def told(rows: pd.DataFrame) -> Rows:
    """By data set, sensor and class: how far the own line stands out, and out of what. ``.., highest`` are prominences
    of that line in recordings without the fault, at the same sensor; ``above one without it`` is the share of pairs
    (with, without) in which the former is higher (luck: 0.5). The sensor "at least one" counts recordings of which a
    statement holds at one of several sensors, each judged by its own references."""
    parts = []
    for (data, sensor, fault), own in rows[rows["class"] != jobs.HEALTHY].groupby(
        ["data", "sensor", "class"], sort=False
    ):
        others = rows[(rows["data"] == data) & (rows["sensor"] == sensor) & (rows["class"] != fault)]
        healthy, line = others[others["class"] == jobs.HEALTHY][fault].max(), own[fault]
        parts.append(pd.DataFrame({
            "data": data, "sensor": sensor, "class": fault, "recording": own["recording"], "line": line,
            "healthy": healthy, "without": others[fault].max(),
            "share": (line.to_numpy()[:, None] > others[fault].to_numpy()).mean(axis=1),
            "over healthy": line > healthy, "over all": line > others[fault].max(), "first": own["highest"] == fault,
        }))  # fmt: skip
    judged = pd.concat(parts, ignore_index=True)
    for (data, sensor, fault), part in judged.groupby(["data", "sensor", "class"], sort=False):
        yield {
            "data": data, "sensor": sensor, "class": fault, "recordings": len(part),
            "own line, lowest": part["line"].min(), "own line, highest": part["line"].max(),
            "healthy, highest": part["healthy"].max(), "without the fault, highest": part["without"].max(),
            "above healthy": np.nan if part["healthy"].isna().all() else float(part["over healthy"].sum()),
            "above all without it": part["over all"].sum(), "above one without it": part["share"].mean(),
            "highest of its recording": part["first"].sum(),
        }  # fmt: skip
    for (data, fault), part in judged.groupby(["data", "class"], sort=False):
        if part["sensor"].nunique() == 1:
            continue
        once = part.groupby("recording")[["over healthy", "over all", "first"]].any()
        yield {
            "data": data, "sensor": ANY, "class": fault, "recordings": len(once),
            "above healthy": float(once["over healthy"].sum()), "above all without it": once["over all"].sum(),
            "highest of its recording": once["first"].sum(),
        }  # fmt: skip


STUDY = Study(
    name="lines",
    title="recordings that show the line of their own fault",
    options=jobs.Options,
    steps=(Step("rows", jobs.rows),),
    tables={"lines-told": lambda work: told(work["rows"]), "lines-recordings": lambda work: work["rows"]},
    headlines=("lines-told",),
)
