"""Intervals of paired differences, one below the other."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from .._seafix import median_interval
from . import style
from .columns import Columns, scaled, setting, titled

#: The height of a row and of everything else (inch): 11 pt and 40 pt.
_ROW, _REST = 11 / 72, 40 / 72


def paired(
    results: Any, error: str, by: str | list[str] | tuple[str, ...] | None, over: str | None = None
) -> dict[str, npt.NDArray[np.float64]]:
    """The differences of the errors of every two methods on their common attempts, in order of time.

    An attempt without a right fix has an infinite error; two such attempts have no difference.
    """
    columns = Columns(results)
    values, names = columns.numbers(error), columns.series(by, over or "")
    values = np.where(columns.right() & np.isfinite(values), values, np.inf)
    conditions = columns.text(over) if over else np.full(len(values), "", dtype=object)
    keys = list(zip(columns.numbers("frame").astype(int), columns.text("object")))
    errors: dict[str, dict[str, dict[Any, float]]] = {}
    for condition, name, key, value in zip(conditions, names, keys, values):
        own = errors.setdefault(condition, {}).setdefault(name, {})
        if key in own:
            what = f"`{name}` has two attempts at frame {key[0]}"
            raise ValueError(f"{what}; name the varied condition in `over`, or more settings in `by`")
        own[key] = value
    differences = {}
    for condition, methods in errors.items():
        for one, other in combinations(methods, 2):
            common = sorted(methods[one].keys() & methods[other].keys())
            both = np.array([[methods[one][key], methods[other][key]] for key in common]).reshape(-1, 2)
            both = both[np.isfinite(both).any(axis=1)]
            name = f"{one} – {other}"
            differences[f"{setting(over or '')} {condition}: {name}" if over else name] = both[:, 0] - both[:, 1]
    return differences


def forest(
    results: Any,
    *,
    error: str = "tre_rms",
    by: str | list[str] | tuple[str, ...] | None = None,
    over: str | None = None,
    confidence: float = 0.95,
    label: str | None = None,
    ax: Any = None,
) -> Any:
    """Draw the median paired differences of methods with their confidence intervals.

    The interval is that of the reports: the circular block bootstrap of ten thousand resamples with blocks of about
    ∛n attempts (Politis and Romano, 1992), with a fixed seed. An interval without zero is coloured.

    Parameters
    ----------
    results : Run, pyarrow.Table or mapping
        The results of several methods on the same frames, or a mapping from the name of each comparison to its
        differences first − second, in order of time (m, or the unit of `label`). Of results, all pairs of methods are
        compared on their common attempts; an attempt without a right fix counts as an infinite error.
    error : str, default "tre_rms"
        The column of the error. Lengths are shown in mm, angles in degrees.
    by : str or list of str, optional
        The columns or settings that name the methods, as for :func:`errors`.
    over : str, optional
        A condition, as for :func:`errors`: methods are compared at each of its values.
    confidence : float, default 0.95
        The confidence of the intervals, above 0 and below 1.
    label : str, optional
        The name and unit of the differences of a mapping, which are then not converted.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default a new figure of the width of a column.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.

    Raises
    ------
    ValueError
        No two methods with common attempts, an attempt that occurs twice, or a confidence out of its range.
    ImportError
        matplotlib is not installed.

    Examples
    --------
    >>> sf.plot.forest(run, over="source.distance")
    >>> sf.plot.forest({"mine – kabsch": mine - kabsch})
    """
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"`confidence` is {confidence}; give a number above 0 and below 1")
    is_ready = isinstance(results, Mapping) and "outcome" not in results
    rows = dict(results) if is_ready else paired(results, error, by, over)
    factor, unit = (1.0, "") if label else scaled(error)
    intervals = {name: median_interval(np.asarray(row, float), confidence) for name, row in rows.items() if len(row)}
    # A median between attempts that only one method fixed is infinite or undefined; it has no place on the axis.
    finite = {name: factor * np.array(row) for name, row in intervals.items() if np.isfinite(row).all()}
    if not finite:
        raise ValueError(
            "no two methods have fixes of the same attempts: `by` names what differs between methods, `over` what "
            "differs between rows, such as a distance; compare methods on the same frames"
        )
    ax = style.axes(ax, height=_ROW * len(finite) + _REST)
    ax.axvline(0.0, color=style.MINOR, linewidth=style.AXIS)
    for place, (middle, low, high) in enumerate(reversed(finite.values())):
        drawing = style.mark(1 if low > 0.0 or high < 0.0 else 6, 2.0)
        ax.hlines(place, low, high, color=drawing["color"], linewidth=style.BAR)
        ax.plot([middle], [place], **drawing)
    ax.set_yticks(range(len(finite)), list(reversed(finite)))
    ax.set_ylim(-0.6, len(finite) - 0.4)
    style.label(ax, label or f"median difference of {titled(error, unit)}", "")
    return ax
