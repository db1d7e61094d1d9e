"""Whether a pose solves a development problem, as their README states."""

import json

import numpy as np


def right(problems, name, pose):
    """Whether the pose is right: within three times the ideal error, or 5 cm and 2°, 1 cm in d."""
    truth = json.loads((problems / f"{name}.truth.json").read_text())
    model = np.array(json.loads((problems / f"{name}.json").read_text())["model"], float)[:, :3]
    pose, true = np.array(pose), np.array(truth["T_cam_obj"])
    off = model @ (pose - true)[:3, :3].T + (pose - true)[:3, 3]
    rms = np.sqrt((off**2).sum(1).mean())
    turn = np.degrees(np.arccos(np.clip((np.trace(pose[:3, :3].T @ true[:3, :3]) - 1) / 2, -1, 1)))
    near = rms < 0.01 if name[0] == "d" else np.linalg.norm(off.mean(0)) < 0.05 and turn < 2
    ideal = truth.get("ideal_tre_rms")
    return bool(truth["pose_defined"] and (near or bool(ideal) and rms <= 3 * ideal))


def answers(lines):
    """The lines of a driver: problem, time (ms), and pose or None."""
    for line in lines:
        words = line.split()
        if len(words) == 19:
            pose = np.array(words[3:], float).reshape(4, 4)
            yield words[0], float(words[1]), pose if words[2] == "1" and np.isfinite(pose).all() else None
