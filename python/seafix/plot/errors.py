"""Errors over a condition, with the Cramér–Rao bound."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import style
from .columns import Columns, scaled, setting, titled

#: The column with the bound of an error.
_BOUNDS = {"tre_rms": "tre_crlb", "position_error": "position_crlb"}
#: From this ratio of the ends on, values would overlap at one end of a linear axis.
_WIDE = 12.0


def errors(
    results: Any,
    over: str,
    *,
    error: str = "tre_rms",
    bound: bool = True,
    by: str | list[str] | tuple[str, ...] | None = None,
    label: str | None = None,
    ax: Any = None,
) -> Any:
    """Draw the error of the fixes over a condition, beside its Cramér–Rao bound.

    A mark is the root of the mean square error of the right fixes of a method at a value of the condition, which no
    unbiased solver has below the bound. A bar extends from the 5 % to the 95 % quantile of the errors.

    Parameters
    ----------
    results : Run, pyarrow.Table or mapping
        The results: a run, a table with its columns, or arrays by the names of these columns.
    over : str
        The condition: a numeric column, or the key of a setting that the run varies, ``"source.points.sigma-px"``.
    error : str, default "tre_rms"
        The column of the error. Lengths are shown in mm, angles in degrees.
    bound : bool, default True
        Draw the bound of the fixes, the root of the mean of its squares. `tre_rms` and `position_error` have one.
    by : str or list of str, optional
        The columns or settings that name the series; by default the settings that the run varies besides `over`, or
        search and solver.
    label : str, optional
        The name and unit of the condition; by default those of its key.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default a new figure of the width of a column.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.

    Raises
    ------
    ValueError
        No such column or setting, a condition without numbers, or no right fix.
    ImportError
        matplotlib is not installed.

    Examples
    --------
    >>> sf.plot.errors(run, "source.points.sigma-px").figure.savefig("errors.pdf")
    """
    columns = Columns(results)
    x, values, names = columns.numbers(over), columns.numbers(error), columns.series(by, over)
    usable = columns.right() & np.isfinite(x) & np.isfinite(values)
    if not usable.any():
        raise ValueError(f"no right fix has both `{over}` and `{error}`; there is nothing to draw")
    factor, unit = scaled(error)
    ax = style.axes(ax)
    ticks = np.unique(x[usable])
    wide = bool(ticks[0] > 0 and ticks[-1] / ticks[0] > _WIDE)
    reach = np.log(ticks[-1] / ticks[0]) if wide else ticks[-1] - ticks[0]
    known = list(dict.fromkeys(names[usable]))
    for series, name in enumerate(known):
        # Series with the same abscissa are shifted apart.
        shift = 0.012 * reach * (series - (len(known) - 1) / 2)
        places, middle, ends = [], [], []
        for value in ticks:
            own = factor * values[usable & (names == name) & (x == value)]
            if own.size:
                places.append(value * np.exp(shift) if wide else value + shift)
                middle.append(np.sqrt(np.mean(own**2)))
                ends.append(np.quantile(own, [0.05, 0.95]))
        low, high = np.transpose(ends)
        ax.vlines(places, low, high, color=style.line(series)["color"], linewidth=style.BAR)
        ax.plot(places, middle, **{**style.mark(series, 2.2), **style.line(series)}, label=name)
    if bound and error in _BOUNDS:
        limits = columns.numbers(_BOUNDS[error])
        seen = [(value, limits[usable & np.isfinite(limits) & (x == value)]) for value in ticks]
        squares = [(value, factor * np.sqrt(np.mean(own**2))) for value, own in seen if own.size]
        if squares:
            ax.plot(*np.transpose(squares), color=style.TEXT, linewidth=style.BAR, label="Cramér–Rao bound", zorder=3)
    ax.set_yscale("log")
    if wide:
        ax.set_xscale("log")
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    style.readable(ax.yaxis)
    style.label(ax, label or setting(over), f"RMS {titled(error, unit)}".replace("RMS fit RMS", "fit RMS"))
    style.legend(ax)
    return ax
