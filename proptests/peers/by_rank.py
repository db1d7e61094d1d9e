"""by_rank.py PROBLEMS PAIRS SEAFIX DRIVERS MAX SEARCH=NAME…: problems solved by a search of Seafix and by its original, by family.

The best pose counts, accepted or not, since the originals have no test of acceptance. Problems of at most MAX pairs with a defined
pose; `python3` runs drivers that end in `.py`.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import judged

problems, pairs, seafix, drivers, largest, *compared = sys.argv[1:]
one_thread = dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
files = [file for file in sorted(Path(pairs).glob("[a-g]???.txt")) if int(file.open().readline().split()[1]) <= int(largest)]
files = [file for file in files if json.loads((Path(problems) / file.stem[0] / f"{file.stem}.truth.json").read_text())["pose_defined"]]


def solved(answers):
    poses = {name: pose for name, pose in answers if pose is not None}
    return {name for name, pose in poses.items() if judged.right(Path(problems) / name[0], name, pose)}


def ours(search):
    for file in files:
        command = [seafix, "solve", "--json", "--search", search, Path(problems) / file.stem[0] / f"{file.stem}.json"]
        answer = json.loads(subprocess.run(command, capture_output=True, text=True, env=one_thread, check=False).stdout)
        yield file.stem, answer["T_cam_obj"] or (answer["best"] or {}).get("T_cam_obj")


def original(program):
    driver = Path(drivers) / program
    command = [sys.executable, driver] if driver.suffix == ".py" else [driver]
    said = subprocess.run([*command, *files], capture_output=True, text=True, env=one_thread, check=False).stderr
    return ((name, pose) for name, _, pose in judged.answers(said.splitlines()))


for pair in compared:
    search, program = pair.split("=")
    own, other = solved(ours(search)), solved(original(program))
    for family in ["", *sorted({file.stem[0] for file in files})]:
        count = sum(file.stem.startswith(family) for file in files)
        a, b = (sum(name.startswith(family) for name in of) for of in (own, other))
        print(f"{search} {family or 'all'}: {a} and {b} of {count}, {100 * (a - b) / count:+.1f} points", flush=True)
