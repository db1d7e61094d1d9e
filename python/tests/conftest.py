"""Problems that the tests share."""

import numpy as np
import pytest

MODEL = np.array(
    [
        [0.0, 0.0, 0.0],
        [1.3, 0.0, 0.0],
        [0.3, -0.9, 0.0],
        [0.8, 0.6, 0.5],
        [-0.4, 0.7, 0.9],
        [0.1, -0.3, 1.2],
        [1.1, -0.5, 0.8],
        [0.6, 0.9, -0.3],
    ]
)


def rotation(axis, angle):
    """The rotation about an axis by an angle (rad), by Rodrigues' formula."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def motion(axis, angle, translation):
    """A rigid motion (4, 4)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation(axis, angle), translation
    return T


def moved(T, points):
    """The points mapped by T."""
    return points @ T[:3, :3].T + T[:3, 3]


class Scene:
    """An object of eight points, seen with noise among clutter."""

    sigma = 0.005

    def __init__(self):
        rng = np.random.default_rng(7)
        self.model = MODEL
        self.object_from_camera = motion([0.3, -0.2, 0.5], 0.6, [0.1, 0.2, -3.0])
        self.seen = moved(np.linalg.inv(self.object_from_camera), MODEL)
        self.seen += rng.normal(scale=self.sigma, size=MODEL.shape)
        clutter = rng.uniform([-1.5, -1.5, 2.0], [1.5, 1.5, 5.0], size=(12, 3))
        self.cloud = np.vstack([clutter, self.seen])
        self.pairs = np.column_stack([np.arange(8), np.arange(12, 20)])


@pytest.fixture(scope="session")
def scene():
    return Scene()
