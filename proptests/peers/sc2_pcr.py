#!/usr/bin/env python3
"""sc2_pcr.py PAIRS…: SC²-PCR by the authors' program (torch), which `SC2_PCR` names: a clone of ZhiChen902/SC2-PCR.

Its last refinement has a fixed threshold for two data sets; here it is the tolerance of the problem, as everywhere else. The output is
that of every driver (common.h).
"""

import os
import sys
import time

import numpy as np
import torch

sys.path.insert(0, os.environ["SC2_PCR"])
import SC2_PCR as original  # noqa: E402


class Matcher(original.Matcher):
    def post_refinement(self, initial_trans, src, tgt, it_num, weights=None):
        previous = 0
        for _ in range(it_num):
            off = torch.norm(original.transform(src, initial_trans) - tgt, dim=-1)
            near = (off < self.inlier_threshold)[0]
            count = torch.sum(near)
            if abs(int(count - previous)) < 1:
                break
            previous = count
            weights = 1 / (1 + (off / self.inlier_threshold) ** 2)[:, near]
            initial_trans = original.rigid_transform_3d(A=src[:, near], B=tgt[:, near], weights=weights)
        return initial_trans


torch.set_num_threads(1)
for path in sys.argv[1:]:
    lines = open(path).read().splitlines()
    name, _, delta = lines[0].split()
    pairs = np.array([line.split()[:6] for line in lines[1:]], np.float32)
    source, target = torch.from_numpy(pairs[:, :3])[None], torch.from_numpy(pairs[:, 3:])[None]
    thresholds = dict.fromkeys(("inlier_threshold", "d_thre", "nms_radius"), float(delta))
    matcher = Matcher(**thresholds, ratio=0.2, k1=30, k2=20, num_iterations=10)
    start = time.perf_counter()
    try:
        with torch.no_grad():
            pose = matcher.SC2_PCR(source, target)[0].numpy().astype(float)
    except (RuntimeError, IndexError):
        pose = np.full((4, 4), np.nan)
    taken = 1e3 * (time.perf_counter() - start)
    print(name, f"{taken:.6f}", int(np.isfinite(pose).all()), *(f"{x:.12g}" for x in pose.ravel()), file=sys.stderr)
