"""Columns of results: of a run, of a pyarrow table, or of a mapping."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ..runs import Run

_Array = npt.NDArray[Any]


class Columns:
    """The columns of results by name, and the settings that a run varies by key.

    Parameters
    ----------
    results : Run, pyarrow.Table or mapping
        The results.
    """

    def __init__(self, results: Any) -> None:
        self.run = results if isinstance(results, Run) else None
        self.table = results.table() if self.run else results
        self.names = list(getattr(self.table, "column_names", None) or self.table)

    def text(self, name: str) -> _Array:
        """The values of a column or setting as texts."""
        return np.array(["" if value is None else str(value) for value in self._values(name)], dtype=object)

    def numbers(self, name: str) -> npt.NDArray[np.float64]:
        """The values of a column or setting as numbers; NaN where there is none."""
        values = self._values(name)
        try:
            return np.array([np.nan if value is None or value == "" else float(value) for value in values])
        except (TypeError, ValueError):
            raise ValueError(f"`{name}` has a value that is no number; choose another column") from None

    def fixes(self) -> npt.NDArray[np.bool_]:
        """Whether a row is a fix, right or wrong."""
        return self.text("outcome") == "fix"

    def right(self) -> npt.NDArray[np.bool_]:
        """Whether a row is a fix whose TRE is within the alert limit."""
        return self.fixes() & (self.text("wrong") != "True")

    def series(self, by: str | list[str] | tuple[str, ...] | None, without: str = "") -> _Array:
        """The name of each row's series.

        By default it consists of the settings that the run varies, or of the columns `search` and `solver` as far as
        they vary.
        """
        if by is None:
            keys = list(self.run.axes(self.run.trials[0])) if self.run and self.run.trials else []
            keys = [key for key in keys if key != without]
            methods = [name for name in ("search", "solver") if name in self.names]
            keys = keys or [name for name in methods if len(set(self.text(name))) > 1] or methods[-1:]
        else:
            keys = [by] if isinstance(by, str) else list(by)
        if not keys:
            raise ValueError("no column names the method; give the names of columns in `by`")
        parts = [self.text(key) for key in keys]
        return np.array([" + ".join(row) for row in zip(*parts)], dtype=object)

    def _values(self, name: str) -> list[Any]:
        if name in self.names:
            column = self.table[name]
            return column.to_pylist() if hasattr(column, "to_pylist") else list(column)
        axes = {trial: self.run.axes(trial) for trial in self.run.trials} if self.run else {}
        known = sorted({key for one in axes.values() for key in one})
        if name not in known:
            there = ", ".join(known + self.names)
            raise ValueError(f"no column and no varied setting is called `{name}`; there are {there}")
        return [axes[trial].get(name) for trial in self._values("trial")]


def scaled(name: str) -> tuple[float, str]:
    """The factor and the unit in which a figure shows a column: lengths in mm, angles in degrees."""
    if name in ("attitude_error", "navigated_attitude_error", "protection_attitude"):
        return float(np.degrees(1.0)), "deg"
    if name == "nees" or name.endswith("_nees"):
        return 1.0, ""
    return (1.0, "ms") if name.endswith("_ms") else (1e3, "mm")


def titled(name: str, unit: str) -> str:
    """The label of an axis."""
    words = {"tre_rms": "TRE", "fit_rms": "fit RMS"}.get(name, name.replace("_", " "))
    return f"{words} ({unit})" if unit else words


#: The units of settings, which end in their unit or are lengths.
_UNITS = {"px": "px", "deg": "deg", "distance": "m", "baseline": "m", "sigma": "m"}


def setting(key: str) -> str:
    """The label of a setting: the last part of its key, with the unit that it ends in."""
    words = key.rpartition(".")[2].replace("_", "-").split("-")
    unit = _UNITS.get(words[-1])
    if unit in ("px", "deg") and len(words) > 1:
        words = words[:-1]
    text = " ".join(words)
    return f"{text} ({unit})" if unit else text
