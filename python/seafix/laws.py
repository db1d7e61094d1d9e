"""Property-based tests of a solver or a search."""

from __future__ import annotations

import sys
from typing import TextIO

from ._seafix import search_laws, searches, solver_laws, solvers
from .invalid import invalid


def check_laws(name: str, *, kind: str | None = None, file: TextIO | None = None) -> bool:
    """Run the laws of its kind on a solver or search, and print the smallest counterexample of each broken law.

    The laws are those of the library's own components. Of a solver: exact points give the exact pose, the answer moves
    with the camera and with the object, a pose is never a reflection, and so on. Of a search: a returned set is coherent
    and one-to-one, a mirror image is rejected, and neither the order of the points nor distant points change the answer.
    Each runs on 8 to 32 random problems with a fixed seed; the environment variable ``PROPTEST_CASES`` raises the
    number (256 gives eight times as many).

    Parameters
    ----------
    name : str
        The name of a solver or search, of your own or of the library.
    kind : {"solver", "search"}, optional
        The kind; by default that of the name.
    file : text file, optional
        Where the results are printed; by default the standard output.

    Returns
    -------
    bool
        Whether all laws hold.

    Raises
    ------
    ValueError
        No solver and no search has this name, or a solver needs pixels, which the scenes of these laws do not have.

    Notes
    -----
    A solver that states ``least_squares=True`` must reach the least sum of squares. One that states ``exact=False`` may
    be wrong by 1e-5 (rad, m). An exception of the component other than :class:`DegenerateError` is raised. A name that
    a solver and a search share means the solver, unless ``kind`` is given.

    Examples
    --------
    >>> assert sf.check_laws("mean-translation")
    """
    if kind not in (None, "solver", "search"):
        raise invalid("kind", f"`kind` is {kind!r}", "give 'solver' or 'search'")
    is_search = kind == "search" or kind is None and name not in solvers() and name in searches()
    results = search_laws(name) if is_search else solver_laws(name)
    for statement, counterexample in results:
        print(f"{'holds ' if counterexample is None else 'BROKEN'}  {statement}", file=file or sys.stdout)
        if counterexample is not None:
            print(counterexample, file=file or sys.stdout)
    return all(counterexample is None for _, counterexample in results)
