"""Fixes and odometry from images."""

from pathlib import Path

import numpy as np
import pytest
import seafix as sf

SAMPLE = Path(__file__).parents[2] / "datasets" / "virtual-sample"


def pose(line):
    """The pose of a line of a TUM file: seconds tx ty tz qx qy qz qw."""
    _, *t, x, y, z, w = map(float, line.split())
    T = np.eye(4)
    T[:3, 3] = t
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return T


@pytest.fixture(scope="module")
def sample():
    rig, site = sf.Rig.load(SAMPLE / "dataset.toml"), sf.Site.load(SAMPLE / "site.toml")
    prior = pose((SAMPLE / "prior.tum").read_text().splitlines()[0])
    return rig, site, sf.PosePrior(prior, 0.1, np.radians(0.5))


def test_images_give_a_fix(sample):
    rig, site, prior = sample
    localizer = sf.Localizer(site, rig)
    assert rig.size == (1024, 768) and rig.baseline == pytest.approx(0.25)
    assert set(localizer.targets) == set(site.objects) and site.points(site.objects[0]).shape[1] == 3
    answers = localizer.localize(SAMPLE / "left000.png", SAMPLE / "right000.png", prior)
    assert any(answer.is_fix for answer in answers)
    for answer in answers:
        assert answer.target in site.objects and (answer.is_fix or answer.remedy)
    images = pytest.importorskip("PIL.Image")
    arrays = [np.asarray(images.open(SAMPLE / f"{side}000.png").convert("L")) for side in ("left", "right")]
    colour = [np.repeat(array[:, :, None], 3, axis=2) for array in arrays]
    for left, right in [arrays, [array.astype(np.float32) for array in arrays], colour]:
        again = localizer.localize(left, right, prior)
        assert [answer.outcome for answer in again] == [answer.outcome for answer in answers]
        for one, other in zip(again, answers):
            if one.is_fix:
                np.testing.assert_array_equal(one.object_from_camera, other.object_from_camera)


def test_points_give_a_fix(sample):
    rig, site, prior = sample
    answers = sf.Localizer(site, rig).localize(SAMPLE / "left000.png", SAMPLE / "right000.png", prior)
    fix = next(answer for answer in answers if answer.is_fix)
    points, T = site.points(fix.target), fix.camera_from_object
    localizer = sf.Localizer(site, rig, "solver = 'mahalanobis'")
    found = localizer.localize_points(points @ T[:3, :3].T + T[:3, 3], np.eye(3) * 1e-6, prior)
    answer = next(answer for answer in found if answer.target == fix.target)
    assert answer.is_fix
    np.testing.assert_allclose(answer.object_from_camera, fix.object_from_camera, atol=1e-6)


def test_bad_images_and_settings_are_refused(sample):
    rig, site, prior = sample
    localizer = sf.Localizer(site, rig)
    image = np.zeros((768, 1024), np.uint8)
    with pytest.raises(ValueError, match="calibrated for 1024×768") as raised:
        localizer.localize(image[:700], image, prior)
    assert raised.value.field == "left"
    with pytest.raises(ValueError, match="uint8"):
        localizer.localize(image, image.astype(np.int64), prior)
    with pytest.raises(ValueError, match="not finite"):
        localizer.localize(image, np.full((768, 1024), np.nan, np.float32), prior)
    with pytest.raises(FileNotFoundError):
        localizer.localize(SAMPLE / "missing.png", image, prior)
    with pytest.raises(ValueError, match="sover"):
        sf.Localizer(site, rig, "sover = 'kabsch'")
    with pytest.raises(ValueError, match="did you mean `kabsch`"):
        sf.Localizer(site, rig, "solver = 'kabsh'")
    with pytest.raises(FileNotFoundError):
        sf.Rig.load(SAMPLE / "missing.toml")
    with pytest.raises(ValueError, match="3 base points|base|unknown"):
        sf.Site.load(SAMPLE / "dataset.toml")


def test_a_blank_pair_is_skipped_by_the_odometry(sample):
    rig, _, _ = sample
    odometry = sf.Odometry(rig)
    image = np.zeros((768, 1024), np.uint8)
    motion = odometry.push(1, image, image)
    assert motion.outcome == "skipped" and "blank" in motion.reason and motion.world_from_camera is None
    with pytest.raises(ValueError, match="not later") as raised:
        odometry.push(1, image, image)
    assert raised.value.field == "stamp_ns"
    began = odometry.push(2, SAMPLE / "left000.png", SAMPLE / "right000.png")
    assert began.outcome == "began" and began.segment == 0
    np.testing.assert_array_equal(began.world_from_camera, np.eye(4))
    stamps, poses, segments = odometry.trajectory()
    assert stamps.tolist() == [2] and poses.shape == (1, 4, 4) and segments.tolist() == [0]
    for stamp in (-5, 2**70, 1.5):
        with pytest.raises(ValueError, match="whole nanoseconds") as raised:
            odometry.push(stamp, image, image)
        assert raised.value.field == "stamp_ns"
    with pytest.raises(ValueError, match="other sensors"):
        sf.Odometry(rig, "dvl-gyro")
