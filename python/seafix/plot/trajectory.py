"""Trajectories from above."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .._seafix import Log
from . import style

_Places = npt.NDArray[np.float64]
#: The axes of the world in the label: north, east, down.
_NAMES = ["north (m)", "east (m)", "down (m)"]


def _places(given: Any, name: str) -> _Places:
    """Positions (n, 3) of positions or poses (n, 4, 4)."""
    array = np.asarray(given, dtype=float)
    if array.ndim == 3 and array.shape[1:] == (4, 4):
        return array[:, :3, 3]
    if array.ndim == 2 and array.shape[1] == 3:
        return array
    raise ValueError(f"`{name}` has the shape {array.shape}; give positions (n, 3) or poses (n, 4, 4)")


def of_log(log: Log) -> tuple[list[_Places], list[_Places], list[_Places]]:
    """The estimated, the true and the fixed poses ``world_from_camera`` of a log."""
    frames, objects = log.frames, log.objects
    truth = [frame.truth for frame in frames if frame.truth is not None]
    estimate = [frame.navigated for frame in frames if frame.navigated is not None]
    fixes = [
        objects[target.target] @ target.object_from_camera
        for frame in frames
        for target in frame.targets
        if target.object_from_camera is not None and target.target in objects
    ]
    return estimate, truth, fixes


def trajectory(
    estimate: Any = None,
    *,
    truth: Any = None,
    fixes: Any = None,
    plane: tuple[int, int] = (0, 1),
    ax: Any = None,
) -> Any:
    """Draw a trajectory with the true one and the fixes, on equal scales.

    Parameters
    ----------
    estimate : Log or array_like, optional
        The estimated poses ``world_from_camera``, shape (n, 4, 4), or positions, shape (n, 3) (m), such as
        ``odometry.trajectory()[1]``. A log has the poses of the navigator, the truth and the fixes.
    truth : array_like, optional
        The true poses or positions (m); they replace those of a log.
    fixes : array_like, optional
        The poses or positions by single fixes (m); they replace those of a log.
    plane : tuple of int, default (0, 1)
        The world axes of abscissa and ordinate: 0 north, 1 east, 2 down. Down points downwards.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default a new figure of the width of a column.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.

    Raises
    ------
    ValueError
        An array of another shape, a plane of other axes, or no pose at all.
    ImportError
        matplotlib is not installed.

    Examples
    --------
    >>> sf.plot.trajectory(run.log(run.trials[0]))
    >>> sf.plot.trajectory(odometry.trajectory()[1], truth=truth)
    """
    if sorted(set(plane)) != sorted(plane) or not set(plane) <= {0, 1, 2} or len(plane) != 2:
        raise ValueError(f"`plane` is {plane}; give two of the axes 0 (north), 1 (east) and 2 (down)")
    if isinstance(estimate, Log):
        estimate, logged, fixed = of_log(estimate)
        truth, fixes = (logged if truth is None else truth), (fixed if fixes is None else fixes)
    given = {"truth": truth, "estimate": estimate, "fixes": fixes}
    shown = {name: _places(array, name) for name, array in given.items() if array is not None and len(array)}
    if not shown:
        raise ValueError("there is no pose to draw; give `estimate`, `truth` or `fixes`")
    ax = style.axes(ax)
    # Series 0, 4 and 1 are those of the reports.
    styles = {"truth": style.line(0), "estimate": style.line(4), "fixes": style.mark(1, 1.4)}
    for name, places in shown.items():
        ax.plot(places[:, plane[0]], places[:, plane[1]], **styles[name], label=name)
    ax.set_aspect("equal", adjustable="datalim")
    if plane[1] == 2:
        ax.yaxis.set_inverted(True)
    if plane[0] == 2:
        ax.xaxis.set_inverted(True)
    style.label(ax, _NAMES[plane[0]], _NAMES[plane[1]])
    style.legend(ax)
    return ax
