"""Conversions to the types of other packages."""

import numpy as np
import pytest
import seafix as sf


def test_a_pose_is_a_rotation_of_scipy(scene):
    transform = pytest.importorskip("scipy.spatial.transform")
    answer = sf.solve(sf.Problem(scene.model, scene.cloud, sigma=scene.sigma))
    rotation = sf.convert.rotation(answer)
    np.testing.assert_allclose(rotation.as_matrix(), answer.object_from_camera[:3, :3], atol=1e-12)
    many = sf.convert.rotation(np.tile(answer.object_from_camera, (4, 1, 1)))
    assert isinstance(many, transform.Rotation) and len(many) == 4
    rejected = sf.solve(sf.Problem(scene.model, scene.cloud[:2], sigma=scene.sigma))
    with pytest.raises(ValueError, match="no `object_from_camera`"):
        sf.convert.rotation(rejected)
    with pytest.raises(ValueError, match="shape"):
        sf.convert.rotation(np.eye(3))
    if hasattr(transform, "RigidTransform"):
        pose = transform.RigidTransform.from_matrix(answer.object_from_camera)
        np.testing.assert_allclose(sf.PosePrior(pose, 0.1, 0.1).T, answer.object_from_camera, atol=1e-12)


def test_a_trajectory_goes_to_evo_and_back():
    pytest.importorskip("evo")
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 0, 3] = [0.0, 1.0, 2.0]
    stamps = np.array([1, 2, 3]) * 1_000_000_000 + 500
    trajectory = sf.convert.evo_trajectory(stamps, poses)
    assert trajectory.path_length == pytest.approx(2.0)
    back, same = sf.convert.from_evo(trajectory)
    np.testing.assert_array_equal(back, stamps)
    np.testing.assert_array_equal(same, poses)
    with pytest.raises(ValueError, match="one stamp"):
        sf.convert.evo_trajectory(stamps[:2], poses)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    folder = tmp_path_factory.mktemp("log")
    (folder / "points.toml").write_text('question = "?"\nseed = 1\n[source]\nname = "virtual-points"\nframes = 4\n')
    run = sf.run(folder / "points.toml", folder / "run", threads=1)
    return run.log(run.trials[0])


def test_the_objects_of_a_log_are_in_the_world(log):
    assert set(log.objects) == set(log.models)
    for frame in log.frames:
        assert frame.navigated is None
        for target in frame.targets:
            if target.outcome == "fix":
                camera = log.objects[target.target] @ target.object_from_camera
                np.testing.assert_allclose(camera[:3, 3], frame.truth[:3, 3], atol=0.3)


def test_a_cloud_goes_to_open3d(log):
    pytest.importorskip("open3d", exc_type=ImportError)
    cloud = sf.convert.open3d_cloud(log.frames[0])
    np.testing.assert_array_equal(np.asarray(cloud.points), log.frames[0].cloud)
    np.testing.assert_array_equal(np.asarray(cloud.covariances), log.frames[0].covariances)
    with pytest.raises(ValueError, match=r"\(n, 3\)"):
        sf.convert.open3d_cloud(np.zeros((4, 2)))


def test_a_log_goes_to_rerun(log, tmp_path):
    rerun = pytest.importorskip("rerun")
    recording = rerun.RecordingStream("seafix")
    recording.save(tmp_path / "log.rrd")
    sf.convert.rerun_log(log, recording, entity="dive")
    recording.flush()
    recording.disconnect()
    written = (tmp_path / "log.rrd").read_bytes()
    fix = next(target for frame in log.frames for target in frame.targets if target.outcome == "fix")
    for path in ["/dive/objects/tree-a/points", f"/dive/fixes/{fix.target}", "/dive/camera/cloud", "/dive/truth"]:
        assert path.encode() in written, path


def test_a_missing_package_is_named(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "evo.core.trajectory", None)
    with pytest.raises(ImportError, match="pip install evo"):
        sf.convert.evo_trajectory([0], np.eye(4)[None])


def test_poses_that_are_no_motions_are_refused():
    mirrored = np.diag([1.0, 1.0, -1.0, 1.0])
    for pose in (np.ones((1, 4, 4)), np.full((1, 4, 4), np.nan), mirrored[None]):
        with pytest.raises(ValueError, match="not a rigid motion") as raised:
            sf.convert.evo_trajectory([1], pose)
        assert raised.value.field == "poses"
    with pytest.raises(ValueError, match="does not ascend") as raised:
        sf.convert.evo_trajectory([3, 1], np.stack([np.eye(4)] * 2))
    assert raised.value.field == "stamps_ns"
