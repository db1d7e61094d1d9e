"""The style of the reports: palette, line widths, font and size."""

from __future__ import annotations

from functools import cache
from typing import Any

#: The palette of Okabe and Ito (2008), safe for colour-blind readers, in the order of the reports.
PALETTE = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#5a5a5a"]
TEXT, MINOR, GRID = "#222222", "#6e6e6e", "#dedede"
#: Dash patterns (pt), which are distinguishable in print without colour.
DASHES: list[Any] = ["-", (0, (5, 2.5)), (0, (1.2, 1.8)), (0, (6, 2, 1.2, 2)), (0, (3, 1.5))]
#: Marks of the series.
MARKS = ["o", "s", "^", "D", "v", "P", "X"]
#: The font size (pt).
FONT = 7.5
#: The width of a column of a journal, 85 mm, and the height of a panel of it (inch).
COLUMN = 85 / 25.4
PANEL = 0.72 * COLUMN
#: Line widths (pt) of a series, of a bar and of an axis.
LINE, BAR, AXIS = 1.1, 0.8, 0.7
#: The fonts of the reports' figures; the last is matplotlib's own.
_FAMILIES = ["Liberation Sans", "Arimo", "Helvetica", "Arial", "DejaVu Sans"]


def pyplot() -> Any:
    """The module ``matplotlib.pyplot``."""
    try:
        from matplotlib import pyplot as module
    except ModuleNotFoundError as error:
        raise ImportError("figures need matplotlib; install it with `pip install matplotlib`") from error
    return module


@cache
def family() -> str:
    """The first of the reports' fonts that is installed."""
    from matplotlib import font_manager

    installed = set(font_manager.get_font_names())
    return next((name for name in _FAMILIES if name in installed), _FAMILIES[-1])


def axes(ax: Any, *, height: float = PANEL) -> Any:
    """The given axes, or those of a new figure of a column's width, in the style of the reports."""
    plt = pyplot()
    if ax is None:
        # The layout engine keeps long names of an axis inside the figure.
        ax = plt.figure(figsize=(COLUMN, height), layout="constrained", dpi=200).add_subplot()
    ax.spines[["top", "right"]].set_visible(False)
    for spine in ax.spines.values():
        spine.set(linewidth=AXIS, color=TEXT)
    # The grid is below bars and lines.
    ax.set_axisbelow(True)
    ax.grid(True, color=GRID, linewidth=0.5)
    ax.tick_params(which="both", length=0, labelsize=FONT, labelcolor=TEXT, labelfontfamily=family())
    return ax


def label(ax: Any, x: str, y: str) -> None:
    """The names of the axes, with their units."""
    text = {"fontsize": FONT, "color": TEXT, "fontfamily": family()}
    ax.set_xlabel(x, **text)
    ax.set_ylabel(y, **text)


def readable(axis: Any) -> None:
    """Plain numbers at 1, 2 and 5 of every decade of a logarithmic axis, or at the powers of ten of a long one."""
    from matplotlib import ticker

    low, high = axis.get_view_interval()
    steps = (1.0,) if high / low > 10**2.2 else (1.0, 2.0, 5.0)
    axis.set_major_locator(ticker.LogLocator(subs=steps, numticks=12))
    axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))


def legend(ax: Any) -> None:
    """A legend without a frame, if a series has a name."""
    if ax.get_legend_handles_labels()[1]:
        ax.legend(frameon=False, prop={"size": FONT, "family": family()}, labelcolor=TEXT)


def line(series: int) -> dict[str, Any]:
    """The line of a series."""
    place = series % len(PALETTE)
    return {"color": PALETTE[place], "linestyle": DASHES[series % len(DASHES)], "linewidth": LINE}


def mark(series: int, radius: float) -> dict[str, Any]:
    """The marks of a series without a line; the radius is in pt."""
    place = series % len(PALETTE)
    return {"color": PALETTE[place], "marker": MARKS[place], "markersize": 2 * radius, "linestyle": "none"}
