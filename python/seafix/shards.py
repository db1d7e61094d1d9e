"""Runs that are divided among processes or machines."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ._seafix import merge_runs, run_experiment
from .invalid import invalid
from .runs import Run, _settings, _threads


@dataclass(frozen=True)
class Shard:
    """A part of a run; calling it computes the part.

    A shard is a small value that can be pickled, so that any engine can send it to a worker; :func:`compute` does so
    with :mod:`concurrent.futures`, Dask and Ray. A shard that was interrupted is called again and continues where it
    stopped.

    Attributes
    ----------
    experiment : str
        The experiment file or the folder of a data set, as a path that the worker can read.
    number, count : int
        The part, 1 to `count`, and the number of parts.
    out : str
        The folder of the part, which the worker can write.
    threads : int
        Number of threads of the worker.
    timed : bool
        Whether durations are logged.
    settings : tuple of str
        Changed settings, ``key=value``.
    """

    experiment: str
    number: int
    count: int
    out: str
    threads: int = 1
    timed: bool = True
    settings: tuple[str, ...] = field(default=())

    def __call__(self) -> str:
        """Compute the part.

        Returns
        -------
        str
            The folder of the part.

        Raises
        ------
        ValueError
            The experiment has faults.
        OSError
            The folder cannot be written.
        """
        folder, _ = run_experiment(
            self.experiment,
            self.out,
            self.threads,
            list(self.settings),
            "resume",
            f"{self.number}/{self.count}",
            self.timed,
            None,
        )
        return str(folder)


def shards(
    experiment: str | os.PathLike[str],
    count: int,
    out: str | os.PathLike[str],
    *,
    threads: int = 1,
    timed: bool = True,
    settings: Mapping[str, Any] | Sequence[str] = (),
) -> list[Shard]:
    """Divide a run into parts.

    Parameters
    ----------
    experiment : str or os.PathLike
        An experiment file, or the folder of a data set.
    count : int
        Number of parts.
    out : str or os.PathLike
        The folder below which each part has a folder of its own.
    threads : int, default 1
        Number of threads of each part.
    timed : bool, default True
        Log durations. Without them the merged run has the bytes of an undivided one.
    settings : mapping or sequence of str, optional
        Changed settings by dotted key.

    Returns
    -------
    list of Shard
        The parts. :func:`merge` joins their folders.

    Raises
    ------
    ValueError
        Fewer than one part.

    Examples
    --------
    >>> with concurrent.futures.ProcessPoolExecutor() as pool:
    ...     folders = sf.compute(sf.shards("experiment.toml", 4, "parts"), pool)
    >>> run = sf.merge(folders, "run")
    """
    if count < 1:
        raise invalid("count", f"`count` is {count}", "give 1 or more parts")
    source, folder = str(Path(experiment).absolute()), Path(out).absolute()
    changed = tuple(_settings(settings))
    return [
        Shard(source, number, count, str(folder / f"{number}-of-{count}"), _threads(threads), timed, changed)
        for number in range(1, count + 1)
    ]


def compute(parts: Sequence[Shard], engine: Any = None, *, retries: int = 3) -> list[str]:
    """Compute the parts of a run with an engine.

    Parameters
    ----------
    parts : sequence of Shard
        The parts.
    engine : concurrent.futures.Executor, dask.distributed.Client or module ray, optional
        The engine: an executor, a client of a Dask cluster, or the module ``ray`` after ``ray.init()``. By default this
        process computes one part after the other.
    retries : int, default 3
        How often Ray starts a part again whose worker ended. Dask has a setting for it
        (``distributed.scheduler.allowed-failures``); an executor starts none again.

    Returns
    -------
    list of str
        The folders of the parts, in their order, for :func:`merge`.

    Raises
    ------
    ValueError
        The experiment has faults.
    TypeError
        Another kind of engine.
    concurrent.futures.process.BrokenProcessPool
        A worker of a process pool ended. The same parts in a new pool continue where they stopped.

    Notes
    -----
    The workers need the package, and the folders of the experiment and of the parts under the same paths. Dask counts
    the end of a worker against a part; a part that ended several workers is not started again. Ctrl-C leaves the parts
    to the engine.

    Examples
    --------
    >>> with dask.distributed.Client(cluster) as client:
    ...     folders = sf.compute(sf.shards("experiment.toml", 64, "parts"), client)
    >>> ray.init(address="auto")
    >>> folders = sf.compute(sf.shards("experiment.toml", 64, "parts"), ray)
    """
    if engine is None:
        return [part() for part in parts]
    if isinstance(engine, Executor):
        return list(engine.map(Shard.__call__, parts))
    if hasattr(engine, "gather") and hasattr(engine, "map"):
        # Dask would take two parts with equal values for one; parts write files, so each is computed.
        return list(engine.gather(engine.map(Shard.__call__, parts, pure=False)))
    if hasattr(engine, "remote") and hasattr(engine, "get"):
        task = engine.remote(max_retries=retries)(Shard.__call__)
        return list(engine.get([task.remote(part) for part in parts]))
    remedy = "give an executor of concurrent.futures, a client of Dask, or the module ray"
    raise TypeError(f"`engine` is a {type(engine).__name__}; {remedy}")


def merge(
    folders: Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    *,
    threads: int | None = None,
    existing: str = "refuse",
) -> Run:
    """Join the parts of a run.

    Parameters
    ----------
    folders : sequence of str or os.PathLike
        The folders of all parts.
    out : str or os.PathLike
        The folder of the run, new or empty.
    threads : int, optional
        Number of threads. By default all cores.
    existing : {"refuse", "resume", "overwrite"}, default "refuse"
        Treatment of a run that the folder already holds.

    Returns
    -------
    Run
        The joined run. Except for durations its bytes are those of an undivided run.

    Raises
    ------
    ValueError
        Parts of different runs, or missing or damaged parts.
    OSError
        The folder cannot be written.
    """
    folder, _ = merge_runs([Path(folder) for folder in folders], out, _threads(threads), existing)
    return Run(folder)
