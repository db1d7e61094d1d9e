"""Right fixes against false ones, over the limit of the probability of a wrong answer."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import style
from .columns import Columns


def _fractions(p: npt.NDArray[np.float64], counts: npt.NDArray[np.bool_], limits: npt.NDArray[np.float64]) -> Any:
    """The fraction of all attempts that count and have at most each limit."""
    sorted_p = np.sort(p[counts])
    return np.searchsorted(sorted_p, limits, side="right") / max(len(p), 1)


def roc(
    present: Any,
    absent: Any,
    *,
    marked: float | None = 1e-3,
    label: str | None = None,
    series: int = 0,
    ax: Any = None,
) -> Any:
    """Draw the fraction of right fixes over that of false ones, as the limit of `p_wrong` varies.

    A point of the curve belongs to a limit: an attempt counts if it is a fix with at most this `p_wrong`. The ordinate
    is the fraction of the attempts at a present object that are right fixes, the abscissa the fraction of the attempts
    at an absent object that are fixes, which are false by definition.

    Parameters
    ----------
    present, absent : Run, pyarrow.Table or mapping
        The results with the object present, and those with it absent (``source.absent = true`` of
        ``generated-problems``). Both come from runs with ``pipeline.acceptance.max-p-wrong = 1.0``: a run with a
        stricter limit has the curve only up to it. A mapping has the arrays `outcome`, `wrong` and `p_wrong`.
    marked : float, optional
        The limit whose point is marked, from 0 to 1; None marks none.
    label : str, optional
        The name of the curve in the legend.
    series : int, default 0
        The index of colour and dash, for several curves on the same axes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default a new figure of the width of a column.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.

    Raises
    ------
    ValueError
        Results without attempts, or without the columns.
    ImportError
        matplotlib is not installed.

    Examples
    --------
    >>> ax = sf.plot.roc(here, gone, label="rigid-consensus")
    """
    seen, missing = Columns(present), Columns(absent)
    p, counts = seen.numbers("p_wrong"), seen.right()
    q, false = missing.numbers("p_wrong"), missing.fixes()
    if not len(p) or not len(q):
        raise ValueError("`present` or `absent` has no attempts; give the results of a run")
    limits = np.unique(np.concatenate([[0.0], p[counts], q[false]]))
    limits = limits[np.isfinite(limits)]
    ax = style.axes(ax)
    curve = _fractions(q, false, limits), _fractions(p, counts, limits)
    ax.step(*curve, where="post", **style.line(series), label=label)
    if marked is not None:
        limit = np.array([marked])
        # Further curves have the same mark; one entry of the legend is enough.
        text = f"p_wrong ≤ {marked:g}" if series == 0 else None
        point = _fractions(q, false, limit), _fractions(p, counts, limit)
        ax.plot(*point, **style.mark(series, 2.4), label=text, clip_on=False)
    # One false fix is in view even where there is none.
    ax.set_xlim(0.0, 1.05 * max(ax.dataLim.x1, 1.0 / len(q)))
    ax.set_ylim(0.0, 1.0)
    style.label(ax, "false fixes of an absent object (fraction)", "right fixes (fraction)")
    style.legend(ax)
    return ax
