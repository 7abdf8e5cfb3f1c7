"""The page on a telephone: nothing but tables and code scrolls sideways, names of figures do not overlap."""

from __future__ import annotations

import dataclasses
import math
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.twingap.gap.conftest import MakeReport
from twingap.gap.distance.curves import _label
from twingap.gap.report.figures import curve_figure, metrics_figure, shares_figure
from twingap.gap.report.model import Curve, Metric, Place
from twingap.gap.report.page import page
from twingap.records import Condition

LONG = "Pruefstand_7_Lager_6205_2024-03-15_Messreihe_0012_Beschleunigung_radial_DE_12kHz"
MEASURE = """<body></body><script>
(async () => {
  const found = [];
  for (const width of [400, 320]) {
    const frame = document.createElement("iframe");
    frame.style.cssText = `width: ${width}px; height: 3000px; border: 0`;
    frame.src = "report.html";
    document.body.append(frame);
    await new Promise((done) => (frame.onload = done));
    await new Promise((done) => setTimeout(done, 500));
    const root = frame.contentDocument.documentElement;
    found.push(`${root.scrollWidth - root.clientWidth}`);
    frame.remove();
  }
  document.body.textContent = `beyond: ${found.join(" ")}.`;
})();
</script>"""


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_nothing_scrolls_sideways(make_report: MakeReport, tmp_path: Path) -> None:
    report = make_report("partly_explained", records=LONG)
    about = {**report.provenance, "simulator": LONG}
    report = dataclasses.replace(report, notes=(f"{LONG}/{LONG}.csv: " + "x" * 90,), provenance=about)
    (tmp_path / "report.html").write_text(page(report), encoding="utf-8")
    (tmp_path / "measure.html").write_text(MEASURE, encoding="utf-8")
    ran = subprocess.run(
        ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files", "--dump-dom",
         f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=20000", str(tmp_path / "measure.html")],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    found = re.search(r"beyond: (.*)\.", ran.stdout)
    assert found is not None, ran.stderr[-500:]
    assert found[1].split() == ["0", "0"]


def test_conditions_stand_below_each_other_in_short_lines() -> None:
    names = ("healthy, 1288 to 2073 rpm, 893 N", "a <b>, 1500 rpm")
    figure = curve_figure(Curve(names, "condition", (1.0, 2.0), (1.5, 2.5), None, "dB", "Level", "condition"))
    assert figure.data[0].y == ("healthy<br>1288 to 2073 rpm<br>893 N", "a &lt;b&gt;<br>1500 rpm")
    assert figure.data[0].x == (1.0, 2.0) and figure.layout.xaxis.title.text == "dB"


def test_one_load_is_no_range() -> None:
    def at(load_n: float) -> Condition:
        return Condition("r", 1500.0, 12000.0, 12000, "outer", load_n)

    assert _label([at(1495.0), at(1495.0)]) == "outer, 1500 rpm, 1495 N"
    assert _label([at(893.0), at(1495.0)]) == "outer, 1500 rpm, 893 to 1495 N"


def test_places_are_named_above_their_bars_and_measures_in_short_lines() -> None:
    figure = shares_figure([Place("frequency", 100.0, 200.0, "Hz", 0.7, 0.01)])
    (label,) = figure.layout.annotations
    assert label.text == "1  spectrum: 100 to 200 Hz" and not figure.layout.yaxis.showticklabels
    measure = Metric("AUC_of_a_classifier, records against <twin>", 1.0, 0.6, 0.5, (0.5, 0.7))
    (before,) = [line for line in metrics_figure([measure]).data if line.name == "before"]
    assert before.y == ("AUC of a classifier,<br>records against &lt;twin&gt;",)


def test_names_of_orders_beside_each_other_do_not_overlap() -> None:
    x = tuple(0.1 * i for i in range(200))
    marks = {"BPFO": 5.2, "FTF": 0.4, "shaft": 1.0, "2 BSF": 4.9, "BPFI": 7.8}
    line = (math.nan, *(1.0,) * 199)
    curve = Curve(x, "shaft orders", line, line, None, "dB", "Envelope", "envelope_order", marks=marks)
    sides = {note.text: note.xanchor for note in curve_figure(curve).layout.annotations}
    assert sides == {"FTF": "right", "shaft": "left", "2 BSF": "right", "BPFO": "left", "BPFI": "right"}
