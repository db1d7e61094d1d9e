#!/usr/bin/env python3
"""kiss_package.py PAIRS…: KISS-Matcher on given pairs by its package (kiss_matcher 1.0.2), without its sources.

The output is that of every driver (common.h). The time includes the transfer of the points and is thus an upper bound.
"""

import sys
import time

import kiss_matcher
import numpy as np


def points(rows):
    return [np.ascontiguousarray(row, np.float32).reshape(3, 1) for row in rows]


for path in sys.argv[1:]:
    lines = open(path).read().splitlines()
    name, _, delta = lines[0].split()
    pairs = np.array([line.split() for line in lines[1:]], float).reshape(-1, 8)
    model, cloud = points(pairs[:, :3]), points(pairs[:, 3:6])
    config = kiss_matcher.KISSMatcherConfig(voxel_size=float(delta))
    config.robin_noise_bound, config.solver_noise_bound = float(delta), 0.75 * float(delta)
    matcher = kiss_matcher.KISSMatcher(config)
    start = time.perf_counter()
    found = matcher.prune_and_solve(model, cloud)
    taken = 1e3 * (time.perf_counter() - start)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = found.rotation, np.ravel(found.translation)
    answered = int(found.valid and matcher.get_num_final_inliers() >= 3)
    print(name, f"{taken:.6f}", answered, *(f"{x:.12g}" for x in pose.ravel()), file=sys.stderr)
