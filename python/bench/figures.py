"""Measures what the package costs beside the program and its peers.

    python python/bench/figures.py --program target/release/seafix PROBLEM.json …

Every figure is a median over many calls in one process on one thread. Peers are those of the packages installed:
`pip install scipy open3d small_gicp`. Times depend on the load of the machine, which is printed first.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

SAMPLE = Path(__file__).resolve().parents[2] / "datasets" / "virtual-sample"


def each(call, count):
    """The times (s) of `count` calls after one that warms up."""
    call()
    times = []
    for _ in range(count):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return times


def per_call(call, loops=2000, repeats=15):
    """The median over repeats of the mean time (s) of a call."""
    call()
    means = []
    for _ in range(repeats):
        start = time.perf_counter()
        for _ in range(loops):
            call()
        means.append((time.perf_counter() - start) / loops)
    return statistics.median(means)


def imports(count=15):
    """The time (ms) of `import seafix` beyond that of numpy, each in a new interpreter, alternately."""
    def one(module):
        program = f"import time; s = time.perf_counter(); import {module}; print(time.perf_counter() - s)"
        return 1e3 * float(subprocess.run([sys.executable, "-c", program], capture_output=True, check=True).stdout)

    pairs = [(one("numpy"), one("numpy, seafix")) for _ in range(count)]
    numpy_alone, both = (statistics.median(times) for times in zip(*pairs))
    print(f"import: {both - numpy_alone:.1f} ms beyond numpy's {numpy_alone:.1f} ms")


def answers(sf, program, problems, limit):
    """Compares the answers with those of the program, and the time of a call with that of its solution."""
    printed = subprocess.run([program, "solve", "--json", *problems], capture_output=True, text=True).stdout
    printed = [json.loads(line) for line in printed.splitlines()]
    assert len(printed) == len(problems), f"{len(printed)} answers to {len(problems)} problems"
    timeless = lambda answer: {key: answer[key] for key in answer if key != "time_ms"}
    different, beyond = [], []
    for path, of_program in zip(problems, printed):
        problem = sf.Problem.load(path)
        answer = sf.solve(problem)
        if timeless(answer.to_dict()) != timeless(of_program):
            different.append(path)
        # Long searches would measure the scatter of their own times.
        for _ in range(20 if answer.time_ms < limit else 0):
            start = time.perf_counter()
            answer = sf.solve(problem)
            beyond.append(1e6 * (time.perf_counter() - start) - 1e3 * answer.time_ms)
    print(f"sf.solve: {len(problems) - len(different)} of {len(problems)} answers equal those of the program")
    for path in different[:5]:
        print(f"  another answer: {path}")
    low, high = np.percentile(beyond, [5, 95])
    print(f"sf.solve: {statistics.median(beyond):.1f} µs a call beyond the solution, 5 to 95 %: {low:.1f} to {high:.1f} µs ({len(beyond)} calls of less than {limit} ms)")


def registration(sf):
    """The registration of thirteen points by kabsch beside peers."""
    rng = np.random.default_rng(3)
    source = rng.normal(size=(13, 3))
    angle = 0.4
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    target = source @ turn.T + [1.0, 2.0, 3.0] + rng.normal(scale=1e-3, size=source.shape)
    calls = {"seafix.register, kabsch": lambda: sf.register(source, target, solver="kabsch")}
    try:
        from scipy.spatial.transform import Rotation

        def scipy():
            a, b = source.mean(axis=0), target.mean(axis=0)
            rotation, _ = Rotation.align_vectors(target - b, source - a)
            return rotation, b - rotation.apply(a)

        calls["SciPy, Rotation.align_vectors with centroids"] = scipy
    except ImportError as error:
        print(f"no SciPy: {error}")
    try:
        import open3d

        clouds = [open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points)) for points in (source, target)]
        pairs = open3d.utility.Vector2iVector(np.column_stack([np.arange(13)] * 2).astype(np.int32))
        estimation = open3d.pipelines.registration.TransformationEstimationPointToPoint()
        calls["Open3D, point to point on prepared clouds"] = lambda: estimation.compute_transformation(*clouds, pairs)
    except ImportError as error:
        print(f"no Open3D: {error}")
    try:
        import small_gicp

        # It has no registration of given pairs: one iteration of ICP on prepared clouds, from the solution.
        prepared = [small_gicp.PointCloud(np.column_stack([points, np.ones(13)])) for points in (target, source)]
        tree = small_gicp.KdTree(prepared[0])
        guess = np.eye(4)
        guess[:3, :3], guess[:3, 3] = turn, [1.0, 2.0, 3.0]
        calls["small_gicp, one iteration of ICP on prepared clouds"] = lambda: small_gicp.align(
            *prepared, tree, guess, registration_type="ICP", num_threads=1, max_iterations=1
        )
    except ImportError as error:
        print(f"no small_gicp: {error}")
    for name, call in calls.items():
        print(f"13 points, {name}: {1e6 * per_call(call):.2f} µs")


def images(sf, count=15):
    """The time of a call for one stereo pair beyond that of all stages in Rust."""
    rig, site = sf.Rig.load(SAMPLE / "dataset.toml"), sf.Site.load(SAMPLE / "site.toml")
    localizer = sf.Localizer(site, rig)
    from PIL import Image

    left, right = (np.asarray(Image.open(SAMPLE / f"{side}000.png").convert("L")) for side in ("left", "right"))
    line = next(line for line in (SAMPLE / "truth.tum").read_text().splitlines() if not line.startswith("#"))
    x, y, z, *quaternion = map(float, line.split()[1:])
    from scipy.spatial.transform import Rotation

    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_quat(quaternion).as_matrix(), [x, y, z]
    prior = sf.PosePrior(pose, position_sigma=0.1, attitude_sigma=np.radians(0.5))
    beyond, full = [], []
    for _ in range(count):
        start = time.perf_counter()
        answers = localizer.localize(left, right, prior)
        full.append(1e3 * (time.perf_counter() - start))
        assert len(answers) == 1, "the stages of several targets would be added twice"
        beyond.append(full[-1] - answers[0].time_ms)
    print(f"Localizer, {left.shape[1]}×{left.shape[0]} px: {statistics.median(beyond):.2f} ms a call beyond the stages in Rust, of {statistics.median(full):.0f} ms")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", help="the command `seafix` of the same build")
    parser.add_argument("--limit", type=float, default=5.0, help="the longest solution that is timed (ms)")
    parser.add_argument("problems", nargs="*", help="files of the format coherence-problem/1")
    arguments = parser.parse_args()
    print(f"load of the machine: {os.getloadavg()[0]:.2f} on {os.cpu_count()} cores")
    imports()
    import seafix as sf

    if arguments.program and arguments.problems:
        answers(sf, arguments.program, arguments.problems, arguments.limit)
    registration(sf)
    images(sf)
    print(f"load of the machine: {os.getloadavg()[0]:.2f}")


if __name__ == "__main__":
    main()
