"""Runs of experiments, and their results."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ._seafix import Log, read_axes, read_log, run_experiment
from .invalid import invalid


class Run:
    """A finished run: its folder with results, logs and manifest.

    Parameters
    ----------
    folder : str or os.PathLike
        The folder of the run.

    Raises
    ------
    FileNotFoundError
        The folder holds no run.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        manifest = self.folder / "manifest.json"
        if not manifest.is_file():
            raise FileNotFoundError(f"no run in {self.folder}: {manifest.name} is missing; give the folder of a run")
        self.manifest: dict[str, Any] = json.loads(manifest.read_text(encoding="utf-8"))

    def table(self) -> Any:
        """The results: one row per trial, frame and attempted target.

        Returns
        -------
        pyarrow.Table
            The columns of ``results.parquet`` (``docs/quantities.md``); ``to_pandas()`` converts it, and
            ``polars.from_arrow`` takes it.

        Raises
        ------
        ImportError
            pyarrow is not installed.
        """
        try:
            from pyarrow import parquet
        except ImportError as error:
            raise ImportError("the table of a run needs pyarrow; install it with `pip install pyarrow`") from error
        return parquet.read_table(self.folder / "results.parquet")

    @property
    def trials(self) -> list[str]:
        """The names of the logged trials, in alphabetical order."""
        return sorted(path.stem for path in self.folder.glob("*.mcap"))

    def log(self, trial: str) -> Log:
        """The log of a trial.

        Parameters
        ----------
        trial : str
            Its name.

        Returns
        -------
        Log

        Raises
        ------
        KeyError
            The run has no log of this trial.
        """
        return read_log(self._file(trial))

    def axes(self, trial: str) -> dict[str, str]:
        """The settings of a trial that the run varies.

        Parameters
        ----------
        trial : str
            Its name.

        Returns
        -------
        dict
            The value by the key of each varied setting. Only the head of the log is read.

        Raises
        ------
        KeyError
            The run has no log of this trial.
        """
        return read_axes(self._file(trial))

    def _file(self, trial: str) -> Path:
        if trial not in self.trials:
            raise KeyError(f"no trial is called {trial!r}; there are {', '.join(self.trials)}")
        return self.folder / f"{trial}.mcap"

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r})"


def _reporter(progress: bool | Callable[[int, int], object]) -> Callable[[int, int], object] | None:
    """The function that reports progress."""
    if not progress:
        return None
    if callable(progress):
        return progress

    def print_line(done: int, total: int) -> None:
        print(f"\r{done} of {total} frames", end="" if done < total else "\n", file=sys.stderr, flush=True)

    return print_line


def _settings(settings: Mapping[str, Any] | Sequence[str]) -> list[str]:
    """Settings as ``key=value``, with values in TOML."""
    if isinstance(settings, str):
        raise invalid("settings", "`settings` is a text", "give a dictionary or a list of texts `key=value`")
    if not isinstance(settings, Mapping):
        return [str(setting) for setting in settings]
    # A JSON number, text, boolean or list is a TOML value as well.
    return [f"{key}={_toml(key, value)}" for key, value in settings.items()]


def _toml(key: str, value: Any) -> str:
    """A value of a setting in TOML; numpy's scalars and arrays are numbers and lists."""
    try:
        if value is None:
            raise TypeError
        return json.dumps(value, default=lambda other: other.tolist(), allow_nan=False)
    except (TypeError, ValueError, AttributeError):
        remedy = "give a number, text, boolean, list or dictionary"
        raise invalid(key, f"the setting `{key}` is {value!r}", remedy) from None


def _threads(threads: int | None) -> int:
    if threads is None:
        return os.cpu_count() or 1
    if not 1 <= threads <= 1024:
        raise invalid("threads", f"`threads` is {threads}", "give 1 to 1024")
    return threads


def run(
    experiment: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    *,
    threads: int | None = None,
    progress: bool | Callable[[int, int], object] = False,
    settings: Mapping[str, Any] | Sequence[str] = (),
    existing: str = "refuse",
    timed: bool = True,
) -> Run:
    """Run an experiment.

    Parameters
    ----------
    experiment : str or os.PathLike
        An experiment file, or the folder of a data set for the default pipeline.
    out : str or os.PathLike, optional
        The folder of the run, new or empty; by default the next free one below ``runs``.
    threads : int, optional
        Number of threads; results do not depend on it. By default all cores.
    progress : bool or callable, default False
        Print the number of finished frames, or call ``progress(done, total)``.
    settings : mapping or sequence of str, optional
        Changed settings by dotted key: ``{"source.frames": 3}`` or ``["source.frames=3"]``.
    existing : {"refuse", "resume", "overwrite"}, default "refuse"
        Treatment of a run that the folder already holds.
    timed : bool, default True
        Log durations. Without them two runs of one experiment have the same bytes.

    Returns
    -------
    Run
        The finished run.

    Raises
    ------
    ValueError
        All faults of the experiment, one a line, each with its line and remedy.
    OSError
        The folder cannot be written.

    Notes
    -----
    After Ctrl-C each thread finishes its frame; ``existing="resume"`` continues the run. An exception of a component
    written in Python stops the run and is raised.
    """
    folder, _ = run_experiment(
        experiment, out, _threads(threads), _settings(settings), existing, None, timed, _reporter(progress)
    )
    return Run(folder)
