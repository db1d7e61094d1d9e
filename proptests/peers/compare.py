"""compare.py PROBLEMS PAIRS SEAFIX DRIVERS FAMILY ROUNDS NAME…: times, answers and wrong answers of a family, Seafix first.

Programs alternate: each runs the complete family in every round, on one thread. Times are medians over the rounds, then over the
problems of at most 6000 pairs; solved and wrong are those of the problems' README.
"""

import json
import os
import statistics
import subprocess
import sys
from pathlib import Path

import judged

problems, pairs, seafix, drivers, family, rounds, *names = sys.argv[1:]
problems, pairs = Path(problems) / family, Path(pairs)
ids = sorted(file.stem for file in pairs.glob(f"{family}???.txt"))
ids = [name for name in ids if int((pairs / f"{name}.txt").open().readline().split()[1]) <= 6000]
one_thread = dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")


def ours():
    files = [problems / f"{name}.json" for name in ids]
    said = subprocess.run([seafix, "solve", "--json", *files], capture_output=True, text=True, env=one_thread).stdout
    for name, line in zip(ids, said.splitlines(), strict=True):
        answer = json.loads(line)
        yield name, answer["time_ms"], answer["T_cam_obj"]


def peer(program):
    files = [pairs / f"{name}.txt" for name in ids]
    said = subprocess.run([Path(drivers) / program, *files], capture_output=True, text=True, env=one_thread).stderr
    yield from (answer for answer in judged.answers(said.splitlines()) if answer[0] in ids)


times = {name: {} for name in ["ours", *names]}
poses = {name: {} for name in times}
for _ in range(int(rounds)):
    for name in times:
        for problem, taken, pose in ours() if name == "ours" else peer(name):
            times[name].setdefault(problem, []).append(taken)
            poses[name][problem] = pose
for name, of in times.items():
    if not of:
        print(family, name, "no answer")
        continue
    median = {problem: statistics.median(taken) for problem, taken in of.items()}
    own = {problem: statistics.median(times["ours"][problem]) for problem in of}
    ratio = statistics.median(own.values()) / statistics.median(median.values())
    each = statistics.median(own[problem] / max(median[problem], 1e-9) for problem in of)
    answers = {problem: pose for problem, pose in poses[name].items() if pose is not None}
    solved = sum(judged.right(problems, problem, pose) for problem, pose in answers.items())
    print(
        f"{family} {name}: {statistics.median(median.values()):.4g} ms of {len(of)}, ours over it {ratio:.3f}, "
        f"median of ratios {each:.3f}; solved {solved}, wrong {len(answers) - solved} of {len(answers)}",
        flush=True,
    )
