"""Paper 2's figure of accuracy over labels: rings stand where the table of crossing points says, and words say it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from papers.paper2_digital_twin.availability.figures import crossings


def test_rings_stand_where_a_method_is_level_with_the_network(tmp_path: Path) -> None:
    right = {"twin network": (0.7, 0.8, 0.9), "SVM": (np.nan, 0.6, 0.95), "SOM-MQE": (np.nan, 0.5, 0.6)}
    accuracy = pd.DataFrame(
        [
            {"data": "set", "split by": split, "method": method, "records a fault": records, "accuracy": value,
             "low": value - 0.05, "high": value + 0.05}
            for split in ("recording", "bearing")
            for method, values in right.items()
            for records, value in zip(("0", "1", "all"), values, strict=True)
            if not np.isnan(value)
        ]
    )  # fmt: skip
    crossed = pd.DataFrame(
        [
            {"data": "set", "split by": split, "method": method, "against": "twin network", "at least as good from": at}
            for split, starts in (("recording", ("all", "")), ("bearing", ("", "")))
            for method, at in zip(("SVM", "SOM-MQE"), starts, strict=True)
        ]
    )
    for name, table in (("accuracy", accuracy), ("crossed", crossed)):
        table.to_csv(tmp_path / name, index=False)
    for frames in ((accuracy, crossed), (pd.read_csv(tmp_path / "accuracy"), pd.read_csv(tmp_path / "crossed"))):
        figure = crossings(*frames)
        by_recording, by_bearing = figure.axes
        rings = [[line for line in panel.lines if line.get_fillstyle() == "none"] for panel in figure.axes]
        assert [len(found) for found in rings] == [1, 0]
        assert rings[0][0].get_ydata() == [95.0] and abs(rings[0][0].get_xdata()[0] - 2) < 0.1
        assert by_recording.texts[0].get_text() == "SVM level from all\nSOM-MQE stays below"
        assert by_bearing.texts[0].get_text() == "SVM stays below\nSOM-MQE stays below"
