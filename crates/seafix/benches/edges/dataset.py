"""Data sets of Seafix for the peers: rig, objects with their edges, poses, attempts of a run."""

import csv
import shutil
import subprocess
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

FACE_TOLERANCE = 0.006  # m: model errors of edges of one face, six standard deviations


def matrix(numbers):
    """The pose of a TUM line without its stamp: x y z qx qy qz qw."""
    x, y, z, w = numbers[3:]
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = numbers[:3]
    return pose


def trajectory(file):
    """World from camera by stamp (ns)."""
    poses = {}
    for line in file.read_text().splitlines():
        if line.strip() and not line.startswith("#"):
            stamp, *numbers = line.split()
            seconds, _, decimals = stamp.partition(".")
            poses[int(seconds) * 10**9 + int(decimals.ljust(9, "0")[:9])] = matrix([float(n) for n in numbers])
    return poses


def moved(a, b):
    """The rigid motion that takes the points a to the points b."""
    ca, cb = a.mean(0), b.mean(0)
    u, _, v = np.linalg.svd((a - ca).T @ (b - cb))
    turn = v.T @ np.diag([1, 1, np.sign(np.linalg.det(v.T @ u.T))]) @ u.T
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, cb - turn @ ca
    return pose


@dataclass
class Object:
    points: np.ndarray
    edges: list  # pairs of ends
    faces: list  # unit normals of each edge
    surveyed: np.ndarray  # world from object by the survey
    true: np.ndarray  # world from object


@dataclass
class Attempt:
    left: str
    right: str
    object: str
    prior: np.ndarray  # left camera from object
    truth: np.ndarray
    row: dict = field(repr=False)


class Dataset:
    def __init__(self, folder):
        self.folder = Path(folder)
        self.about = tomllib.loads((self.folder / "dataset.toml").read_text())
        rig = self.about["rig"]
        self.cameras = [rig["left"], rig["right"]]
        if any(any(camera.get("distortion", [])) for camera in self.cameras):
            raise SystemExit(f"{folder}: ViSP needs images without distortion")
        self.right_from_left = np.array(rig["right_from_left"], float)
        self.frames = list(csv.DictReader((self.folder / self.about["frames"]).open()))
        self.truth = trajectory(self.folder / self.about["truth"])
        self.prior = trajectory(self.folder / self.about["prior"])
        self.objects = self.read_objects()

    def read_objects(self):
        true = {}
        if "objects" in self.about:
            for row in csv.DictReader((self.folder / self.about["objects"]).open()):
                name = row.pop("object")
                true[name] = np.array([float(n) for n in row.values()]).reshape(4, 4)
        objects = {}
        for entry in tomllib.loads((self.folder / self.about["site"]).read_text())["object"]:
            points = {point["id"]: np.array(point["at"], float) for point in entry["point"]}
            base = np.array([points[name] for name in entry["base"]])
            surveyed = moved(base, np.array(entry["base_in_world"], float))
            edges = entry.get("edge", [])
            ends = [
                [points[end] if isinstance(end, str) else np.array(end, float) for end in (e["from"], e["to"])]
                for e in edges
            ]
            faces = [[np.array(n, float) for n in e.get("faces", [])] for e in edges]
            objects[entry["id"]] = Object(
                np.array(list(points.values())), ends, faces, surveyed, true.get(entry["id"], surveyed)
            )
        return objects

    def attempts(self, run):
        """The attempts of a run of Seafix: object by object, with the prior and the true pose."""
        found = []
        for row in csv.DictReader((Path(run) / "results.csv").open()):
            if row["object"]:
                stamp, frame, it = int(row["stamp_ns"]), self.frames[int(row["frame"])], self.objects[row["object"]]
                prior = np.linalg.inv(self.prior[stamp]) @ it.surveyed
                truth = np.linalg.inv(self.truth[stamp]) @ it.true
                left, right = (str(self.folder / frame[side]) for side in ("left", "right"))
                found.append(Attempt(left, right, row["object"], prior, truth, row))
        return found


def variant(source, folder, prior=None, sigma=None):
    """A copy of a data set, with the site that has edges, and another prior where one is given."""
    source, folder = Path(source).resolve(), Path(folder)
    shutil.copytree(source, folder)
    about = (source / "dataset.toml").read_text()
    parsed = tomllib.loads(about)
    if (source / "site-edges.toml").exists():
        about = about.replace(f'"{parsed["site"]}"', '"site-edges.toml"')
    if prior:
        lines = []
        for line in about.splitlines():
            if line.split("=")[0].strip() == "prior":
                line = f'prior = "{prior}"'
            if line.split("=")[0].strip() == "prior_sigma":
                line = f"prior_sigma = {{ position = {sigma[0]}, attitude_deg = {sigma[1]} }}"
            lines.append(line)
        about = "\n".join(lines) + "\n"
    (folder / "dataset.toml").write_text(about)
    return folder


def run(seafix, folder, out, *words):
    """A run of the default pipeline on one thread."""
    said = subprocess.run([seafix, "run", folder, "--threads", "1", "--out", out, *words], capture_output=True, text=True)
    if said.returncode:
        raise SystemExit(said.stderr)
    return Path(out)


def tre(it, pose, truth):
    """The RMS error of the model points."""
    off = it.points @ (pose - truth)[:3, :3].T + (pose - truth)[:3, 3]
    return float(np.sqrt((off**2).sum(1).mean()))


def loops(it):
    """Closed outlines of faces, counterclockwise from outside, and the edges in none of them.

    Edges of one face have a normal and a distance in common. Ends nearer than the model's errors are one corner.
    """
    corners = []

    def corner(end):
        for i, other in enumerate(corners):
            if np.linalg.norm(end - other) < FACE_TOLERANCE:
                return i
        corners.append(end)
        return len(corners) - 1

    edges = [tuple(corner(end) for end in ends) for ends in it.edges]
    planes = []
    for number, (ends, normals) in enumerate(zip(it.edges, it.faces)):
        for normal in normals if len(normals) == 2 else []:
            distance = normal @ (ends[0] + ends[1]) / 2
            for plane in planes:
                if plane[0] @ normal > 0.9999 and abs(plane[1] - distance) < FACE_TOLERANCE:
                    plane[2].append(number)
                    break
            else:
                planes.append((normal, distance, [number]))
    outlines, used = [], set()
    for normal, _, numbers in planes:
        left = set(numbers)
        while left:
            first = left.pop()
            outline, members = list(edges[first]), [first]
            while outline[-1] != outline[0]:
                next_ones = [n for n in left if outline[-1] in edges[n]]
                if len(next_ones) != 1:
                    break
                left.discard(next_ones[0])
                members.append(next_ones[0])
                a, b = edges[next_ones[0]]
                outline.append(b if a == outline[-1] else a)
            if outline[-1] == outline[0] and len(outline) > 3:
                outline.pop()
                at = [corners[i] for i in outline]
                area = sum(np.cross(p, q) for p, q in zip(at, at[1:] + at[:1]))
                outlines.append(outline if area @ normal > 0 else outline[::-1])
                used.update(members)
    return corners, edges, outlines, [n for n in range(len(edges)) if n not in used]


def facing(it, number, pose):
    """Whether a face of the edge is turned to the left camera at the pose; edges without faces always are."""
    camera = np.linalg.inv(pose)[:3, 3]
    middle = (it.edges[number][0] + it.edges[number][1]) / 2
    normals = it.faces[number]
    return not normals or any(normal @ (camera - middle) > 0 for normal in normals)


def cao(it, pose, with_faces):
    """ViSP's model: faces where outlines close, and lines. Lines turned away from the camera at the prior are omitted."""
    corners, edges, outlines, rest = loops(it)
    if not with_faces:
        outlines, rest = [], range(len(edges))
    lines = [edges[n] for n in rest if facing(it, n, pose) and edges[n][0] != edges[n][1]]
    text = ["V1", str(len(corners)), *(" ".join(f"{x:.9f}" for x in corner) for corner in corners)]
    text += [str(len(lines)), *(f"{a} {b}" for a, b in lines), "0"]
    text += [str(len(outlines)), *(" ".join(map(str, [len(o), *o])) for o in outlines), "0", "0"]
    return "\n".join(text) + "\n"
