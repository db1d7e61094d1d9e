"""Poses, trajectories, clouds and logs in the types of other packages.

Each function imports its package when it is called. The package must be installed; Seafix does not depend on it.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from ._seafix import Frame, Log
from .invalid import invalid

__all__ = ["evo_trajectory", "from_evo", "open3d_cloud", "rerun_log", "rotation"]

#: The names of packages whose module has another.
_PACKAGES = {"rerun": "rerun-sdk"}


def _module(name: str) -> Any:
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        package = name.partition(".")[0]
        package = _PACKAGES.get(package, package)
        raise ImportError(f"this conversion needs {package}; install it with `pip install {package}`") from error


def _matrices(pose: Any, name: str = "pose") -> npt.NDArray[np.float64]:
    """The matrices (…, 4, 4) of a pose or of arrays."""
    for attribute in ("object_from_camera", "world_from_camera"):
        if hasattr(pose, attribute):
            pose = getattr(pose, attribute)
            if pose is None:
                raise invalid(name, f"`{name}` has no `{attribute}`", "ask for `is_fix` or `outcome` first")
    array = np.asarray(pose, dtype=float)
    if array.shape[-2:] != (4, 4):
        raise invalid(name, f"`{name}` has the shape {array.shape}", "give a pose, or an array (4, 4) or (n, 4, 4)")
    rotations = array[..., :3, :3]
    products = rotations @ np.swapaxes(rotations, -1, -2)
    # Six digits, as files have them.
    rigid = np.allclose(products, np.eye(3), atol=1e-5) and np.allclose(array[..., 3, :], [0, 0, 0, 1])
    if not (rigid and np.isfinite(array).all() and (np.linalg.det(rotations) > 0).all()):
        raise invalid(name, f"`{name}` is not a rigid motion", "give rotations and translations without NaN")
    return array


def rotation(pose: Any) -> Any:
    """The rotation of a pose as a :class:`scipy.spatial.transform.Rotation`.

    Parameters
    ----------
    pose : Answer, Pose, Motion, TargetResult or array_like, shape (4, 4) or (n, 4, 4)
        A pose, of which the rotation of `object_from_camera` or `world_from_camera` is taken, or matrices.

    Returns
    -------
    scipy.spatial.transform.Rotation
        It maps vectors of the camera axes to those of the object or the world: ``rotation.apply(v_camera)``.

    Raises
    ------
    ValueError
        An answer without a fix, or an array of another shape.
    ImportError
        SciPy is not installed.

    Notes
    -----
    Arguments of Seafix that are rigid motions may be a ``scipy.spatial.transform.RigidTransform``, and
    ``RigidTransform.from_matrix(answer.object_from_camera)`` is the pose as one.

    Examples
    --------
    >>> np.degrees(sf.convert.rotation(answer).magnitude())
    """
    return _module("scipy.spatial.transform").Rotation.from_matrix(_matrices(pose)[..., :3, :3])


def evo_trajectory(stamps_ns: npt.ArrayLike, poses: npt.ArrayLike) -> Any:
    """A trajectory as an evo ``PoseTrajectory3D``.

    Parameters
    ----------
    stamps_ns : array_like of int, shape (n,)
        The times (ns).
    poses : array_like, shape (n, 4, 4)
        The poses ``world_from_camera`` (m).

    Returns
    -------
    evo.core.trajectory.PoseTrajectory3D
        Its times are seconds as floats: stamps since 1970 keep a quarter of a microsecond.

    Raises
    ------
    ValueError
        Arrays of other shapes.
    ImportError
        evo is not installed.

    Examples
    --------
    >>> estimate = sf.convert.evo_trajectory(*odometry.trajectory()[:2])
    """
    stamps, matrices = np.asarray(stamps_ns, dtype=np.int64), _matrices(poses, "poses")
    if matrices.ndim != 3 or stamps.shape != matrices.shape[:1]:
        what = f"`stamps_ns` has the shape {stamps.shape}"
        raise invalid("stamps_ns", what, f"give one stamp for each of {len(matrices)} poses")
    if (np.diff(stamps) <= 0).any():
        raise invalid("stamps_ns", "`stamps_ns` does not ascend", "sort the poses by time")
    return _module("evo.core.trajectory").PoseTrajectory3D(poses_se3=list(matrices), timestamps=stamps / 1e9)


def from_evo(trajectory: Any) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
    """The times and poses of an evo trajectory.

    Parameters
    ----------
    trajectory : evo.core.trajectory.PoseTrajectory3D
        The trajectory.

    Returns
    -------
    stamps_ns : ndarray of int, shape (n,)
        The times (ns).
    poses : ndarray, shape (n, 4, 4)
        The poses (m).

    Examples
    --------
    >>> sf.plot.trajectory(odometry.trajectory()[1], truth=sf.convert.from_evo(reference)[1])
    """
    stamps = np.round(np.asarray(trajectory.timestamps) * 1e9).astype(np.int64)
    return stamps, np.array(trajectory.poses_se3, dtype=float).reshape(-1, 4, 4)


def open3d_cloud(points: Any) -> Any:
    """A cloud as an Open3D ``PointCloud``.

    Parameters
    ----------
    points : Frame or array_like, shape (n, 3)
        Points (m), or a frame, of which the cloud is taken with the covariances of its points.

    Returns
    -------
    open3d.geometry.PointCloud
        The points, with covariances (m²) if they are known.

    Raises
    ------
    ValueError
        An array of another shape.
    ImportError
        Open3D is not installed.

    Notes
    -----
    ``np.asarray(cloud.points)`` is the way back.

    Examples
    --------
    >>> open3d.visualization.draw_geometries([sf.convert.open3d_cloud(log.frames[3])])
    """
    is_frame = isinstance(points, Frame)
    rows = np.asarray(points.cloud if is_frame else points, dtype=float)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise invalid("points", f"`points` has the shape {rows.shape}", "give a frame or an array (n, 3)")
    open3d = _module("open3d")
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(rows))
    if is_frame:
        cloud.covariances = open3d.utility.Matrix3dVector(points.covariances)
    return cloud


def rerun_log(log: Log, recording: Any = None, *, entity: str = "seafix") -> None:
    """Send a log to Rerun.

    Below `entity` there are the feature points of each surveyed object in the world, the estimated camera with its
    cloud, the left image, the true camera, and each fix as a camera of its own. The timelines are `stamp` and `frame`.
    The world is north, east, down.

    Parameters
    ----------
    log : Log
        The log of a trial.
    recording : rerun.RecordingStream, optional
        Where to send it; by default the current recording.
    entity : str, default "seafix"
        The path of the entity.

    Returns
    -------
    None

    Raises
    ------
    ImportError
        Rerun is not installed.

    Notes
    -----
    A camera is shown where the navigator, or else the first fix of the frame, has it; without both its cloud is left
    out.

    Examples
    --------
    >>> import rerun
    >>> rerun.init("seafix", spawn=True)
    >>> sf.convert.rerun_log(run.log(run.trials[0]))
    """
    rr = _module("rerun")

    def send(path: str, value: Any, *, static: bool = False) -> None:
        rr.log(f"{entity}/{path}" if path else entity, value, static=static, recording=recording)

    def pose(matrix: npt.NDArray[np.float64]) -> Any:
        return rr.Transform3D(translation=matrix[:3, 3], mat3x3=matrix[:3, :3])

    # North, east, down.
    send("", rr.ViewCoordinates.FRD, static=True)
    objects, models = log.objects, log.models
    for name, world_from_object in objects.items():
        send(f"objects/{name}", pose(world_from_object), static=True)
        send(f"objects/{name}/points", rr.Points3D(models[name]), static=True)
    for frame in log.frames:
        rr.set_time("frame", sequence=frame.frame, recording=recording)
        rr.set_time("stamp", timestamp=np.datetime64(frame.stamp_ns, "ns"), recording=recording)
        fixes = {
            target.target: objects[target.target] @ target.object_from_camera
            for target in frame.targets
            if target.object_from_camera is not None and target.target in objects
        }
        for name, matrix in fixes.items():
            send(f"fixes/{name}", pose(matrix))
        if frame.truth is not None:
            send("truth", pose(frame.truth))
        camera = frame.navigated if frame.navigated is not None else next(iter(fixes.values()), None)
        if camera is not None:
            send("camera", pose(camera))
            send("camera/cloud", rr.Points3D(frame.cloud))
        if frame.images is not None:
            send("left", rr.Image(frame.images[0]))
