#!/usr/bin/env python3
"""magsac_package.py PAIRS…: MAGSAC++ for rigid motions by its package (pymagsac 0.2.3), at most 200 000 samples.

The output is that of every driver (common.h).
"""

import sys
import time

import numpy as np
import pymagsac

for path in sys.argv[1:]:
    lines = open(path).read().splitlines()
    name, _, delta = lines[0].split()
    pairs = np.ascontiguousarray([line.split()[:6] for line in lines[1:]], float)
    settings = {"sampler": 0, "use_magsac_plus_plus": True, "sigma_th": float(delta), "conf": 0.999}
    start = time.perf_counter()
    found, _ = pymagsac.findRigidTransformation(pairs, probabilities=[], min_iters=50, max_iters=200_000, **settings)
    taken = 1e3 * (time.perf_counter() - start)
    pose = np.eye(4) if found is None else np.array(found).T
    print(name, f"{taken:.6f}", int(found is not None), *(f"{x:.12g}" for x in pose.ravel()), file=sys.stderr)
