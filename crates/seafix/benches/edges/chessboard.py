"""The pose of a chessboard by the sides of its squares alone, compared with that by its corners alone.

    chessboard.py SEAFIX DATASET

SEAFIX is the program. The site of the data set lists the corners of the board; this script adds the sides between
neighbouring corners as edges, and runs `pipeline.points = "off"` and `pipeline.edges = "off"` on the same pairs. The NEES is
that of the difference of both poses, with the sum of their covariances. Both see the same board and share its errors, so
that the sum is too large for a site that states errors of its corners and too small for one that states none, while the board
is not exact: both are measured. Needs numpy.
"""

import csv
import itertools
import re
import statistics
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

try:
    import numpy as np
except ImportError:
    print("skipped: numpy is absent")
    sys.exit()

from dataset import matrix, run, trajectory, tre, variant

# The board is nearer than the default, and its squares repeat along the epipolar lines: a wide range admits several matches.
RANGE = 'pipeline.segment-matcher={name="overlap-profile",min-depth=0.2,max-depth=0.45}'
NEIGHBOURS = 1.01  # corners are neighbours up to this multiple of the shortest distance


def with_sides(folder, exact):
    """Writes a site with sides, with or without errors of its corners, into a copy of a data set; gives the corners."""
    about = (folder / "dataset.toml").read_text()
    name = tomllib.loads(about)["site"]
    text = (folder / name).read_text()
    board = tomllib.loads(text)["object"][0]
    corners = {point["id"]: np.array(point["at"]) for point in board["point"]}
    apart = {(a, b): np.linalg.norm(corners[a] - corners[b]) for a, b in itertools.combinations(corners, 2)}
    sides = [ends for ends, length in apart.items() if length < NEIGHBOURS * min(apart.values())]
    text = text.replace("seafix-site/1", "seafix-site/1.1", 1)
    if exact:
        text = re.sub(r"^sigma\s*=.*$", "sigma = 0.0", text, flags=re.MULTILINE)
    text += "".join(f'\n[[object.edge]]\nid = "{a}-{b}"\nfrom = "{a}"\nto = "{b}"\n' for a, b in sides)
    (folder / "site-sides.toml").write_text(text)
    (folder / "dataset.toml").write_text(about.replace(f'"{name}"', '"site-sides.toml"'))
    return np.array(list(corners.values())), len(sides)


def fixes(seafix, folder, out, setting):
    """Camera from board, its covariance and the numbers of identified points and edges, by stamp."""
    out = run(seafix, folder, out, "--set", setting, "--set", RANGE)
    said = subprocess.run([seafix, "fixes", out, "--format", "csv"], capture_output=True, text=True, check=True)
    rows = {int(row["stamp_ns"]): row for row in csv.DictReader((out / "results.csv").open())}
    found = {}
    for row in csv.DictReader(said.stdout.splitlines()):
        pose = matrix([float(row[key]) for key in ("tx", "ty", "tz", "qx", "qy", "qz", "qw")])
        covariance = np.zeros((6, 6))
        for i, j in itertools.combinations_with_replacement(range(6), 2):
            covariance[i, j] = covariance[j, i] = float(row[f"c{i}{j}"])
        stamp = int(row["stamp_ns"])
        used = rows[stamp]
        found[stamp] = (pose, covariance, int(used["identified"] or 0), int(used["edges_identified"] or 0))
    return found


def step(a, b):
    """The small motion ξ = (φ, ρ) with b = a · Exp(ξ), to first order."""
    off = np.linalg.inv(a) @ b
    return np.array([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1], *(2 * off[:3, 3])]) / 2


class Corners:
    def __init__(self, points):
        self.points = points


def compare(seafix, source, exact):
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        copy = variant(source, folder / "data")
        points, sides = with_sides(copy, exact)
        about = tomllib.loads((copy / "dataset.toml").read_text())
        # The board defines the world, so that the reference is board from camera.
        reference = trajectory(copy / about["truth"])
        by_corners = fixes(seafix, copy, folder / "corners", "pipeline.edges=off")
        by_sides = fixes(seafix, copy, folder / "sides", "pipeline.points=off")
    board = Corners(points)
    between = lambda a, b: 1e3 * tre(board, np.linalg.inv(a), np.linalg.inv(b))
    errors = "exact" if exact else "with the errors of the site"
    head = f"{len(reference)} pairs of {len(points)} corners, {errors}, and {sides} sides"
    print(f"\n{head}; distances are RMS over the corners (mm)\n")
    print("| pair | corners | sides | sides to corners | corners to reference | sides to reference | NEES |")
    print("|---|---|---|---|---|---|---|")
    rows = []
    for number, (stamp, true) in enumerate(sorted(reference.items()), 1):
        if stamp not in by_corners or stamp not in by_sides:
            without = [name for name, all in (("corners", by_corners), ("sides", by_sides)) if stamp not in all]
            print(f"| {number} | no fix by {' and by '.join(without)} | | | | | |")
            continue
        (a, of_a, corners, _), (b, of_b, _, edges) = by_corners[stamp], by_sides[stamp]
        off = step(a, b)
        nees = float(off @ np.linalg.solve(of_a + of_b, off))
        rows.append((between(a, b), between(a, true), between(b, true), nees))
        apart, *own = rows[-1]
        print(f"| {number} | {corners} | {edges} | {apart:.3f} | {own[0]:.3f} | {own[1]:.3f} | {nees:.1f} |")
    for name, of in (("median", statistics.median), ("greatest", max), ("mean", statistics.mean)):
        apart, a, b, nees = (of(column) for column in zip(*rows))
        print(f"| {name} | | | {apart:.3f} | {a:.3f} | {b:.3f} | {nees:.1f} |")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    if not Path(sys.argv[2]).is_dir():
        print(f"skipped: {sys.argv[2]} is absent")
    else:
        for exact in (False, True):
            compare(*sys.argv[1:], exact)
