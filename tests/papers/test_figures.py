"""Figures that are drawn from tables: nothing is cut off, numbers stand in them, small counts are not coloured."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from papers.paper1_rul_varying_speed.lives.figures import network, table5
from papers.paper1_rul_varying_speed.lives.tables import LIVES
from papers.paper1_rul_varying_speed.methods.architecture import architecture_of
from papers.paper3_zoa_dann.comparison.figures import GROUPS, PROPOSED, accuracy, noise
from papers.paper3_zoa_dann.comparison.tables import CLEAN
from papers.paper3_zoa_dann.comparison.trial import ALL
from twingap.study.figures import FEWEST, by_effect
from twingap.study.scores import STRENGTHS


def texts(figure: Figure) -> list[str]:
    """All words in the panels of a figure."""
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_the_network_is_drawn_whole() -> None:
    figure = network(architecture_of("Proposed model 3", printed=False), "Proposed model 3")
    FigureCanvasAgg(figure).draw()
    (axes,) = figure.axes
    frame = axes.get_window_extent()
    boxes = [patch.get_window_extent() for patch in axes.patches]
    assert len(boxes) == 8
    assert all(frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1 for box in boxes)
    for text, box in zip(axes.texts, boxes, strict=False):
        words = text.get_window_extent()
        assert box.x0 < words.x0 and words.x1 < box.x1, text.get_text()


def test_table_5_has_its_numbers_with_one_seed_and_without_published_values() -> None:
    lines = [("CNN", 17.06), ("DANN", 8.25), (LIVES, 5.08)]
    errors = pd.DataFrame(
        {"data": "made", "twin": "printed", "bearing": bearing, "model": model, "rmse_min": error, "low_95": np.nan}
        for bearing, (model, error) in itertools.product(("A148", "B1"), lines)
    )
    figure = table5(errors)
    assert texts(figure) == 2 * ["17.1", "8.2"]
    assert [axes.get_title() for axes in figure.axes] == ["A148", "B1"]


@pytest.fixture
def runs() -> pd.DataFrame:
    """Trials of every method on one task a set, two seeds, with and without noise."""
    rows = itertools.product((("CWRU", "A", "A1"), ("HIT-SM", "B", "B1")), ALL, (0, 1), (np.inf, -5.0))
    return pd.DataFrame(
        {
            "data": data, "family": family, "task": task, "available": "balanced", "main": True, "method": method,
            "seed": seed, "snr_db": level, "noise": CLEAN if np.isinf(level) else "-5 dB", "accuracy": 0.5 + 0.1 * seed,
        }
        for (data, family, task), method, seed, level in rows
    )  # fmt: skip


def test_accuracy_shows_mean_and_range_of_seeds(runs: pd.DataFrame) -> None:
    figure = accuracy(runs, "balanced")
    assert texts(figure) == 2 * len(ALL) * ["55"]
    ranges = [line.get_xdata() for line in figure.axes[0].lines if line.get_marker() == "None"]
    assert len(ranges) == len(ALL) and all(list(each) == pytest.approx([50, 60]) for each in ranges)


def test_noise_has_few_lines_in_each_panel_and_every_method_in_one(runs: pd.DataFrame) -> None:
    figure = noise(runs)
    panels = [[line.get_label() for line in axes.lines] for axes in figure.axes]
    assert len(panels) == 2 * len(GROUPS)
    assert all(len(lines) == 4 and PROPOSED in lines for lines in panels)
    assert {label for lines in panels for label in lines} == set(ALL)


def test_few_worlds_are_counted_and_not_coloured() -> None:
    rows = [
        {"effect": "clipping", "strength": strength, "score": "detected", "k": n - 1, "n": n}
        for strength, n in zip(STRENGTHS, (1, FEWEST - 1, FEWEST), strict=True)
    ]
    table = {
        "confusion": {"effects": ["clipping"]}, "by_effect": rows, "provenance": {"cases": 10, "seed": 0},
    }  # fmt: skip
    axes = by_effect(table).axes[0]
    assert [text.get_text() for text in axes.texts] == ["0/1", "3/4", "4/5", "7/10"]
    (image,) = axes.images
    assert list(np.ma.getmaskarray(image.get_array())[0]) == [True, True, False, False]
