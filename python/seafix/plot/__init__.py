"""Figures in the style of the reports, with matplotlib.

Each function draws on one pair of axes and returns it: ``ax.figure.savefig("errors.pdf")`` writes the figure. The data
are runs (:class:`seafix.Run`), their tables, or arrays.
"""

from .errors import errors
from .forest import forest
from .roc import roc
from .trajectory import trajectory

__all__ = ["errors", "forest", "roc", "trajectory"]
