"""Solvers, searches and detectors of your own, written in Python."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, TypeVar

from ._seafix import add_detector, add_search, add_solver
from .invalid import invalid

_Function = TypeVar("_Function", bound=Callable[..., Any])


def _declared(function: Callable[..., Any], name: str, source: str, version: int) -> dict[str, Any]:
    """The declaration of a component; its settings are the keyword-only parameters."""
    parameters = inspect.signature(function).parameters.values()
    settings = [parameter for parameter in parameters if parameter.kind is parameter.KEYWORD_ONLY]
    missing = [parameter.name for parameter in settings if parameter.default is parameter.empty]
    if missing:
        what = f"the setting `{missing[0]}` of `{name}` has no default"
        raise invalid(missing[0], what, "give one, so that it can be printed")
    summary = (inspect.getdoc(function) or "").partition("\n")[0] or f"the function {function.__name__}"
    return {
        "name": name,
        "summary": summary,
        "source": source or f"{function.__module__}.{function.__qualname__}",
        "version": version,
        "defaults": {parameter.name: parameter.default for parameter in settings},
    }


def solver(
    name: str,
    *,
    source: str = "",
    version: int = 1,
    minimum: int = 3,
    least_squares: bool = False,
    exact: bool = True,
) -> Callable[[_Function], _Function]:
    """Register a function as a solver.

    Parameters
    ----------
    name : str
        Name of the solver, in kebab-case.
    source : str, optional
        Literature source.
    version : int, default 1
        Version of the results. Raise it with every change that alters a result; a run that is resumed compares it.
    minimum : int, default 3
        Minimum number of points.
    least_squares : bool, default False
        Whether the motion minimises the sum of squared, unweighted residuals.
    exact : bool, default True
        Whether the motion is exact to rounding; False for an iteration that stops before.

    Returns
    -------
    callable
        A decorator. The function is ``function(src, dst, covariances, *, setting=default) -> T`` with `src`, `dst` of
        shape (n, 3) (m), `covariances` of shape (n, 3, 3) (m²), and `T` of shape (4, 4) with ``dst ≈ T @ src``.
        Keyword-only parameters are settings. The function raises :class:`DegenerateError` for points that determine
        no motion.

    Raises
    ------
    ValueError
        A name that is not in kebab-case or that the library uses, or a setting without default.

    Notes
    -----
    The covariance of a fix follows by numerical derivatives through the function, some hundred calls a fix.

    Examples
    --------
    >>> @sf.solver("mean-translation")
    ... def mean_translation(src, dst, covariances):
    ...     T = np.eye(4)
    ...     T[:3, 3] = (dst - src).mean(axis=0)
    ...     return T
    >>> sf.solve(problem, solver="mean-translation")
    """

    def register(function: _Function) -> _Function:
        add_solver(function, _declared(function, name, source, version), minimum, least_squares, exact)
        return function

    return register


def search(name: str, *, source: str = "", version: int = 1) -> Callable[[_Function], _Function]:
    """Register a function as a search.

    Parameters
    ----------
    name : str
        Name of the search, in kebab-case.
    source : str, optional
        Literature source.
    version : int, default 1
        Version of the results. Raise it with every change that alters a result; a run that is resumed compares it.

    Returns
    -------
    callable
        A decorator. The function is ``function(problem, *, setting=default) -> pairs`` with a :class:`SearchProblem`
        and an array of shape (k, 2) of pairs (model, cloud), each a row of ``problem.pairs``. It returns None if it
        finds no set of three pairs. Keyword-only parameters are settings.

    Raises
    ------
    ValueError
        A name that is not in kebab-case or that the library uses, or a setting without default.

    Notes
    -----
    Acceptance is the library's: a returned set becomes a fix only if it passes all tests.

    Examples
    --------
    >>> @sf.search("greedy")
    ... def greedy(problem):
    ...     coherent, chosen = problem.compatibility(), []
    ...     for k in np.argsort(-coherent.sum(axis=1)):
    ...         if all(coherent[k, other] for other in chosen):
    ...             chosen.append(k)
    ...     return problem.pairs[chosen]
    """

    def register(function: _Function) -> _Function:
        add_search(function, _declared(function, name, source, version))
        return function

    return register


def detector(name: str, *, source: str = "", version: int = 1, scale: float = 1.8) -> Callable[[_Function], _Function]:
    """Register a function as a detector of key points.

    Parameters
    ----------
    name : str
        Name of the detector, in kebab-case.
    source : str, optional
        Literature source.
    version : int, default 1
        Version of the results. Raise it with every change that alters a result; a run that is resumed compares it.
    scale : float, default 1.8
        Size of the detected structures: the standard deviation of the Gaussian of their detection (px), by which
        descriptors choose their patch. The default is that of ``harris``.

    Returns
    -------
    callable
        A decorator. The function is ``function(image, *, setting=default) -> points`` with `image` of shape (h, w) and
        type float32 (grey levels, 0 black and 255 white), and `points` of shape (n, 3): rows u, v, score, with u to the
        right from 0 to w − 1 and v down from 0 to h − 1 (px). A larger score is stronger; the order of the rows decides
        between equals. Keyword-only parameters are settings. The image is a copy that the function may change.

    Raises
    ------
    ValueError
        A name that is not in kebab-case or that the library uses, a setting without default, or a scale that is not
        positive.

    Notes
    -----
    A result must depend on the image and the settings alone, so that a run has the same bytes on any number of threads.

    Examples
    --------
    >>> @sf.detector("brightest")
    ... def brightest(image, *, features=100):
    ...     v, u = np.unravel_index(np.argsort(-image, axis=None, kind="stable")[:features], image.shape)
    ...     return np.column_stack([u, v, image[v, u]])
    >>> localizer = sf.Localizer(site, rig, settings='detector = "brightest"')
    """

    def register(function: _Function) -> _Function:
        add_detector(function, _declared(function, name, source, version), scale)
        return function

    return register
