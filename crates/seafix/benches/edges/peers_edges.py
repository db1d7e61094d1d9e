"""ViSP's stereo edge tracker and OpenCV's LSD beside Seafix.

    peers_edges.py visp SEAFIX DATASET [PRIOR.tum METRES DEGREES]
    peers_edges.py lsd SEAFIX [DATASET…]

SEAFIX is the program. `visp` starts ViSP at the priors of a data set with truth and compares its poses with those of
`seafix run`; another prior file of the data set may be named, with its standard deviations. `lsd` measures the offsets of
LSD's segments, and those of Seafix, from edges of known place: of rendered half-planes and of the objects of data sets. Needs
numpy; `lsd` also opencv-python-headless, mcap and mcap-protobuf-support. A peer that is absent is skipped.
"""

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import numpy as np
except ImportError:
    print("skipped: numpy is absent")
    sys.exit()

import dataset as data

HERE = Path(__file__).parent
LIBRARIES = ["mbt", "visual_features", "vision", "me", "io", "core"]
CALLS = [1, 5, 20]
SEEN = 6  # edges of the object that must be visible for an attempt to count
BASE = {
    "range": 30,
    "least": 30,
    "threshold": 5000,
    "mu": 0.5,
    "step": 4,
    "min_length": 0,
    "ratio": 0.4,
    "faces": False,
}
# Ranges (px) of the moving edges: first and least, with the object's edges as lines and with its faces.
RANGES = [(8, 8), (15, 15), (30, 30), (45, 45), (60, 60), (30, 8), (45, 8), (60, 8), (120, 8), (200, 8)]
FIRST = [dict(BASE, range=r, least=least, faces=faces) for r, least in RANGES for faces in (False, True)]
# Changes of the best of these, one at a time.
SECOND = [{"threshold": 1000}, {"threshold": 20000}, {"mu": 0.2}, {"mu": 0.8}, {"step": 2}, {"min_length": 20}, {"ratio": 0.0}]


def visp(folder):
    """The compiled driver, or None with the reason printed."""
    if not shutil.which("pkg-config") or not shutil.which("c++"):
        return print("skipped: pkg-config or a C++ compiler is absent")
    said = subprocess.run(["pkg-config", "--cflags", "visp"], capture_output=True, text=True)
    if said.returncode:
        return print("skipped: libvisp-dev is absent")
    program = folder / "visp_stereo"
    # `pkg-config --libs` also names the libraries of viewers and cameras.
    libraries = [f"-lvisp_{name}" for name in LIBRARIES]
    subprocess.run(["c++", "-O3", HERE / "visp_stereo.cpp", "-o", program, *said.stdout.split(), *libraries], check=True)
    return program


def track(program, dataset, attempts, folder, setting, calls):
    """ViSP's answers by number of calls and attempt: whether it gave none up, milliseconds, pose."""
    lines = [" ".join(str(camera[key]) for key in ("fx", "fy", "cx", "cy")) for camera in dataset.cameras]
    lines.append(" ".join(map(str, dataset.right_from_left.ravel())))
    folder.mkdir(exist_ok=True)
    for number, attempt in enumerate(attempts):
        model = folder / f"{number}-{setting['faces']}.cao"
        if not model.exists():
            model.write_text(data.cao(dataset.objects[attempt.object], attempt.prior, setting["faces"]))
        lines.append(" ".join([attempt.left, attempt.right, str(model), *map(str, attempt.prior.ravel())]))
    words = [int(setting[key]) if key == "faces" else setting[key] for key in BASE]
    said = subprocess.run(
        [program, *map(str, words), *map(str, calls)],
        input="\n".join(lines) + "\n",
        capture_output=True,
        text=True,
        env=dict(os.environ, OMP_NUM_THREADS="1"),
    )
    if said.returncode:
        print(f"ViSP ended with {said.returncode}: {said.stderr[-300:]}", file=sys.stderr)
    found = {number: {} for number in calls}
    for line in said.stdout.splitlines():
        words = line.split()
        if len(words) == 21 and words[0].isdigit():
            pose = np.array(words[5:], float).reshape(4, 4)
            found[int(words[1])][int(words[0])] = (words[2] == "1", float(words[3]), pose)
    return found


def counted(dataset, attempts, answers):
    """Answers, those within the alert limit, their median TRE (mm), median milliseconds."""
    given = {i: answer for i, answer in answers.items() if answer[0] and np.isfinite(answer[2]).all()}
    errors = {i: data.tre(dataset.objects[attempts[i].object], answer[2], attempts[i].truth) for i, answer in given.items()}
    within = [e for i, e in errors.items() if e <= float(attempts[i].row["alert_limit"])]
    middle = 1e3 * statistics.median(within) if within else float("nan")
    return len(given), len(within), middle, statistics.median([a[1] for a in answers.values()] or [float("nan")])


def row(name, count, absent, answers, within, middle, ms):
    middle = f"{middle:.2f}" if within else "–"
    print(f"| {name} | {within} of {count} | {answers - within} | {absent} | {middle} | {ms:.0f} |", flush=True)


def visp_command(seafix, source, prior=None, *sigma):
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        dataset = data.Dataset(data.variant(source, folder / "data", prior, sigma))
        attempts = dataset.attempts(data.run(seafix, dataset.folder, folder / "run"))
        seen = [a for a in attempts if int(a.row["edges_visible"] or 0) >= SEEN]
        unseen = [a for a in attempts if int(a.row["edges_visible"] or 0) == 0 and int(a.row["visible"] or 0) == 0]
        start = prior or dataset.about["prior"]
        print(f"\n{Path(source).resolve().name}, {start}: {len(seen)} attempts with {SEEN} visible edges or more, ", end="")
        print(f"{len(unseen)} with nothing of the object in view\n")
        print("| | within the limit | wrong | answers without the object | median TRE (mm) | ms |\n|---|---|---|---|---|---|")
        fixes = [a for a in seen if a.row["outcome"] == "fix"]
        errors = [1e3 * float(a.row["tre_rms"]) for a in fixes]
        within = [e for a, e in zip(fixes, errors) if a.row["wrong"] == "false"]
        absent = f"{sum(a.row['outcome'] == 'fix' for a in unseen)} of {len(unseen)}"
        ms = statistics.median(float(a.row["total_ms"]) for a in seen)
        row("Seafix", len(seen), absent, len(fixes), len(within), statistics.median(within or [float("nan")]), ms)
        program = visp(folder)
        if program is None:
            return
        tried = []

        def measure(setting):
            answers, within, middle, ms = counted(dataset, seen, track(program, dataset, seen, folder, setting, [5])[5])
            tried.append((within, -middle if within else 0.0, setting))
            words = f"{within:3} within, {answers - within:3} wrong, {middle:7.2f} mm, {ms:6.0f} ms: {setting}"
            print(words, file=sys.stderr, flush=True)

        for setting in FIRST:
            measure(setting)
        best = max(tried, key=lambda t: t[:2])[2]
        for change in SECOND:
            measure(dict(best, **change))
        best = max(tried, key=lambda t: t[:2])[2]
        found = track(program, dataset, seen, folder, best, CALLS)
        others = track(program, dataset, unseen, folder / "unseen", best, CALLS)
        for calls in CALLS:
            absent = f"{sum(answer[0] for answer in others[calls].values())} of {len(unseen)}"
            row(f"ViSP, {calls} call{'s' if calls > 1 else ''}", len(seen), absent, *counted(dataset, seen, found[calls]))
        print("\nBest setting of ViSP:", ", ".join(f"{key} {value}" for key, value in best.items()))


def main(words):
    """Run a command of the line."""
    if words[:1] == ["visp"] and len(words) in (3, 6):
        visp_command(*words[1:])
    elif words[:1] == ["lsd"] and len(words) > 1:
        try:
            import cv2
            import mcap_protobuf  # noqa: F401

            cv2.createLineSegmentDetector  # noqa: B018
        except (ImportError, AttributeError) as absent:
            return print(f"skipped: LSD of OpenCV, or a reader of logs, is absent ({absent})")
        import lsd

        with tempfile.TemporaryDirectory() as folder:
            lsd.compare(words[1], words[2:], Path(folder))
    else:
        raise SystemExit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
