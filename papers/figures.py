"""Figures of the studies: sizes of letters, and grids of panels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINE_NAMES: Final = {"inner": "BPFI", "outer": "BPFO", "ball": "2 BSF"}
"""Name of the line that a fault shows in an envelope spectrum."""


def style(size: int, legend: int) -> Any:
    """Sizes of letters and of those in legends, points, for `matplotlib.rc_context`."""
    return {"font.size": size, "axes.titlesize": size, "axes.labelsize": size, "legend.fontsize": legend}


def subplots(size: tuple[float, float], rows: int = 1, columns: int = 1, **options: Any) -> tuple[Figure, Any]:
    """A figure of this size, inches, and its panels; options as those of `Figure.subplots`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def grid(
    count: int, most: int, size: tuple[float, float], more: tuple[float, float], **options: Any
) -> tuple[Figure, Any]:
    """A figure of `count` panels, at most `most` across, of `size` (inches) each and `more` besides, and its panels
    [down, across]; unused ones are blank. Options as those of `Figure.subplots`."""
    across = max(min(count, most), 1)
    down = -(-max(count, 1) // across)
    figure, panels = subplots(
        (size[0] * across + more[0], size[1] * down + more[1]), down, across, squeeze=False, **options
    )
    for unused in panels.flat[count:]:
        unused.set_axis_off()
    return figure, panels


def name_axes(panels: Any, x: str = "", y: str = "") -> None:
    """Name the axes of panels [down, across]: of the lowest ones and of those on the left."""
    for panel in panels[-1]:
        panel.set_xlabel(x)
    for panel in panels[:, 0]:
        panel.set_ylabel(y)


def rule(axes: Any, axis: str) -> None:
    """Light lines across, behind what is drawn."""
    axes.grid(axis=axis, color="0.9")
    axes.set_axisbelow(True)
