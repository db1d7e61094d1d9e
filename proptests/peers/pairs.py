"""pairs.py PROBLEMS OUT: every problem of the families a–g as a list of pairs, one text file each.

The first line has the id, the number of pairs and Δ; then a line for each pair: model point, measured point, and their indices.
"""

import json
import sys
from pathlib import Path

import numpy as np


def pairs(problem):
    """The candidates of a problem: as given, in the prior's gates, or all."""
    model, cloud = (np.array(problem[key], float)[:, :3] for key in ("model", "cloud"))
    if problem.get("putative"):
        return model, cloud, np.array(problem["putative"], int)
    if problem.get("prior"):
        pose = np.array(problem["prior"]["T_cam_obj"])
        off = np.abs((model @ pose[:3, :3].T + pose[:3, 3])[:, None] - cloud)
        return model, cloud, np.argwhere((off <= problem["prior"]["shell_half_m"]).all(2))
    return model, cloud, np.argwhere(np.ones((len(model), len(cloud)), bool))


problems, out = map(Path, sys.argv[1:])
out.mkdir(parents=True, exist_ok=True)
for file in sorted(problems.glob("[a-g]/[a-g]???.json")):
    problem = json.loads(file.read_text())
    model, cloud, admitted = pairs(problem)
    lines = [f"{problem['id']} {len(admitted)} {problem['delta']!r}"]
    for i, j in admitted:
        lines.append(" ".join(repr(float(x)) for x in (*model[i], *cloud[j])) + f" {i} {j}")
    (out / f"{problem['id']}.txt").write_text("\n".join(lines) + "\n")
