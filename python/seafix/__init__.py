"""Fixes of an underwater vehicle relative to a known object.

A fix is the camera's pose in the frame of an object, identified by structural coherence in a cloud of measured points.
Lengths are in metres, angles in radians, times in nanoseconds. A transform ``a_from_b`` maps columns:
``p_a = a_from_b @ p_b``.

>>> import seafix as sf
>>> answer = sf.solve(sf.Problem(model, cloud, sigma=0.01))
>>> T, covariance = sf.register(src, dst)
"""

from . import convert, plot
from ._seafix import (
    Answer,
    BoxPrior,
    DegenerateError,
    Frame,
    Integrity,
    Localizer,
    Log,
    Motion,
    Odometry,
    Pose,
    PosePrior,
    Problem,
    Rig,
    SearchProblem,
    Site,
    TargetResult,
    __version__,
    describe,
    detect,
    detectors,
    read_log,
    register,
    searches,
    solve,
    solvers,
)
from .components import detector, search, solver
from .laws import check_laws
from .runs import Run, run
from .shards import Shard, compute, merge, shards

__all__ = [
    "Answer",
    "BoxPrior",
    "DegenerateError",
    "Frame",
    "Integrity",
    "Localizer",
    "Log",
    "Motion",
    "Odometry",
    "Pose",
    "PosePrior",
    "Problem",
    "Rig",
    "Run",
    "SearchProblem",
    "Shard",
    "Site",
    "TargetResult",
    "__version__",
    "check_laws",
    "compute",
    "convert",
    "describe",
    "detect",
    "detector",
    "detectors",
    "merge",
    "plot",
    "read_log",
    "register",
    "run",
    "search",
    "searches",
    "shards",
    "solve",
    "solver",
    "solvers",
]
